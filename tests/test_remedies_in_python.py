"""Every remedy that a call from Python, or a machine that fails, is answered with is followed here, and then it works.

Each entry asks for something impossible, finds the remedy in the message, and does what it says. The messages are
collected from the source: each must hold a remedy that an entry follows, or that `NOT_FOLLOWED` names with a reason.
Faults of files are in `test_remedies.py`.
"""

# ruff: noqa: E731, PLR0915 - a table: one line a question, one row a remedy

import ast
import importlib
import pickle
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy import interpolate
from typer.testing import CliRunner

import pinbound as pb
from pinbound.adapters.placo import half_spaces as placo_rows
from pinbound.batch import RandomSource, evaluation_of, run
from pinbound.cli import app
from pinbound.coverage.bodies import Body
from pinbound.coverage.covers import cover
from pinbound.crosscheck.regions_level import check_region
from pinbound.evaluate.touching import nearest_features
from pinbound.explorer.live import live_view
from pinbound.export import drake_text
from pinbound.extras import require
from pinbound.figures.report import tool_link
from pinbound.meshes import read_mesh
from pinbound.model.coupling import LinearLimit
from pinbound.model.xml_text import parse_file
from robots import ZOO, joint, robot_xml
from viewers import Server

SOURCE = Path(pb.__file__).parent
CLASSES = ("DimensionError", "UnsupportedError", "MachineError", "PinboundError")
OPTIONS = ("BadParameter", "UsageError")

LEAVES = "use inset(angle) or with_clearance(metres), or scale inscribed_polygon()"
"""What a `LeavesRegionError` says itself."""

Do = Callable[[Path], object]


@dataclass(frozen=True)
class Entry:
    """A remedy (as in the source, a value is ``{}``), what it is the answer to, and what follows it."""

    remedy: str
    fault: Do
    mended: tuple[Do, ...]


def one(remedy: str, fault: Do, *mended: Do) -> Entry:
    assert mended
    return Entry(remedy, fault, mended)


# robots


@cache
def minerva() -> pb.Robot:
    return pb.load("minervabot_v3")


@cache
def zoo(name: str) -> pb.Robot:
    return pb.load(ZOO[name])


PLANAR = [joint("q1", "revolute", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")]
"""Two joints: `near` has one effective angle, `far` has two."""
FAR = {"p": ("base", "0.2 0 0.1"), "s": ("b", "0.05 0 0.35")}
CRANE = [
    joint("lift", "prismatic", "base", "a", axis="0 0 1", limit="0 0.5"),
    joint("turn", "revolute", "a", "b", axis="0 1 0", xyz="0.1 0 0", limit="-2 2"),
]
BALLS = pb.Annotations.of(
    [pb.Point("p", "base", (0.6, 0, 0.1), 0.05), pb.Point("s", "b", (0.3, 0, 0), 0.05)],
    [pb.BoundaryMark("far", "p", "s")],
)
MADE: dict[Any, pb.Robot] = {}


def made(text: str, *marks: pb.Annotations) -> pb.Robot:
    key = (text, *map(id, marks))
    if key not in MADE:
        MADE[key] = pb.load(text, annotations=marks or None)
    return MADE[key]


def planar() -> pb.Robot:
    return made(robot_xml(PLANAR, {}, []), BALLS)


def to_move(name: str, at: str = "parcel") -> object:
    """Ask for a boundary between a mark of the robot and one that moves."""
    parcel = pb.Point("parcel", "base", (0.5, 0.5, 0.5), 0.01)
    return pb.MovingMarks(planar(), [parcel], [pb.BoundaryMark("m", name, "parcel")]).at({at: np.eye(4)})


def crane() -> pb.Robot:
    return made(robot_xml(CRANE, {}, []), BALLS)


def bare() -> pb.Robot:
    return made(robot_xml(PLANAR, {}, []))


@cache
def hexagon() -> pb.Region:
    return pb.feasible_region(minerva())


@cache
def curved() -> pb.Region:
    return pb.feasible_region(planar())


@cache
def mixed() -> pb.Region:
    return pb.feasible_region(crane())


def two_link(limits: tuple[str, str], turret: str = "0 0 1", first: str = "0 1 0") -> str:
    return robot_xml(
        [
            joint("turn", "revolute", "base", "turret", axis=turret, limit="-1 1"),
            joint("a", "revolute", "turret", "upper", axis=first, limit=limits[0]),
            joint("b", "revolute", "upper", "hand", axis="0 1 0", xyz="0 0 0.3", limit=limits[1]),
            joint("c", "fixed", "hand", "tool", xyz="0 0 0.2"),
        ],
        {},
        [],
    )


@cache
def arm(*words: Any) -> tuple[pb.Robot, pb.Region]:
    robot = pb.load(two_link(*words))
    return robot, pb.feasible_region(robot, ("a", "b"))


def touching(edge: str) -> object:
    region = pb.feasible_region(minerva(), ("q2", "q3"), window={"q2": (-0.1, 0.1)})
    return region.touching(next(one for one in region.edges if one.name == edge))


def featured(mark: str) -> Do:
    """Ask which parts are nearest of a box and what is written as an element of the annotations."""
    text = f"""<robot name="r" xmlns:pinbound="urn:pinbound:1"><link name="a"/><link name="b"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint><pinbound:annotations>
<pinbound:{mark} name="m" link="a" xyz="0 0 -2"/><pinbound:box name="n" link="b" xyz="0 0 0" rpy="0 0 0" size="1 1 1"/>
<pinbound:boundary name="mn" a="m" b="n"/></pinbound:annotations></robot>"""
    return lambda _: nearest_features(pb.load(text).boundaries["mn"].path, np.zeros((1, 1)))


def section(turn: str | None = None, words: Any = (("0.5 1.0", "0.5 1.0"),), link: str = "tool") -> Any:
    robot, region = arm(*words)
    return pb.workspace_section(robot, region, link, turn=turn)


def swept(words: Any = (("0.5 1.0", "0.5 1.0"),), lower: float = -0.5, upper: float = 0.5) -> Any:
    return pb.swept_body(arm(*words)[0], section("turn", words), lower, upper)


def patched(what: str, value: Any, then: Do) -> Do:
    """Return `then` with a limit of the package changed, so that the fault comes early."""

    def done(folder: Path) -> object:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(what, value)
            return then(folder)

    return done


def without(*modules: str, then: Do, where: str = "importlib.import_module") -> Do:
    """Return `then` as it goes where some libraries are not installed."""
    real = importlib.import_module

    def missing(name: str, package: str | None = None) -> Any:
        if name.partition(".")[0] in modules:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return real(name, package)

    return patched(where, missing, then)


def without_numba(then: Do) -> Do:
    """Return `then` as it goes where Numba is not installed."""

    def done(folder: Path) -> object:
        with pytest.MonkeyPatch.context() as patch:
            planar().boundaries.norms(ZERO)  # whatever asks for Numba is imported
            for name, module in list(sys.modules.items()):
                if name.startswith("pinbound.") and hasattr(module, "has_numba"):
                    patch.setattr(module, "has_numba", lambda: False)
            return then(folder)

    return done


def command(line: str) -> Do:
    """Return a command line; HERE in it is the folder. It must end with 0 or 1, or say why not."""

    def done(folder: Path) -> object:
        result = CliRunner().invoke(app, [word.replace("HERE", str(folder)) for word in line.split(" ")])
        if result.exit_code not in (0, 1):
            raise pb.PinboundError(" ".join(result.output.replace("│", " ").split()))
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        return result

    return done


# names


@dataclass(frozen=True)
class Unknown:
    """A question with a name in it, and a name that is nearly right: the one that the message gives is."""

    kind: str
    ask: Callable[[str, Path], object]
    wrong: str


def said(line: str) -> Callable[[str, Path], object]:
    """Return the question of a command line that holds NAME; only the error counts, and that it is gone."""

    def ask(name: str, folder: Path) -> object:
        line_ = line.replace("NAME", name)
        result = CliRunner().invoke(app, [word.replace("HERE", str(folder)) for word in line_.split(" ")])
        if result.exit_code == 2:
            raise pb.PinboundError(result.output)
        return result

    return ask


def job(folder: Path, robot: pb.Robot | None = None, **options: Any) -> object:
    evaluation = evaluation_of(robot or planar(), ("verdict",), backend="numpy")
    return run(evaluation, RandomSource(10, 1, (-1.0, 0.0), (1.0, 0.4)), folder / "out", **options)


ZERO = np.zeros(2)
UNKNOWN = [
    Unknown("coordinate", lambda name, _: planar().boundaries.limits(name, ZERO), "q22"),
    Unknown("coordinate", lambda name, _: planar().boundaries.limits_table(name, ZERO[None]), "q22"),
    Unknown("coordinate", lambda name, _: planar().boundaries["far"].limits(name, ZERO), "q22"),
    Unknown("coordinate", lambda name, _: minerva().boundaries["beta_5"].limit_expressions(name), "qq3"),
    Unknown("coordinate", lambda name, _: pb.feasible_region(planar(), ("q1", name)), "q22"),
    Unknown("contact edge", lambda name, _: touching(name), "q2 window upper"),
    Unknown("coordinate", lambda name, _: pb.limit_table(minerva(), "q2", name), "q33"),
    Unknown("coordinate", lambda name, _: section(name), "turned"),
    Unknown("coordinate", lambda name, _: speeds({"q1": 1.0, name: 1.0}), "q22"),
    Unknown("coordinate of the window", lambda name, _: pb.feasible_region(planar(), window={name: (-1, 1)}), "q22"),
    Unknown(
        "coordinate of the weights", lambda name, _: mixed().signed_distance(ZERO, weights={"lift": 1, name: 1}), "tur"
    ),
    Unknown("order of a point", lambda name, _: curved().contains(ZERO, order=name), "regio"),
    Unknown("boundary", lambda name, _: planar().boundaries[name], "fare"),
    Unknown("boundary", lambda name, _: planar().boundaries.select([name]), "fare"),
    Unknown("boundary", lambda name, _: pb.certify(planar(), ZERO, boundaries=[name]), "fare"),
    Unknown("boundary", lambda name, _: planar().coverage.of([name]), "fare"),
    Unknown("boundary of the atlas", lambda name, _: pb.pair_atlas(minerva())[name], "beta_44"),
    Unknown("frame", lambda name, _: planar().boundaries["far"].expression(frame=name), "minima"),
    Unknown("backend", lambda name, _: planar().boundaries.norms(ZERO[None], backend=name), "nump"),
    Unknown("group of columns", lambda name, _: evaluation_of(planar(), (name,)), "verdicts"),
    Unknown("level", lambda name, _: pb.cross_check(planar(), 3, levels=(name,)), "point"),
    Unknown("link", lambda name, _: tool_link(planar(), name), "bb"),
    Unknown("link", lambda name, _: planar().positions(name, ZERO), "bb"),
    Unknown("link", lambda name, _: pb.solve_ik(planar(), name, [0.1, 0, 0.6]), "bb"),
    Unknown("link", lambda name, _: section(link=name), "tol"),
    Unknown("shape", lambda name, _: pb.propose_marks(planar(), shapes=(name,)), "spheres"),
    Unknown("cover", lambda name, _: pb.propose_marks(planar(), by=name), "hull"),
    Unknown("preset", lambda name, _: pb.load(name), "palletizers/fanuc_m410ib_70"),
    Unknown("format", lambda name, _: pb.limit_table(minerva(), "q2", "q3", whole=True).text(name), "jskeu"),
    Unknown(
        "format", said("export minervabot_v3 table --format NAME --target q2 --dependent q3 --out HERE/t --whole"), "cs"
    ),
    Unknown("mark", lambda name, _: to_move(name), "ss"),
    Unknown("mark that moves", lambda name, _: to_move("s", name), "parcl"),
    Unknown("grid", lambda name, _: pb.limit_table(minerva(), "q2", "q3", grid=name), "fited"),
    Unknown("kind of export", lambda name, f: planar().boundaries and planar().export(name, f / "far.c"), "cc"),
    Unknown("kind of export", said("export minervabot_v3 NAME --out HERE/t.json"), "jso"),
    Unknown("kind of robot to start", said("new NAME --out HERE"), "paletizer"),
]


# calls


LOOP = robot_xml(
    [
        joint("j1", "revolute", "base", "a", axis="0 0 1", limit="-1 1"),
        joint("j2", "revolute", "a", "b", axis="0 0 1", xyz="0 1 0"),
        joint("j3", "revolute", "base", "c", axis="0 0 1", xyz="2 0 0"),
    ],
    {"p": ("base", "0.7 0.5 0"), "s": ("b", "1 0 0")},
    [("p", "s")],
    '<pinbound:closure name="loop" link_a="b" xyz_a="2.00001 0 0" link_b="c" xyz_b="0 1 0" passive="j2 j3" '
    'tolerance="2e-5"/>',
)
"""A parallelogram whose sides differ by 10 um."""

UNEQUAL = LOOP.replace('xyz_a="2.00001 0 0"', 'xyz_a="2.2 0 0"').replace('tolerance="2e-5"', "")
"""A four-bar linkage that is not a parallelogram."""


def speeds(velocity: Any) -> Any:
    from pinbound.adapters.shared import SafeSteps

    robot = planar()
    return SafeSteps(robot, robot.on(robot.model), velocity)


def rows(**options: Any) -> Do:
    return lambda _: pb.StepBounds(planar()).rows(ZERO, **({"step": 0.1} | options))


def configuration(robot: pb.Robot, q: Any) -> Any:
    """Return what Pink calls a configuration, as far as a barrier asks."""
    return SimpleNamespace(q=robot.to_pinocchio(robot.model, q), model=robot.model)


WORLD = (
    '<mujoco><worldbody><body name="a" pos="0 0 0.1">{}<joint name="{}" axis="0 1 0"/>{}</body></worldbody></mujoco>'
)
MASS = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
SECOND = '<body name="{}" pos="0 0 {}">' + MASS + '<joint name="q2" axis="0 1 0"/></body>'


def mujoco(first: str = "q1", body: str = "b", height: str = "0.4", second: bool = True) -> Do:
    def done(_: Path) -> object:
        library = pytest.importorskip("mujoco")
        from pinbound.adapters.mink import view_of

        text = WORLD.format(MASS, first, SECOND.format(body, height) if second else "")
        return view_of(planar(), library.MjModel.from_xml_string(text))

    return done


def missing_library(package: str, make: Callable[[], Any]) -> tuple[Do, Do]:
    from pinbound.adapters.shared import optional

    def absent(_: Path) -> object:
        return optional("no_such_module", "Thing", package)()

    return absent, lambda _: make()


def casadi(_: Path) -> object:
    pytest.importorskip("casadi")
    return planar().boundaries.to_casadi("values")


HULL = pb.Annotations.of(
    [pb.Hull("h", "b", ((0, 0, 0.1), (0.1, 0, 0.1), (0, 0.1, 0.1), (0, 0, 0.2)))], [pb.BoundaryMark("hull", "p", "h")]
)
BOX = pb.Annotations.of([pb.Box("x", "b", (0, 0, 0.1), (0, 0, 0), (0.1, 0.1, 0.1))], [pb.BoundaryMark("box", "p", "x")])
ROD = pb.Annotations.of([pb.Segment("r", "b", (0, 0, 0.1), (0, 0, 0.2), 0.02)], [pb.BoundaryMark("rod", "p", "r")])


def hulled() -> pb.Robot:
    return made(robot_xml(PLANAR, {}, []), BALLS, HULL)


def boxed() -> pb.Robot:
    return made(robot_xml(PLANAR, {}, []), BALLS, BOX)


def rodded() -> pb.Robot:
    return made(robot_xml(PLANAR, {}, []), BALLS, ROD)


def spline(x: Any = (0.0, 1.0, 2.0), c: Any = None) -> Any:
    c = np.zeros((2, 2, 2)) if c is None else np.asarray(c, dtype=float)
    made = interpolate.PPoly(np.zeros((c.shape[0], len(x) - 1, *c.shape[2:])), np.arange(len(x), dtype=float))
    made.c, made.x = c, np.asarray(x, dtype=float)
    return made


def certify(motion: Any, **options: Any) -> Do:
    return lambda _: pb.certify(planar(), motion() if callable(motion) else motion, **options)


def bounded(function: Any = None, start: float = 0.0, end: float = 1.0, speed: Any = (1.0, 1.0), **more: Any) -> Do:
    moving = (lambda t: np.outer(t, [0.5, 0.5])) if function is None else function
    return lambda _: pb.certify(planar(), pb.BoundedMotion(moving, start, end, speed=speed, **more))


def norms(Q: Any, **options: Any) -> Do:
    return lambda _: planar().boundaries.norms(Q, **options)


def out_of(shape: tuple[int, ...] = (4, 1), **options: Any) -> Do:
    return norms(np.zeros((4, 2)), out=np.zeros(shape, **options))


def shared_memory(own: bool) -> Do:
    def done(_: Path) -> object:
        whole = np.zeros((4, 2))
        return planar().boundaries.norms(whole, out=np.zeros((4, 1)) if own else whole[:, :1])

    return done


def region(robot: Callable[[], pb.Robot] = planar, **options: Any) -> Do:
    return lambda _: pb.feasible_region(robot(), **options)


def table(**options: Any) -> Do:
    return lambda _: pb.limit_table(minerva(), **({"target": "q2", "dependent": "q3"} | options))


TURNS = [joint("q1", "continuous", "base", "a", xyz="0 0 0.1"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")]
SKEW = [
    joint("q1", "continuous", "base", "a"),
    joint("copy", "continuous", "a", "b", xyz="0 0 0.4", mimic="q1 1.4142135623730951 0"),
]
WILD = [joint("q1", "revolute", "base", "a", limit="-1e4 1e4"), PLANAR[1]]


def endless() -> pb.Robot:
    return made(robot_xml(TURNS, {}, []), BALLS)


def skew(mark: pb.Annotations = BALLS) -> pb.Robot:
    return made(robot_xml(SKEW, {}, []), *((BALLS,) if mark is BALLS else (BALLS, mark)))


def model_of(text: str, mimic: bool = False) -> Any:
    return pin.buildModelFromXML(text, mimic=mimic) if mimic else pin.buildModelFromXML(text)


GEARED = [
    joint("q1", "revolute", "base", "a", xyz="0 0 0.1"),
    joint("copy", "revolute", "a", "b", xyz="0 0 0.4", mimic="q1 2 0.1"),
    joint("last", "revolute", "b", "c", xyz="0 0 0.2"),
]


def geared() -> pb.Robot:
    return made(robot_xml(GEARED, {}, []))


def locked(names: tuple[str, ...], at: dict[str, float]) -> Do:
    """Return the view of a model in which joints are locked at values."""

    def done(_: Path) -> object:
        robot = geared()
        model = robot.model
        q = robot.to_pinocchio(model, robot.home)
        for name, value in at.items():
            q[model.joints[model.getJointId(name)].idx_q] = value
        return robot.on(pin.buildReducedModel(model, [model.getJointId(name) for name in names], q))

    return done


def circle(robot: Callable[[], pb.Robot], q: Any) -> Do:
    """Return the clearances at a q of a model in which the first joint is continuous."""

    def done(_: Path) -> object:
        return robot().on(robot().model).clearances(np.asarray(q, dtype=float))

    return done


def endless_model(q: Any) -> Do:
    def done(_: Path) -> object:
        text = robot_xml(TURNS, {}, [])
        return endless().on(model_of(text)).clearances(np.asarray(q, dtype=float))

    return done


RULED = '<pinbound:rule name="r" coefficients="turn: 1" upper="1">{}</pinbound:rule>'
WHERE = '<pinbound:where coefficients="lift: 1" lower="0.2"/>'


def ruled(where: str) -> pb.Robot:
    return made(robot_xml(CRANE, {}, [], RULED.format(where)), BALLS)


def file_fault(path: Callable[[Path], Path], read: Callable[[Path], object], fails: bool) -> Do:
    """Return a file read while the disk does not read, or does."""

    def done(folder: Path) -> object:
        file = path(folder)
        with pytest.MonkeyPatch.context() as patch:
            if fails:

                def broken(*_: Any, **__: Any) -> Any:
                    raise OSError(5, "Input/output error", str(file))

                for name in ("read_bytes", "read_text", "open"):
                    patch.setattr(Path, name, broken)
            return read(file)

    return done


def urdf_file(folder: Path) -> Path:
    path = folder / "planar.urdf"
    if not path.exists():
        path.write_text(robot_xml(PLANAR, {}, []))
    return path


def sidecar(folder: Path) -> Path:
    urdf_file(folder)
    path = folder / "more.yaml"
    if not path.exists():
        path.write_text("home: {q1: 0.1}\n")
    return path


def lost_rows(folder: Path) -> object:
    """Run a job whose first chunk comes back short."""
    from pinbound.batch.job import _Job

    real = _Job.keep

    def keep(self: Any, index: int, data: bytes, statistics: Any) -> Any:
        return real(self, index, data, replace(statistics, rows=statistics.rows - 1))

    return patched("pinbound.batch.job._Job.keep", keep, job)(folder)


def lost_chunk(folder: Path) -> object:
    """Run a job of which one chunk never comes back."""
    real = RandomSource.chunks

    def chunks(self: Any, size: int, wanted: Any) -> Any:
        return real(self, size, list(wanted)[:-1])

    return patched("pinbound.batch.sources.RandomSource.chunks", chunks, lambda f: job(f, chunk_rows=5))(folder)


def full_disk(folder: Path) -> object:
    import os

    def refused(*_: Any) -> Any:
        raise OSError(28, "No space left on device")

    return patched("pinbound.batch.files.os", SimpleNamespace(**vars(os) | {"write": refused}), job)(folder)


def entries() -> Iterator[Entry]:
    """Yield them by the room that says the remedy."""
    # model, path
    finite = "give finite numbers"
    masked = np.ma.masked_invalid([[0.0, np.nan]])
    yield one("Ask for a boundary between two bodies", featured('plane normal="0 0 1"'), featured("point"))
    yield one("fill them or leave their rows out", norms(masked), norms(masked.filled(0.0)), norms(masked[1:]))
    yield one("give real numbers", norms([[0j, 1.0]]), norms([[0.0, 1.0]]))
    yield one("give numbers", norms([["a", "b"]]), norms([[0.0, 1.0]]))
    yield one("give numbers", norms([[0.0, 1.0], [0.0]]), norms([[0.0, 1.0]]))

    class Frame(np.ndarray):
        """Stands for a data frame: an array whose columns have names."""

        columns: Any = ()

    def frame(*columns: str) -> Do:
        def done(_: Path) -> object:
            made = np.zeros((1, 2)).view(Frame)
            made.columns = columns
            return planar().boundaries.norms(made)

        return done

    yield one("give them in the order {}", frame("q2", "q1"), frame("q1", "q2"))
    yield one("give ({},) or (N, {}), the last axis being: {}", norms([0.0]), norms([0.0, 1.0]), norms([[0.0, 1.0]]))
    chain = [
        joint(
            f"j{i}", "revolute", f"l{i - 1}" if i else "base", f"l{i}", **({"mimic": f"j{i - 1} 1e200 0"} if i else {})
        )
        for i in range(3)
    ]
    tame = [text.replace("1e200", "1") for text in chain]
    yield one(
        "mend its <mimic> elements",
        lambda _: pb.load(robot_xml(chain, {}, [])),
        lambda _: pb.load(robot_xml(tame, {}, [])),
    )
    free = [joint("x", "floating", "base", "a"), joint("q", "revolute", "a", "b")]
    one_side = robot_xml(free, {"p": ("a", "0.6 0 0.1"), "s": ("b", "0.3 0 0")}, [("p", "s")])
    yield one(
        "name points on one side of it, or model it by revolute and prismatic joints",
        lambda _: made(robot_xml(free, {}, []), BALLS),
        lambda _: made(one_side),
        lambda _: made(robot_xml([joint("x", "prismatic", "base", "a"), free[1]], {}, []), BALLS),
    )
    # adapters
    yield one("MuJoCo's joint {} does not move in {}. {}", mujoco(first="q11"), mujoco())
    yield one("the MuJoCo model has no joint {}. {}", mujoco(second=False), mujoco())
    yield one("give each body the name of its link in the URDF. {}", mujoco(body="bb"), mujoco())
    yield one("compile it from the same URDF", mujoco(height="0.5"), mujoco())

    def step_limit(**options: Any) -> Do:
        def done(_: Path) -> object:
            pytest.importorskip("pink")
            from pinbound.adapters.pink import StepLimit

            robot, model = planar(), planar().model.copy()
            if not options:
                model.velocityLimit = np.zeros(model.nv)
            return StepLimit(robot, model, **options)

        return done

    yield one("give velocity=, the largest speed of each coordinate", step_limit(), step_limit(velocity=1.0))

    ends = [pb.Point("p", "base", (0, 0, 0.9)), pb.Point("s", "b", (0, 0, 0.4))]
    touching = pb.Annotations.of(ends, [pb.BoundaryMark("far", "p", "s")])
    apart = pb.Annotations(home={"q1": 0.5})

    def barrier(q: Any) -> Do:
        def done(_: Path) -> object:
            pytest.importorskip("pink")
            from pinbound.adapters.pink import BoundaryBarrier

            robot = made(robot_xml(PLANAR, {}, []), touching, apart)
            return BoundaryBarrier(robot, robot.model).compute_jacobian(configuration(robot, q))

        return done

    yield one("start out of contact", barrier([0.0, 0.0]), barrier([0.5, 0.0]))
    libraries = "this needs {}, which is not installed: pip install 'pinbound[bridges]'"
    yield one(libraries, *missing_library("mink", lambda: speeds(1.0)))
    imported = "pinbound.export.casadi_functions.import_module"
    absent = without("casadi", where=imported, then=lambda _: planar().boundaries.to_casadi("values"))
    yield one(libraries.replace("{}", "casadi"), absent, casadi)
    seconds = "give a positive number of seconds"
    yield one(seconds, lambda _: speeds(1.0).half_spaces(ZERO, 0.0), lambda _: speeds(1.0).half_spaces(ZERO, 0.1))
    each = "give the largest speed of every coordinate"
    yield one(each, lambda _: speeds({"q1": 1.0}), lambda _: speeds({"q1": 1.0, "q2": 1.0}))
    each = "give the largest speed of {}, each positive and finite"
    yield one(each, lambda _: speeds([1.0, 0.0]), lambda _: speeds([1.0, 1.0]))

    def polytope(A: Any, b: Any = None) -> Do:
        def done(_: Path) -> object:
            from pinbound.adapters.shared import Polytope

            robot = planar() if b is not None else spatial()
            return Polytope(robot, robot.on(robot.model), A() if callable(A) else A, b)

        return done

    @cache
    def spatial() -> pb.Robot:
        joints = [*PLANAR, joint("q3", "revolute", "b", "c", xyz="0 0 0.2")]
        return made(robot_xml(joints, {"p": ("base", "0.3 0 1.2"), "s": ("c", "0.1 0 0.3")}, [("p", "s")]))

    yield one("give (k, {}) and (k,)", polytope(np.ones((1, 3)), [1.0]), polytope(np.ones((1, 2)), [1.0]))
    yield one(
        "Use step-safe rows",
        polytope(lambda: pb.feasible_region(spatial(), ("q1", "q2"))),
        lambda _: pb.StepBounds(spatial()).rows(spatial().home, 0.1),
    )
    yield one(
        "give one positive number, or {} of them [rad, or m of a prismatic joint]",
        rows(step=0.0),
        rows(),
        rows(step=[0.1, 1]),
    )
    yield one("give a share above 0, at most 1", rows(gain=0.0), rows(gain=0.5))
    yield one("give metres, not below 0", rows(margin=-1.0), rows(margin=0.01))
    yield one("give the number of rows, at least 1, or None", rows(most=0), rows(most=1), rows(most=None))
    sloppy = lambda **more: lambda _: pb.StepBounds(made(LOOP)).rows(made(LOOP).home, 0.01, **more)
    yield one("leave limits=True", sloppy(limits=False), sloppy(limits=True), sloppy())
    # annotations, files
    colon = pb.Annotations(home={"q 1": 0.1})
    odd = [joint("q 1", "revolute", "base", "a"), joint("q2", "revolute", "a", "b", xyz="0 0 0.4")]

    def written(as_yaml: bool) -> Do:
        def done(folder: Path) -> object:
            text = colon.to_yaml() if as_yaml else colon.to_xml()
            (folder / "odd.urdf").write_text(robot_xml(odd, {}, []))
            (folder / "odd.pinbound.yaml").write_text(text)
            return pb.load(folder / "odd.urdf")

        return done

    yield one("write a sidecar", written(False), written(True))
    again = "try again once it can be read"
    yield one(again, file_fault(urdf_file, parse_file, True), file_fault(urdf_file, parse_file, False))

    def with_sidecar(file: Path) -> object:
        from pinbound.annotations.sidecar import read_sidecar
        from pinbound.exceptions import Problems

        return read_sidecar(file, Problems(file.name))

    yield one(again, file_fault(sidecar, with_sidecar, True), file_fault(sidecar, with_sidecar, False))

    def mesh(folder: Path) -> Path:
        (folder / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
        return folder / "m.obj"

    yield one(again, file_fault(mesh, read_mesh, True), file_fault(mesh, read_mesh, False))
    # batch
    mark_it = "mark it, or ask for limits_only=True"
    verdict = ("verdict",)
    limits_only: Do = lambda _: evaluation_of(bare(), verdict, limits_only=True)
    yield one(
        mark_it, lambda _: evaluation_of(bare(), verdict), lambda _: evaluation_of(planar(), verdict), limits_only
    )
    yield one(
        "leave out the column 'region'", lambda _: evaluation_of(bare(), ("region",), limits_only=True), limits_only
    )
    resume = "What is written is kept: run the same command again to resume."
    yield one(resume, full_disk, job)
    yield one("Run the same command again to resume.", lost_rows, job)
    yield one("Run the same command again to resume.", lost_chunk, lambda f: job(f, chunk_rows=5))
    yield one(
        "type: pip install 'pinbound[distributed]'",
        without("distributed", then=lambda f: job(f, scheduler="tcp://127.0.0.1:1")),
        lambda _: importlib.import_module("distributed"),
    )
    arrow = "type: pip install 'pinbound[batch]'"
    yield one(arrow, without("pyarrow", then=job), job)
    report = lambda _: require("report", "a report")
    yield one("type: pip install 'pinbound[{}]'", without("jinja2", then=report), report)
    # boundaries
    one_q = "give one configuration ({},), not {}"
    near = lambda q: lambda _: planar().boundaries.limits("q1", q)
    yield one(one_q, near(np.zeros((2, 2))), near(ZERO))
    yield one(finite, near([0.0, np.nan]), near(ZERO))
    yield one(
        finite,
        lambda _: planar().boundaries["far"].limits("q1", [0.0, np.nan]),
        lambda _: planar().boundaries["far"].limits("q1", ZERO),
    )
    yield one(
        finite,
        lambda _: planar().boundaries.limits_table("q1", [[0.0, np.inf]]),
        lambda _: planar().boundaries.limits_table("q1", [ZERO]),
    )
    nearest = lambda name: lambda _: getattr(hulled().boundaries["hull"], name)(ZERO)
    yield one("call nearest_points(q)", nearest("nearest"), nearest("nearest_points"))
    twice = lambda *names: lambda _: planar().boundaries.select(names)
    yield one("name each boundary once", twice("far", "far"), twice("far"))
    smallest = lambda q, **options: lambda _: planar().boundaries.smallest(q, **options)
    yield one("remove out=", smallest(ZERO, out=np.zeros(1)), smallest(ZERO), smallest([ZERO], out=np.zeros(1)))
    spans = lambda window: lambda _: planar().boundaries.limits("q1", ZERO, window=window)
    yield one("give a window that contains it", spans((1.0, 2.0)), spans((-1.0, 2.0)))
    yield one("give window=(lower, upper)", spans("wide"), spans((-1.0, 2.0)))
    yield one("give window=(lower, upper), the lower end first", spans((2.0, -1.0)), spans((-1.0, 2.0)))
    # kernel
    yield one("give float64 or float32", norms([ZERO], dtype="int32"), norms([ZERO], dtype="float32"))
    yield one("give a whole number of {} or more", norms([ZERO], threads=0), norms([ZERO], threads=1))
    compiled = norms([ZERO], backend="compiled")
    numba = "type: pip install 'pinbound[fast]', or leave the choice to 'auto'"
    yield one(numba, without_numba(compiled), compiled, without_numba(norms([ZERO])))
    array = "give a writeable {} array of shape {}"
    yield one(array, out_of((3, 1)), out_of())
    yield one("give an array of its own", shared_memory(False), shared_memory(True))
    repeated = np.lib.stride_tricks.as_strided(np.zeros(1), (4, 1), (0, 8))
    yield one("give a plain array", norms(np.zeros((4, 2)), out=repeated), out_of())
    long = lambda: made(robot_xml([PLANAR[0], PLANAR[1].replace("0 0 0.4", "0 0 1e20")], {}, []), BALLS)
    single = lambda kind: lambda _: long().boundaries.norms([ZERO], dtype=kind)
    yield one("use dtype=np.float64", single(np.float32), single(np.float64))
    slopes = lambda order: np.zeros((4, 10, 3), order=order)
    C_ordered = lambda order: lambda _: minerva().boundaries.gradients(np.zeros((4, 3)), out=slopes(order))
    yield one("give a C-contiguous array", C_ordered("F"), C_ordered("C"))
    # limits
    wild = [
        joint("q", "revolute", "base", "a", limit="-1e9 1e9"),
        joint("f", "continuous", "a", "b", xyz="1 0 0", mimic="q 1e6 0"),
    ]
    far_apart = {"p": ("base", "9 0 0"), "s": ("b", "0.2 0 0")}
    fast = robot_xml(wild, far_apart, [("p", "s")]).replace(' xyz="9 0 0"', ' xyz="1.21 0 0" radius="0.001"')
    spin = lambda **options: lambda _: made(fast).boundaries.limits("q", [0.9], **options)
    yield one("give a window of at most {} around it", spin(), spin(window=(0.88, 0.92)))
    listed = lambda window: lambda _: made(fast).boundaries["p_s"].limits("q", [0.9], window=window)
    most = "give a window of at most {}, or call BoundarySet.limits, which finds the nearest ones only"
    yield one(most, listed((-1.0, 1.0)), listed((0.88, 0.92)))
    endless_ = "give window=(lower, upper)"
    turned = lambda mark, name, **more: lambda _: skew(mark).boundaries[name].limits("q1", [0.0], **more)
    yield one(endless_, turned(BALLS, "far"), turned(BALLS, "far", window=(-3.0, 3.0)))
    yield one(endless_, turned(ROD, "rod"), turned(ROD, "rod", window=(-3.0, 3.0)))
    flat = [pb.Segment("A", "a", (0, 0, 0), (0, 0, -1)), pb.Point("B", "base", (0, 0, 0.6))]

    def stretch(distance: float) -> Do:
        def done(_: Path) -> object:
            marks = pb.Annotations.of(flat, [pb.BoundaryMark("beta", "A", "B", distance)])
            return pb.load(robot_xml(PLANAR, {}, []), annotations=marks).boundaries["beta"].limits("q1", ZERO)

        return done

    yield one("change the threshold by more than that", stretch(0.4999999999), stretch(0.4999))
    # closed forms
    form = lambda robot, name, of="far": lambda _: robot().boundaries[of].limit_expressions(name)
    many = lambda robot, name, of="far": lambda _: robot().boundaries[of].limits(name, ZERO)
    yield one("limits(...) gives their values, all of them", form(rodded, "q1", "rod"), many(rodded, "q1", "rod"))
    numbers = "limits(...) gives its values, numerically and all of them"
    yield one(numbers, form(crane, "lift"), many(crane, "lift"))
    yield one(
        "name the other boundaries, or mark a box, a sweep or a capsule instead",
        lambda f: hulled().export("json", f / "r.json"),
        lambda f: hulled().export("json", f / "r.json", boundaries=["far"]),
        lambda f: boxed().export("json", f / "r.json"),
        lambda f: rodded().export("json", f / "r.json"),
    )
    yield one(
        "name the other boundaries, or cover these bodies by capsules",
        lambda f: boxed().export("c", f / "r.c"),
        lambda f: boxed().export("c", f / "r.c", boundaries=["far"]),
        lambda f: rodded().export("c", f / "r.c"),
    )
    header = "the header takes the same name, ending in .h"
    yield one(header, lambda f: planar().export("c", f / "r.cc"), lambda f: planar().export("c", f / "r.c"))
    # certificates
    yield one("give at least one", certify(np.zeros((0, 2))), certify([ZERO]))
    yield one(finite, certify([[0.0, np.nan]]), certify([ZERO]))
    pair = [ZERO, ZERO + 0.1]
    yield one("give one per waypoint, ({},)", certify(pair, times=[0.0]), certify(pair, times=[0.0, 1.0]))
    yield one(finite, certify(pair, times=[0.0, np.inf]), certify(pair, times=[0.0, 1.0]))
    late = "give them in seconds"
    yield one(late, certify(pair, times=[-1.7e308, 1.7e308]), certify(pair, times=[0.0, 1.0]))
    order = "sort the waypoints, one for each time"
    yield one(order, certify(pair, times=[1.0, 0.0]), certify(pair, times=[0.0, 1.0]))
    nearer = "give a motion that stays nearer to zero"
    yield one(nearer, certify([[0.0, 1e101]]), certify([[0.0, 1.0]]))
    own = "a spline or function has its own"
    yield one(own, certify(spline, times=[0, 1]), certify(spline))
    wrap = "wrap it as pb.BoundedMotion(function, start, end, speed=...) with bounds of its derivatives"
    yield one(wrap, certify(lambda: np.sin), bounded())
    yield one("give a length in metres, zero or more", certify([ZERO], precision=-1), certify([ZERO], precision=1e-6))
    yield one(
        "give numbers, 0 or more",
        certify([ZERO], budget=None) if False else lambda _: pb.Budget(-1, 1.0),
        lambda _: pb.certify(planar(), [ZERO], budget=pb.Budget(10, 1.0)),
    )
    yield one(
        "give pinbound.Budget(boxes=..., seconds=...)", certify([ZERO], budget=3), certify([ZERO], budget=pb.Budget(3))
    )
    yield one("give a name, or a list of names", certify([ZERO], boundaries=3), certify([ZERO], boundaries="far"))
    on = lambda model: lambda _: planar().on(planar().model if model else None)
    yield one("give a pinocchio.Model, e.g. robot.model, or the .model of a wrapper", on(False), on(True))
    yield one("give a Robot, e.g. pinbound.load(...)", lambda _: pb.certify("far", [ZERO]), certify([ZERO]))
    place = lambda *xyz: lambda _: planar().positions("base", ZERO, xyz)
    yield one("give three numbers", place(1.0, 2.0), place(1.0, 2.0, 3.0))
    yield one("give three finite numbers", place(1.0, 2.0, np.nan), place(1.0, 2.0, 3.0))
    write = lambda path: lambda folder: planar().export("json", path and folder / path)
    yield one("give the path of a file", write(None), write("chains.json"))
    for asked, left in (({"boundaries": ["far"]}, {}), ({"limits": False}, {})):
        yield one("leave {} out", certify([ZERO], limits_only=True, **asked), certify([ZERO], limits_only=True, **left))
    yield one("give a function of time", bounded(1.0), bounded())
    yield one("give finite times in order", bounded(end=-1.0), bounded())
    yield one("give one number per coordinate, ({},)", bounded(speed=[1.0]), bounded())
    yield one("give finite numbers, 0 or more", bounded(speed=[-1.0, 1.0]), bounded())
    shape = "give (times, coordinates), here {}"
    yield one(shape, bounded(np.asarray), bounded())
    late = "end the motion before, or start after"
    growing = lambda t: np.where(t > 0.5, np.nan, t)[:, None] * [0.5, 0.5]
    yield one(late, bounded(growing), bounded(growing, end=0.5))
    fading = lambda t: np.where(t < 0.5, np.nan, t)[:, None] * [0.5, 0.5]
    yield one(late, bounded(fading), bounded(fading, start=0.5))
    true = "a certificate needs true bounds and true derivatives"
    yield one(true, bounded(speed=[0.1, 0.1]), bounded(speed=[0.5, 0.5]))
    rate = "let function(t, 1) be dq/dt, or leave acceleration out"
    moved = lambda t: np.outer(t, [0.5, 0.5])
    derived = lambda t, order=0: np.outer(t**0.0 if order else t, [0.5, 0.5])
    yield one(
        rate,
        bounded(moved, acceleration=[0.1, 0.1]),
        bounded(derived, acceleration=[0.1, 0.1]),
        bounded(moved),
    )
    swap = "swap them"
    yield one(
        swap,
        lambda _: pb.certify_box(planar(), [0.1, 0.0], ZERO),
        lambda _: pb.certify_box(planar(), ZERO, [0.1, 0.0]),
    )
    yield one(
        "give one positive number [rad or m]",
        lambda _: pb.certified_box(planar(), ZERO, reach=0.0),
        lambda _: pb.certified_box(planar(), ZERO, reach=0.01),
    )
    ndim = lambda _: pb.certify(planar(), interpolate.NdPPoly(np.zeros((1, 1, 2)), [[0.0, 1.0]]))
    yield one("convert it to one of these", ndim, certify(spline))
    yield one(
        "give it in radians, metres and seconds",
        certify(lambda: spline(c=np.full((2, 2, 2), 1e308), x=(0, 1e9, 2e9))),
        certify(spline),
    )
    yield one(finite, certify(lambda: spline(c=np.full((2, 2, 2), np.nan))), certify(spline))
    yield one("Fit it by pieces of a lower degree", certify(lambda: spline(c=np.zeros((60, 2, 2)))), certify(spline))
    yield one(
        "build it again with its pieces in order of time", certify(lambda: spline((0.0, 2.0, 1.0))), certify(spline)
    )
    apart_ = "give them in seconds"
    yield one(apart_, certify(lambda: spline((-1.7e308, 0.0, 1.7e308))), certify(spline))
    yield one(apart_, certify(lambda: spline((-1.7e308, 1.7e308, 1.75e308))), certify(spline))
    yield one(
        "the spline has values of shape {}; give ({},)", certify(lambda: spline(c=np.zeros((2, 2, 3)))), certify(spline)
    )
    lasting = "give breakpoints that increase"
    yield one(lasting, certify(lambda: spline((0.0, 0.0, 0.0))), certify(spline))

    def bspline(knots: Any) -> Any:
        made = interpolate.BSpline([0.0, 0.0, 1.0, 1.0], np.zeros((2, 2)), 1)
        made.t = np.asarray(knots, dtype=float)
        return made

    yield one(lasting, certify(lambda: bspline([0, 0, 0, 0])), certify(lambda: bspline([0, 0, 1, 1])))
    jump = np.zeros((1, 2, 2))
    jump[0, 1] = 0.1
    halves = spline((0.0, 1.0), np.zeros((1, 1, 2))), spline((1.0, 2.0), np.full((1, 1, 2), 0.1))
    joined = np.zeros((2, 2, 2))
    joined[0, 1] = 0.1
    yield one(
        "join the pieces, or certify each continuous part on its own",
        certify(lambda: spline(c=jump)),
        certify(lambda: spline(c=joined)),
        certify(lambda: halves[0]),
        certify(lambda: halves[1]),
    )
    # coverage, marking, crosscheck
    body = Body("a", 0, "box", (0.1, 0.1, 0.1), np.eye(3), np.zeros(3))
    covering = lambda accuracy, of=body: lambda _: cover(of, accuracy)
    yield one("give metres above 0", covering(0.0), covering(0.01))
    heart = Body("a", 0, "heart", (0.1, 0.1, 0.1), np.eye(3), np.zeros(3))
    yield one("give one of: {}", covering(0.01, heart), covering(0.01))
    yield one(
        "give radians above 0",
        lambda _: check_region(minerva(), step=0.0),
        lambda _: check_region(minerva(), step=0.3),
    )
    flat_hull = pb.Hull("f", "b", ((0, 0, 0.1), (0.1, 0, 0.1), (0, 0.1, 0.1)))
    thick_hull = pb.Hull("f", "b", (*flat_hull.vertices, (0, 0, 0.101)))

    def checked(mark: Any) -> Do:
        def done(_: Path) -> object:
            marks = pb.Annotations.of([mark], [pb.BoundaryMark("f", "p", "f")])
            robot = pb.load(robot_xml(PLANAR, {}, []), annotations=[BALLS, marks])
            return pb.cross_check(robot, 3, levels=("boundaries",), rays=2)

        return done

    yield one("mark a body with some thickness", checked(flat_hull), checked(thick_hull))
    led = lambda offset: [*PLANAR, joint("f", "revolute", "b", "c", mimic=f"q2 -2 {offset}")]
    drawn = lambda offset, **m: (
        lambda _: pb.cross_check(pb.load(robot_xml(led(offset), {}, []), annotations=BALLS), 3, levels=("points",))
    )
    yield one("widen the limits of joints that follow others", drawn(9), drawn(8))

    def proposed(*more: LinearLimit) -> Do:
        from pinbound.marking.candidates import draw

        def done(_: Path) -> object:
            robot = replace(planar(), linear_limits=(*planar().linear_limits, *more))
            return draw(robot, 10, np.random.default_rng(0))

        return done

    row = np.array([1.0, -1.0])
    low, high = LinearLimit("c", row, 0.0, 0.0, 1.0), LinearLimit("d", row, 0.0, 2.0, 3.0)
    yield one("widen the limits of mimic joints", proposed(low, high), proposed(low, replace(high, lower=0.5)))
    # motion
    ik = lambda target, **options: lambda _: pb.solve_ik(planar(), "b", target, **options)
    yield one("give (3,) or (N, 3) positions [m]", ik([0.1, 0.2]), ik([0.1, 0.0, 0.4]))
    yield one(
        "give one within the limits, or leave start out",
        ik([0.1, 0.0, 0.4], start=[9.0, 0.0]),
        ik([0.1, 0.0, 0.4], start=ZERO),
        ik([0.1, 0.0, 0.4]),
    )
    yield one(
        "give one within the limits, or leave start out",
        ik([0.1, 0.0, 0.4], start=[ZERO, ZERO]),
        ik([0.1, 0.0, 0.4], start=ZERO),
    )

    yield from regions()
    yield from others()


def regions() -> Iterator[Entry]:
    """Yield those of regions, and of what is made of them."""
    share = "give a number between 0 and 1 (radians, metres, or a share of the window)"
    yield one(share, region(accuracy=0.0), region(accuracy=0.01))
    yield one(share, region(width=1.0), region(width=0.01))
    metres = "give metres, 0 or more"
    yield one(metres, region(margin=-1.0), region(margin=0.01))
    of = lambda do: lambda _: do(curved())
    yield one(metres, of(lambda r: r.with_clearance(-1.0)), of(lambda r: r.with_clearance(0.001)))
    budget = "give seconds above 0, inf for no limit"
    yield one(budget, region(budget=0.0), region(budget=60.0), region(budget=np.inf))
    longer = "give a larger budget, a coarser accuracy or a smaller window"
    small = {"q1": (-0.2, 0.2), "q2": (-0.2, 0.2)}
    yield one(longer, region(budget=1e-9), region(budget=60.0), region(accuracy=0.1, window=small))
    at = lambda q: region(at=q)
    yield one("start within all limits", region(minerva, at=[3.0, 0.0, 0.0]), region(minerva, at=[1.0, 0.0, 0.0]))
    ends = region(window={"q1": (0.5, 1.0)})
    yield one("start within all limits and the window", ends, region(window={"q1": (-0.5, 1.0)}))

    def touched(_: Path) -> object:
        found = planar().boundaries.limits("q2", [1.0, 0.0])
        contact = found.upper + 0.05 if found.upper_stop == "far" else found.lower - 0.05
        return pb.feasible_region(planar(), at=[1.0, contact])

    yield one("start out of contact", touched, at([1.0, 0.0]))
    held = lambda q: lambda _: pb.feasible_region(spatial_3(), ("q2", "q3"), at=q)
    yield one("start out of contact", held(TOUCHED), held(FREE))
    yield one("start on home's side", region(minerva, at=np.radians([0, 0, 80])), region(minerva, at=ZERO3))
    yield one(
        "start elsewhere",
        lambda _: pb.feasible_region(ruled(WHERE), at=[0.3, 1.5]),
        lambda _: pb.feasible_region(ruled(WHERE), at=[0.3, 0.5]),
    )
    names = "give coordinates=(..., ...), two names out of: {}"
    two = region(coordinates=("q1", "q2"))
    yield one(names, region(coordinates="q1,q2"), two)
    pair = "give coordinates=(..., ...) out of: {}"
    yield one(pair, region(coordinates=("q1",)), two)
    yield one(pair, region(geared_3, coordinates=("q1", "copy")), region(geared_3, coordinates=("q1", "last")))
    window = "give window={{}: (lower, upper)} around the start (on the command line --window {}=LOWER..UPPER)"
    turn = {"q1": (-3.0, 3.0)}
    yield one(window, region(endless, coordinates=("q1", "q2")), region(endless, coordinates=("q1", "q2"), window=turn))
    numbers = "give two numbers (lower, upper), lower first"
    yield one(numbers, region(window={"q1": (1.0, -1.0)}), region(window={"q1": (-1.0, 1.0)}))
    room = region(window={"q1": (-5.0, -4.0)})
    yield one("give a wider window", room, region(window={"q1": (-5.0, 1.0)}))
    option = "(on the command line --window {}=LOWER..UPPER)"
    wide = "give a smaller window, window={{}: (lower, upper)} around the start " + option
    far_off = lambda **more: region(wild, coordinates=("q1", "q2"), **more)
    yield one(wide, far_off(), far_off(window=turn))
    lines = "give a smaller window around the start, e.g. window={{}: (lower, upper)} " + option
    straight = lambda **more: lambda _: pb.feasible_region(wild_stop(), ("q1", "q2"), **more).components
    yield one(lines, straight(), straight(window=turn))
    bounds = '<pinbound:rule name="r" coefficients="q1: 1" upper="0.1">{}</pinbound:rule>'
    thin = (
        '<pinbound:where coefficients="q2: 1" lower="{}"/><pinbound:where coefficients="q2: 1, q1: 1e-14" upper="1"/>'
    )
    flat = lambda lower: made(robot_xml(PLANAR, {}, [], bounds.format(thin.format(lower))), BALLS)
    beside_ = {"q2": (-0.5, 0.5)}
    yield one(
        "widen its conditions, or give a window beside it",
        lambda _: pb.feasible_region(flat("1")),
        lambda _: pb.feasible_region(flat("0.9")),
        lambda _: pb.feasible_region(flat("1"), window=beside_),
    )
    cells = "give a larger width= (on the command line --width), or a smaller window (window=, --window)"
    few = lambda **more: patched("pinbound.region.cells._MOST_CELLS", 3_000, region(boxed, **more))
    near = {"q1": (-0.02, 0.02), "q2": (-0.02, 0.02)}
    yield one(cells, few(), few(width=0.2), few(window=near))
    boxes = "change min_distance slightly, or give a smaller window (window=, on the command line --window)"
    traced = lambda **more: patched("pinbound.region.contours._MOST_BOXES", 60, region(**more))
    yield one(boxes, traced(), traced(window=near))
    undecided = "change min_distance slightly, or give a smaller window"
    away = {"q1": (1.0, 3.0), "q2": (-1.0, 1.0)}
    yield one(undecided, doubtful(0.75), doubtful(0.75 + 1e-9), doubtful(0.75, window=away))
    # what a region is asked
    ways = 'say which, with order="robot" or order="region"'
    swapped = cache(lambda: pb.feasible_region(planar(), ("q2", "q1")))
    yield one(
        ways,
        lambda _: swapped().contains(ZERO),
        lambda _: swapped().contains(ZERO, order="robot"),
        lambda _: swapped().contains(ZERO, order="region"),
    )
    slice_ = "compute it again with at=..., or give points of the slice, ({})"
    plane = lambda at, q: lambda _: pb.feasible_region(spatial_3(), ("q2", "q3"), at=at).contains(q)
    yield one(slice_, plane(FREE, FREE + 0.1), plane(FREE + 0.1, FREE + 0.1), plane(FREE, FREE[1:]))
    yield one("give numbers", of(lambda r: r.contains(["a", "b"])), of(lambda r: r.contains(ZERO)))
    both = "give weights={{}: ..., {}: ...}, how much one {} and one {} count, "
    both += "e.g. a lever arm in metres for the angle and 1 for the other"
    weighed = lambda **w: lambda _: mixed().signed_distance(mixed().centroid, **w)
    yield one(both, weighed(), weighed(weights={"lift": 1.0, "turn": 0.3}))
    yield one("give {} and {} one each", weighed(weights={"lift": 1.0}), weighed(weights={"lift": 1.0, "turn": 0.3}))
    yield one("give above 0, at most 1", of(lambda r: r.scale(2.0)), of(lambda r: r.scale(1.0)))
    yield one("give radians, 0 or more", of(lambda r: r.inset(-1.0)), of(lambda r: r.inset(0.01)))
    rim = lambda r, width: r.inscribed_polygon(rim=width)
    yield one("give radians above 0", of(lambda r: rim(r, 0.0)), of(lambda r: rim(r, 0.05)))
    yield one("give metres above 0", of(lambda r: r.clearance(0.0)), of(lambda r: r.clearance(1e-3)))
    yield one(
        LEAVES,
        of(lambda r: r.scale(0.9)),
        of(lambda r: r.inset(0.05)),
        of(lambda r: r.with_clearance(0.01)),
        of(lambda r: rim(r, 0.05).scale(0.9)),
    )
    convex = "use inscribed_polygon() for a convex part of it, or convex_parts() for all of it"
    yield one(
        convex,
        of(lambda r: r.halfspaces()),
        of(lambda r: rim(r, 0.05).halfspaces()),
        of(lambda r: [part.halfspaces() for part in r.convex_parts(rim=0.05)]),
    )
    sent = cache(lambda: pickle.loads(pickle.dumps(curved())))
    yield one(
        "compute the region again",
        lambda _: sent().components,
        lambda _: pb.feasible_region(sent().slice.robot).components,
    )
    from pinbound.region.membership import axis_membership, classify, projections

    yield one(
        "give lower <= upper",
        lambda _: axis_membership([0.0], 1.0, -1.0),
        lambda _: axis_membership([0.0], -1.0, 1.0),
    )
    empty = cache(lambda: hexagon().inset(2.0))
    asked = lambda r: None if r.is_empty else projections(r)
    yield one(
        "check `is_empty` first", lambda _: projections(empty()), lambda _: asked(empty()), lambda _: asked(hexagon())
    )
    yield one("give radians, 0 or more", lambda _: classify([0.1], -1.0), lambda _: classify([0.1], 1e-9))
    # workspaces
    image = lambda r, **more: pb.workspace_section(minerva(), r, "link_6", **more)
    yield one(
        "check `is_empty` first",
        lambda _: image(empty()),
        lambda _: None if empty().is_empty else image(empty()),
        lambda _: image(hexagon()),
    )
    other = "name another coordinate, or leave turn= out"
    yield one(
        other,
        lambda _: image(hexagon(), turn="q2"),
        lambda _: image(hexagon(), turn="q1"),
        lambda _: image(hexagon()),
    )
    usual = ("0.5 1.0", "0.5 1.0")
    yield one("leave turn= out", lambda _: section("turn", (usual, "0 1 1")), lambda _: section(None, (usual, "0 1 1")))
    other = "choose others"
    upright = lambda robot: pb.workspace_section(robot, pb.feasible_region(robot, ("turn", "b")), "hand")
    yield one(other, lambda _: section(link="upper"), lambda _: section())
    tilted = (usual, "0 0 1", "1 1 0")
    yield one(
        other,
        lambda _: section(None, tilted),
        lambda _: upright(arm(*tilted)[0]),
    )
    metres = "give metres above 0"
    yield one(metres, lambda _: section().polygon(0.0), lambda _: section().polygon(0.01))
    suffix = "valid: {}"
    yield one(
        "{} has no suffix of a polygon format; " + suffix,
        lambda f: section().export(f / "s.dxf"),
        *(lambda f, end=end: section().export(f / f"s{end}") for end in (".geojson", ".json", ".wkt")),
    )
    yield one(
        "make it with turn=...",
        lambda _: pb.swept_body(arm(usual)[0], section()),
        lambda _: pb.swept_body(arm(usual)[0], section("turn")),
    )
    yield one("give finite lower <= upper", lambda _: swept(lower=1.0, upper=0.0), lambda _: swept())
    yield one("give lower < upper", lambda _: swept(upper=-0.5).mesh(0.01), lambda _: swept().mesh(0.01))
    yield one(metres, lambda _: swept().mesh(0.0), lambda _: swept().mesh(0.01))
    across = (("-0.6 0.6", "-0.2 0.2"),)
    one_side = "take a region whose section stays on one side of it"
    yield one(one_side, lambda _: swept(across).mesh(0.01), lambda _: swept().mesh(0.01))
    aside = lambda limits: lambda _: beside(limits).volume
    yield one(one_side, aside(("-0.6 0.6", "-0.2 0.2")), aside(usual))
    yield one(
        "{} has no suffix of a mesh format; " + suffix,
        lambda f: swept().export(f / "s.step", 0.01),
        *(lambda f, end=end: swept().export(f / f"s{end}", 0.01) for end in (".ply", ".stl", ".obj")),
    )


def beside(limits: Any) -> Any:
    """Return the body swept by an arm that moves in a plane beside the axis."""
    key = ("beside", limits)
    if key not in MADE:
        text = two_link(limits).replace(
            '<joint name="a" type="revolute"><parent link="turret"/><child link="upper"/><origin xyz="0 0 0"',
            '<joint name="a" type="revolute"><parent link="turret"/><child link="upper"/><origin xyz="0 0.1 0"',
        )
        MADE[key] = pb.load(text)
    robot = MADE[key]
    made = pb.workspace_section(robot, pb.feasible_region(robot, ("a", "b")), "tool", turn="turn")
    return pb.swept_body(robot, made, -0.5, 0.5)


ZERO3 = np.zeros(3)
FREE, TOUCHED = np.array([0.0, 0.0, 0.0]), np.array([0.3, 0.0, 0.0])
THREE = [*PLANAR, joint("q3", "revolute", "b", "c", xyz="0 0 0.2")]


def spatial_3() -> pb.Robot:
    """Return an arm with one boundary that its first joint alone moves, and one that all move."""
    marks = {"p": ("base", "0.3 0 1.2"), "s": ("c", "0.1 0 0.3"), "u": ("base", "0.1 0 0.4"), "v": ("a", "0 0 0.3")}
    key = "spatial_3"
    if key not in MADE:
        text = robot_xml(THREE, marks, [("p", "s"), ("u", "v")]).replace(
            'name="u_v" a="u" b="v"', 'name="u_v" a="u" b="v" min_distance="0.05"'
        )
        MADE[key] = pb.load(text)
    return MADE[key]


def geared_3() -> pb.Robot:
    return made(robot_xml(GEARED, {"p": ("base", "0.6 0 0.1"), "s": ("c", "0.1 0 0")}, [("p", "s")]))


def wild() -> pb.Robot:
    return made(robot_xml(WILD, {}, []), BALLS)


def wild_stop() -> pb.Robot:
    """Return two joints of hardly any limits between two stops each."""
    marks = {"p": ("base", "0.3 0 0"), "s": ("a", "0 0 0.3")}
    return made(robot_xml(WILD, marks, [("p", "s")]))


def doubtful(radius: float, **options: Any) -> Do:
    """Return the region of an arm whose clearance touches zero in a point where the radius is 0.75."""
    joints = [
        joint("q1", "revolute", "base", "a", axis="0 0 1"),
        joint("q2", "revolute", "a", "b", axis="0 0 1", xyz="1 0 0"),
    ]
    marks = [pb.Point("t", "b", (0.5, 0, 0)), pb.Point("o", "base", (0.75, 0, 0), radius)]
    more = pb.Annotations.of(marks, [pb.BoundaryMark("beta", "t", "o")], home={"q1": 2.4, "q2": 0.2})
    asked: Do = lambda _: pb.feasible_region(pb.load(robot_xml(joints, {}, []), annotations=more), **options)
    return patched("pinbound.region.arrangement._MOST_UNDECIDED", 0, asked)


def others() -> Iterator[Entry]:
    """Yield those of loops, free space, tables, models, scripts and the machine."""
    linkage = lambda: made(UNEQUAL)

    def supported(_: Path) -> object:
        robot, Q = linkage(), linkage().home[None]
        box = robot.home - 1e-4, robot.home + 1e-4
        answers: list[object] = [robot.boundaries.norms(Q), robot.boundaries.gradients(Q), robot.boundaries.hessians(Q)]
        answers += [robot.boundaries.signed_clearances(Q), robot.boundaries.free(Q), robot.coupling.expand(Q)]
        answers += [pb.certify(robot, Q), pb.certify_box(robot, *box), robot.to_pinocchio(robot.model, Q)]
        answers += [pb.certified_box(robot, robot.home, budget=pb.Budget(200)), pb.cross_check(robot, samples=10)]
        answers += [robot.boundaries.limits(robot.coordinates[0], robot.home)]
        return answers

    through = "Supported through it are: values, gradients, Hessians, signed clearances, free, certify, certify_box, "
    through += "certified_box, feasible_region, limits, cross_check of points and bodies, coupling.expand, to_pinocchio"
    yield one(through, lambda _: linkage().coupling.S, supported)
    turned = linkage().coordinates[0]
    (value,) = linkage().home[[0]].tolist()
    small, tiny = ((value - half, value + half) for half in (1e-3, 1e-6))
    how_far = lambda **more: lambda _: linkage().boundaries.limits(turned, linkage().home, **more)
    short = lambda **more: patched("pinbound.boundaries.looped_limits._FARTHEST", 1e-3, how_far(**more))
    yield one("give window=(lower, upper), or the joint limits", short(), short(window=tiny))
    watch = lambda _: live_view(planar())
    gone = without("viser", where="pinbound.explorer.live.import_module", then=watch)
    fake = SimpleNamespace(ViserServer=Server)
    there = patched(
        "pinbound.explorer.live.import_module",
        lambda name: fake if name == "viser" else pytest.importorskip(name),
        watch,
    )
    yield one("this needs viser, which is not installed: pip install 'pinbound[view]'", gone, there)
    explored = lambda robot: lambda _: pb.explorer_page(robot())
    still = lambda: made(robot_xml([joint("f", "fixed", "base", "a")], {}, []))
    yield one("give a robot with a joint that moves", explored(still), explored(bare))
    arcs = lambda window: lambda _: linkage().boundaries[0].limits(turned, linkage().home, window=window)
    few_open = lambda window: patched("pinbound.loops.through_loops._MOST_OPEN", 0, arcs(window))
    yield one("change the threshold, or give a smaller window (window=)", few_open((-4.0, 4.0)), few_open(small))
    slopes = lambda *shape: lambda _: linkage().boundaries.gradients(linkage().home[None], out=np.zeros(shape))
    yield one("give a writeable {} array of shape {}", slopes(2, 1, 1), slopes(1, 1, 1))
    polytope = lambda robot, **more: lambda _: pb.certified_polytope(robot(), robot().home, **more)
    stopped = lambda: made(robot_xml(TURNS, {"p": ("base", "0.3 0 0"), "s": ("a", "0 0 0.3")}, [("p", "s")]))
    ends = {"q1": (-0.5, 0.5)}
    yield one(
        "give window={{}: (lower, upper)}",
        polytope(endless, boundaries=[]),
        polytope(endless, boundaries=[], window=ends),
    )
    many = lambda starts, ends: lambda _: pb.certify_many(planar(), starts, ends)
    yield one("give one row for each motion, (N, {})", many(ZERO, ZERO), many([ZERO], [ZERO]))
    yield one("give finite numbers", many([[0.0, np.nan]], [ZERO]), many([ZERO], [ZERO]))
    yield one("give one of each for a motion", many([ZERO, ZERO], [ZERO]), many([ZERO], [ZERO]))
    paved = lambda *names, **more: lambda _: pb.free_volume(planar(), names, **({"decided": 0.5} | more))
    yield one("give two to four coordinates, each once", paved("q1", "q1"), paved("q1", "q2"))
    yield one("give above 0, at most 1", paved("q1", "q2", decided=0.0), paved("q1", "q2"))
    cast_on = lambda *names: lambda _: pb.free_projection(minerva(), names, decided=0.5)
    yield one("give two of {}", cast_on("q1", "q2", "q3"), cast_on("q1", "q2"))

    def drawn(*names: str) -> Do:
        from pinbound.figures.free_figure import draw_free

        robot = zoo("spatial_4r")
        return lambda _: draw_free(robot, pb.free_volume(robot, names, decided=0.01))

    yield one("hold some", drawn(*zoo("spatial_4r").coordinates), drawn("j1", "j2"))
    paired = lambda robot: lambda _: pb.pair_atlas(robot())
    yield one("give it marks and boundaries", paired(bare), paired(minerva))
    rigid = lambda: made('<robot name="r"><link name="a"/></robot>')
    yield one(
        "call certify()",
        lambda _: pb.certified_polytope(rigid(), [], limits_only=True),
        lambda _: pb.certify(rigid(), [[]], limits_only=True),
    )
    covered = lambda **more: lambda _: pb.certified_cover(bare(), **more)
    yield one(
        "give the robot boundaries, or limits_only=True to use joint limits alone", covered(), covered(limits_only=True)
    )

    def planned(robot: pb.Robot) -> Do:
        cover = lambda: pb.certified_cover(robot, limits_only=True)
        return lambda _: pb.plan(bare(), ZERO, ZERO, cover=cover(), limits_only=True)

    yield one("make one of this robot and these boundaries with certified_cover()", planned(minerva()), planned(bare()))
    asked = lambda what: patched("pinbound.freespace.vertices._EXACT", 1, lambda _: what(polytope(minerva)(_)))
    known = "use .A and .b, or sampled_volume()"
    yield one(known, asked(lambda p: p.vertices), asked(lambda p: (p.A, p.b)), asked(lambda p: p.sampled_volume()))
    # the paper
    from pinbound.reproduce.study import Study

    source = pb.packaged_robots()["minervabot_v3"]
    printed = source.read_text(encoding="utf-8")
    right = 'xyz="-0.01344 0 0.03061"', 'a="o14" b="o15" stop="true"'

    def paper(*changed: str) -> Do:
        """Return the study of a MinervaBotV3 whose point o14 and boundary beta_4 are written otherwise."""

        def done(folder: Path) -> object:
            text = printed
            for old, new in zip(right, changed, strict=True):
                assert old in text, old
                text = text.replace(old, new)
            beside = source.with_name("parallelogram.xacro").read_text(encoding="utf-8")
            (folder / "parallelogram.xacro").write_text(beside, encoding="utf-8")
            (folder / "mine.urdf.xacro").write_text(text, encoding="utf-8")
            return Study(pb.load(folder / "mine.urdf.xacro"))

        return done

    outer, bare_pair = 'xyz="-0.016 0 0.03061"', 'a="o14" b="o15"'
    declare = 'the paper\'s has one: if it is a stop, declare it: stop="true"'
    yield one(declare, paper(outer, bare_pair), paper(outer, right[1]))
    mend = "the paper's has one: mend the two points"
    yield one(mend, paper(right[0], 'a="o25" b="o10"'), paper(*right))
    yield one("reproduce needs minervabot_v3, or a copy of it", lambda _: Study(planar()), lambda _: Study(minerva()))
    # tables of limits
    coarse = "give a smaller spacing, or leave whole out"
    stopped = [
        joint("a", "revolute", "base", "l1", limit="-0.1 0.1"),
        joint("b", "revolute", "l1", "l2", limit="0.001 0.002"),
    ]
    narrow = robot_xml(stopped, {}, [], '<pinbound:home b="0.0015"/>')
    thin = lambda **more: lambda _: pb.limit_table(made(narrow), "a", "b", **more)
    yield one(coarse, thin(whole=True), thin())
    yield one("name two joints", table(dependent="q2"), table())
    yield one("give degrees above 0, at most 90", table(spacing=0.0), table(spacing=2.0))
    yield one("give a larger spacing, or narrower limits", table(spacing=1e-9), table(spacing=2.0))
    slides = lambda _: pb.limit_table(crane(), "turn", "lift")
    yield one(
        "Use `boundaries.limits_table`", slides, lambda _: crane().boundaries.limits_table("lift", [crane().home])
    )
    bent = "Trace a region, or leave this boundary out"
    tabled = lambda **more: lambda _: pb.limit_table(planar(), "q1", "q2", **more)
    yield one(bent, tabled(), region(), tabled(boundaries=[]))
    joints = "Leave it out, or name other joints"

    def alone(_: Path) -> object:
        chosen = [one_.name for one_ in minerva().boundaries if "q2" not in one_.coordinates]
        return pb.limit_table(minerva(), "q1", "q3", boundaries=chosen)

    yield one(joints, table(target="q1"), alone, table())
    limited = "give it limits"
    free = lambda text: lambda _: pb.limit_table(made(text), "q2", "q1", boundaries=[])
    yield one(limited, free(robot_xml(TURNS, {}, [])), free(robot_xml(PLANAR, {}, [])))
    target = lambda text: lambda _: pb.limit_table(made(text), "q1", "q2", boundaries=[])
    yield one(limited, target(robot_xml(TURNS, {}, [])), target(robot_xml(PLANAR, {}, [])))
    written = lambda form, **more: lambda _: pb.limit_table(minerva(), "q2", "q3", **more).text(form)
    multiples = "make the table with grid='multiples' and spacing=1 (--grid multiples --spacing 1)"
    yield one(multiples, written("hrpsys"), written("hrpsys", grid="multiples", spacing=1))
    words = "export minervabot_v3 table --format hrpsys --target q2 --dependent q3 --out HERE/t --spacing 0.5"
    yield one(multiples, command(words), command(words.replace("0.5", "1") + " --grid multiples"))
    fitted = "make the table with grid='fitted' (--grid fitted)"
    yield one(fitted, written("skrobot", grid="corners"), written("skrobot", grid="fitted"))
    words = "export minervabot_v3 table --format skrobot --target q2 --dependent q3 --out HERE/t --grid "
    yield one(fitted, command(words + "corners"), command(words + "fitted"))
    whole = "make the table with whole=True (--whole)"
    yield one(whole, written("jskeus"), written("jskeus", whole=True))
    words = "export minervabot_v3 table --format jskeus --target q2 --dependent q3 --out HERE/t"
    yield one(whole, command(words), command(words + " --whole"))
    # models
    view = lambda robot, text, **more: lambda _: robot().on(model_of(text, **more))
    text = robot_xml(GEARED, {}, [])
    renamed = view(geared, text.replace('name="last"', 'name="lost"'))
    yield one("the model's joint {} does not move in {}. {}", renamed, view(geared, text))
    to = lambda text: lambda _: geared().to_pinocchio(model_of(text), geared().home)
    yield one("the model's joint {} is none of {}. {}", to(text.replace('name="last"', 'name="lost"')), to(text))
    free = lambda _: made(text.replace('<mimic joint="q1" multiplier="2" offset="0.1"/>', ""))
    unled = text.replace('<mimic joint="q1" multiplier="2" offset="0.1"/>', "")
    stray = lambda with_mimic: lambda _: made(unled).on(model_of(text if with_mimic else unled, mimic=with_mimic))
    yield one("build the model again", stray(True), stray(False))
    link = "build it from the same URDF. {}"
    yield one(link, view(geared, text.replace('"c"', '"d"')), view(geared, text))
    same = "build the model from the same URDF"
    yield one(same, view(geared, text.replace("0 0 0.2", "0 0 0.25")), view(geared, text))
    q1 = 0.3
    yield one(
        "lock both, or none",
        locked(("copy",), {}),
        locked(("q1", "copy"), {"q1": q1, "copy": 2 * q1 + 0.1}),
        locked((), {}),
    )
    yield one(
        "lock mimic joints where the robot's `to_pinocchio` puts them",
        locked(("q1", "copy"), {"q1": q1, "copy": 0.0}),
        locked(("q1", "copy"), {}),
    )
    yield one("give cos and sin of one angle there", endless_model([1.0, 1.0, 0.0]), endless_model([0.0, 1.0, 0.0]))
    nq = "give ({},) or (N, {})"
    yield one(nq, endless_model([1.0, 0.0]), endless_model([1.0, 0.0, 0.0]), endless_model([[1.0, 0.0, 0.0]]))

    def moved(q: Any, mimic: bool = False) -> Do:
        return lambda _: geared_3().on(model_of(text, mimic=mimic)).clearances(np.asarray(q, dtype=float))

    along = "move it along, or build the model with mimic=True"
    yield one(along, moved([0.1, 0.0, 0.0]), moved([0.1, 0.3, 0.0]), moved([0.1, 0.0], mimic=True))
    unframed = pin.Model()
    unframed.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "q1")
    yield one(
        "load() its URDF instead", lambda _: pb.from_pinocchio(unframed), lambda _: pb.load(text), lambda _: made(text)
    )
    # marks that move
    ball, pair = pb.Point("ball", "base", (0.5, 0.5, 0.5), 0.01), pb.BoundaryMark("m", "ball", "free_mark")
    seen = pb.Annotations.of([pb.Point("free_mark", "b", (0.1, 0.0, 0.0))], [])
    seeing = lambda: made(robot_xml(PLANAR, {}, [])).with_annotations(seen)
    moves = lambda marks, pairs=(): lambda _: pb.MovingMarks(seeing(), marks, pairs)
    yield one("put it on the root link, {}", moves([replace(ball, link="b")]), moves([ball]))
    yield one("give it another name", moves([replace(ball, name="free_mark")]), moves([ball]))
    yield one(
        "name one of each, or use with_annotations", moves([ball], [replace(pair, stop=True)]), moves([ball], [pair])
    )
    at = lambda pose: lambda _: pb.MovingMarks(seeing(), [ball], [pair]).at({"ball": pose})
    yield one("give finite numbers (4, 4): a rotation, and metres", at(np.eye(3)), at(np.eye(4)))
    yield one("give an orthonormal right-handed matrix", at(np.diag([1.0, 1, 2, 1])), at(np.eye(4)))
    # half-spaces
    row, place_of = ([[1.0, 0.0]], [1.0]), SimpleNamespace(state=SimpleNamespace(q=np.zeros(8)), get_joint_offset=len)
    written = lambda given, names=("q1", "q2"): lambda _: drake_text({"home": given}, names)
    yield one("give (k, n) and (k,)", written(([[1.0, 0.0]], [1.0, 2.0])), written(row))
    yield one(
        "leave such rows out", written(([[1.0], [1.0]], [1.0, np.inf]), ("q1",)), written(([[1.0]], [1.0]), ("q1",))
    )
    proven = lambda verdict: SimpleNamespace(A=row[0], b=row[1], verdict=verdict)
    undecided, certified = written(proven(pb.Verdict.UNDECIDED)), written(proven(pb.Verdict.CERTIFIED))
    yield one("give certified_polytope a larger budget, or another q", undecided, certified)
    regions = lambda given: lambda _: drake_text(given, ("q1", "q2"))
    yield one("give a name and a region at least", regions({}), regions({"home": row}))
    yield one("give printable characters", regions({"a\nb": row}), regions({"a b": row}))
    yield one("name each column once, in order", written(row, ("q1",)), written(row, ("q1", "q2")))
    turning = lambda kind: made(robot_xml([joint("q1", kind, "base", "l1", xyz="0 0 1", limit="-1 1")], {}, []))
    rows_of = lambda kind: lambda _: placo_rows(turning(kind), place_of, [[1.0]], [1.0])
    yield one("Make the joint revolute, with limits", rows_of("continuous"), rows_of("revolute"))
    # robots
    kept = "Remove the condition: the rule then applies everywhere"
    stepped = lambda where: lambda _: pb.StepBounds(ruled(where))
    yield one(kept, stepped(WHERE), stepped(""))
    orphan = lambda: replace(planar(), again=None)
    more = pb.Annotations(home={"q1": 0.1})
    anew = lambda robot: lambda _: robot().with_annotations(more)
    yield one("load() its file", anew(orphan), anew(lambda: pb.load(robot_xml(PLANAR, {}, []))))
    place = "give another --out, or move it away"

    def there(folder: Path) -> None:
        (folder / "my_palletizer.urdf.xacro").write_text("mine")

    def started(line: str, away: bool = False) -> Do:
        def done(folder: Path) -> object:
            there(folder)
            if away:
                (folder / "my_palletizer.urdf.xacro").rename(folder / "away")
            (folder / "new").mkdir(exist_ok=True)
            return command(line)(folder)

        return done

    new = "new palletizer --out HERE"
    yield one(place, started(new), started(new + "/new"), started(new, away=True))


ENTRIES = list(entries())


# what the source says


def remedy_of(template: str) -> str:
    """Return the last part of a message that says something: what to do."""
    parts = re.split(r"(; |(?<!\be\.g)(?<!\d)\. |: (?=give |lock ))", template)
    last = ""
    for part in reversed(parts):
        last = part + last
        if len(re.sub(r"{}|\W", "", last)) > 6:
            break
    return last.removeprefix("; ").removeprefix(". ").removeprefix(": ")


@cache
def sources() -> list[tuple[Path, ast.Module]]:
    texts = [(path, path.read_text(encoding="utf-8")) for path in sorted(SOURCE.rglob("*.py"))]
    names = (*CLASSES, "UnknownNameError", *OPTIONS)
    return [(path, ast.parse(text)) for path, text in texts if any(name in text for name in names)]


def called(node: ast.Call) -> str:
    return node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")


def templates(node: ast.expr, known: dict[str, list[ast.expr]], depth: int = 3) -> Iterator[str]:
    """Yield the texts that a message may be; names of the function are followed where they are all or the end of it."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        texts = [""]
        for place, part in enumerate(node.values):
            if isinstance(part, ast.Constant):
                ends = [str(part.value)]
            else:
                assert isinstance(part, ast.FormattedValue)
                is_last = place == len(node.values) - 1
                ends = list(templates(part.value, known, depth - 1)) if is_last and depth else []
                ends = ends or ["{}"]
            texts = [text + end for text in texts for end in ends]
        yield from texts
    elif isinstance(node, ast.IfExp):
        yield from templates(node.body, known, depth)
        yield from templates(node.orelse, known, depth)
    elif isinstance(node, ast.Name) and depth:
        for value in known.get(node.id, []):
            yield from templates(value, known, depth - 1)


def messages() -> Iterator[tuple[str, str]]:
    """Yield each message of the source with its place."""
    for path, tree in sources():
        tops = [one for one in ast.walk(tree) if isinstance(one, ast.ClassDef | ast.Module)]
        for function in (one for top in tops for one in top.body if isinstance(one, ast.FunctionDef)):
            known: dict[str, list[ast.expr]] = {}
            nodes = list(ast.walk(function))
            for node in nodes:
                if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                    known.setdefault(node.targets[0].id, []).append(node.value)
            for node in nodes:
                if isinstance(node, ast.Call) and called(node) in CLASSES and node.args:
                    for template in templates(node.args[0], known):
                        yield template, f"{path.relative_to(SOURCE)}, line {node.lineno}"


def kinds() -> set[str]:
    found: set[str] = set()
    for _, tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and called(node) == "UnknownNameError" and node.args:
                found |= {one.value for one in node.args[:1] if isinstance(one, ast.Constant)}
    return found


OF_CLUSTERS = "a scheduler that dies and comes back: tests/test_batch_cluster.py"
NOT_FOLLOWED: dict[str, str] = {
    "start one, then run again": OF_CLUSTERS,
    "start it, then run again": OF_CLUSTERS,
    "give all lengths in metres": "`load` refuses longer lengths before",
    "report this as a bug of pinbound": "no file is known that Pinocchio orders otherwise",
    "give a smaller accuracy, or start elsewhere": "no start is known that the finer accuracies leave in doubt",
    "take a smaller region": "no map is known whose folds cannot be traced but which folds",
    "give the mesh in metres": "no mesh is known that `read_mesh` takes and whose numbers are too large to prove",
    "give a smaller window (window=, --window)": "it takes a loop that another loop moves, and that can go round",
    "give a smaller chord": "no section of one region is known that falls apart",
}
"""Remedies that no entry follows, and why."""


@pytest.mark.parametrize("entry", ENTRIES, ids=[f"{i}: {entry.remedy[:40]}" for i, entry in enumerate(ENTRIES)])
def test_a_remedy_that_is_followed_helps(entry: Entry, tmp_path: Path) -> None:
    with pytest.raises(pb.PinboundError) as caught:
        entry.fault(tmp_path)
    found = ".*".join(re.escape(part) for part in entry.remedy.split("{}"))
    assert re.search(found, str(caught.value), re.DOTALL), str(caught.value)
    for mended in entry.mended:
        mended(tmp_path)


def test_a_terminal_names_the_option_of_a_window(tmp_path: Path) -> None:
    """In a terminal the message names `--window`; typing it helps."""
    (tmp_path / "endless.urdf").write_text(robot_xml(TURNS, {}, []))
    line = "region HERE/endless.urdf --coordinates q1,q2"
    with pytest.raises(pb.PinboundError, match=r"add --window .* \(on the command line --window q1=LOWER\.\.UPPER\)"):
        command(line)(tmp_path)
    command(line + " --window q1=-3..3")(tmp_path)


@pytest.mark.parametrize("unknown", UNKNOWN, ids=[f"{i}: {one.kind}" for i, one in enumerate(UNKNOWN)])
def test_the_name_that_a_message_gives_is_right(unknown: Unknown, tmp_path: Path) -> None:
    with pytest.raises(pb.PinboundError) as caught:
        unknown.ask(unknown.wrong, tmp_path)
    message = str(caught.value)
    assert f"there is no {unknown.kind} {unknown.wrong!r}" in message
    meant = re.search(r"Did you mean '(.*?)'\?", message) or re.search(r"Valid: ([^,\s]+)", message)
    assert meant is not None, message
    unknown.ask(meant.group(1), tmp_path)


def test_every_message_has_a_remedy_that_is_followed() -> None:
    """A message with a new remedy fails here until an entry follows it."""
    followed = {entry.remedy for entry in ENTRIES}
    in_source: dict[str, str] = {}
    for template, place in messages():
        in_source.setdefault(remedy_of(template), place)
    assert len(in_source) > 100
    in_source[LEAVES] = "exceptions.py"
    forgotten = {remedy: place for remedy, place in in_source.items() if remedy not in followed | set(NOT_FOLLOWED)}
    assert not forgotten
    assert not (followed | set(NOT_FOLLOWED)) - set(in_source), "no message says these any more"
    assert not followed & set(NOT_FOLLOWED)
    assert kinds() == {unknown.kind for unknown in UNKNOWN}
