"""The contact rule: stops that are meant, signed clearances, and five questions that never contradict each other."""

import importlib.util
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy import optimize

import pinbound as pb
from pinbound.reproduce.study import Study
from robots import joint, robot_xml

Load = Callable[..., pb.Robot]
ROOT = Path(__file__).parents[1]
HINGE = [joint("q", "revolute", "base", "arm", limit="-8 8")]
ELBOW = [joint("a", "revolute", "base", "upper"), joint("b", "revolute", "upper", "fore", xyz="0 0 0.3")]


def hinge(load: Load, length: float = 0.2, extra: str = 'stop="true"', tolerance: str = "2e-5") -> pb.Robot:
    """Return two arms at one pivot, of 0.2 m and of `length`: they align at q = pi."""
    marks = (
        '<pinbound:point name="p" link="base" xyz="0 0.03 -0.2"/>'
        f'<pinbound:point name="s" link="arm" xyz="0 0.03 {length!r}"/>'
        f'<pinbound:boundary name="beta" a="p" b="s" {extra}/>'
    )
    text = robot_xml(HINGE, {}, [], marks)
    return load(text.replace("<pinbound:annotations>", f'<pinbound:annotations contact_tolerance="{tolerance}">'))


@pytest.mark.parametrize("length", [0.2, 0.2 + 1e-5, 0.2011, 0.185])
def test_a_declared_stop_touches_where_its_arms_align_whatever_their_lengths(load_text: Load, length: float) -> None:
    robot = hinge(load_text, length)
    beta = robot.boundaries["beta"]
    assert beta.is_stop
    assert beta.contact.is_stop
    assert (beta.contact.half_width, abs(beta.contact.angle)) == (0.0, pytest.approx(math.pi, abs=1e-15))
    assert beta.contact.smallest == pytest.approx(abs(length - 0.2), abs=1e-15)
    Q = np.linspace(-7.9, 7.9, 401)[:, None]
    side = np.where(np.abs(Q[:, 0]) < math.pi, 1.0, -1.0)
    miss = optimize.minimize_scalar(lambda x: float(beta.norm([x])), bounds=(3.0, 3.3), method="bounded").fun
    expected = side * np.sqrt(np.maximum(beta.norm(Q) ** 2 - miss**2, 0.0))
    assert np.abs(beta.signed_clearance(Q) - expected).max() < 1e-7
    assert np.array_equal(robot.boundaries.free(Q), side > 0.0)
    limits = robot.boundaries.limits("q", [0.5])
    assert (limits.lower, limits.upper) == (pytest.approx(-math.pi), pytest.approx(math.pi))
    assert limits.upper_stop == "beta"
    assert robot.boundaries.limits("q", [4.0]).blocked_by == ("beta",)
    assert pb.certify(robot, [[0.0], [4.0]]).verdict is pb.Verdict.VIOLATED
    assert pb.certify(robot, [[-math.pi + 1e-9], [math.pi - 1e-9]]).verdict is pb.Verdict.CERTIFIED
    assert pb.certify_box(robot, [-3.1], [3.2]).verdict is pb.Verdict.VIOLATED


def test_the_signed_clearance_of_a_stop_is_smooth_through_contact(load_text: Load) -> None:
    beta = hinge(load_text, 0.2011).boundaries["beta"]
    Q, h = np.linspace(-6.2, 6.2, 99)[:, None], 1e-6  # less than a turn beyond the gap
    slope = (beta.signed_clearance(Q + h) - beta.signed_clearance(Q - h)) / (2 * h)
    assert np.abs(beta.signed_gradient(Q)[:, 0] - slope).max() < 1e-9
    at_contact = beta.signed_gradient([math.pi])
    assert at_contact[0] == pytest.approx(-math.sqrt(0.2 * 0.2011), rel=1e-12)
    assert np.all(beta.signed_clearance(np.array([[12.6], [15.8], [-9.5], [30.0]])) <= 0.0)
    assert math.isnan(beta.signed_clearance([math.nan]))


def test_by_how_much_a_stop_misses_is_said(load_text: Load) -> None:
    near = hinge(load_text, 0.20111, "")
    assert near.notes == ('p and s (beta) miss each other by 1.11 mm; if this is a stop, declare it: stop="true"',)
    assert not near.boundaries["beta"].is_stop
    assert near.boundaries.free([3.2])
    declared = hinge(load_text, 0.20111)
    assert len(declared.notes) == 1
    assert "miss each other by 1.11 mm" in declared.notes[0]
    assert hinge(load_text, 0.2 + 1.9e-5, "").boundaries["beta"].is_stop
    for silent in (hinge(load_text, 0.2 + 1.9e-5), hinge(load_text, 0.2, ""), hinge(load_text, 0.206, "")):
        assert silent.notes == ()


POINT = '<pinbound:point name="{}" link="{}" xyz="{}" radius="{}"/>'
FAULTS = {
    "a radius": (HINGE, POINT.format("p", "base", "0 0 -0.2", 0.01), "0 0 0.2", "", "p has a radius"),
    "a distance": (
        HINGE,
        POINT.format("p", "base", "0 0 -0.2", 0),
        "0 0 0.2",
        'min_distance="0.01"',
        "min_distance is",
    ),
    "a segment": (
        HINGE,
        '<pinbound:segment name="p" link="base" xyz_a="0 0 -0.2" xyz_b="0 0.1 -0.2"/>',
        "0 0 0.2",
        "",
        "p is no point",
    ),
    "several angles": (ELBOW, POINT.format("p", "base", "0 0 -0.2", 0), "0 0 0.2", "", "several effective angles"),
    "a slide": (
        [joint("x", "prismatic", "base", "arm", axis="1 0 0", limit="0 1")],
        POINT.format("p", "base", "0 0 -0.2", 0),
        "0 0 0.2",
        "",
        "prismatic",
    ),
    "another point": (HINGE, POINT.format("p", "base", "0 0 -0.2", 0), "0 0 0.23", "", "30 mm where they align"),
    "no arm": (HINGE, POINT.format("p", "base", "0 0.1 0", 0), "0 0 0.2", "", "no joint moves"),
}


@pytest.mark.parametrize("fault", sorted(FAULTS))
def test_what_can_be_no_stop_is_refused_with_its_reason(load_text: Load, fault: str) -> None:
    joints, first, xyz, extra, words = FAULTS[fault]
    last = "fore" if joints is ELBOW else "arm"
    boundary = f'<pinbound:boundary name="beta" a="p" b="s" stop="true" {extra}/>'
    text = robot_xml(joints, {"s": (last, xyz)}, [], first + boundary)
    with pytest.raises(pb.InputError, match=f"'beta' is declared as a stop, but .*{words}"):
        load_text(text)


def test_a_stop_is_true_or_false(load_text: Load) -> None:
    for said in ("yes", "True", "1", ""):
        with pytest.raises(pb.InputError, match="Write true or false"):
            hinge(load_text, 0.2, f'stop="{said}"')
    assert not hinge(load_text, 0.201, 'stop="false"').boundaries["beta"].is_stop


@pytest.mark.parametrize("write", ["to_yaml", "to_xml"])
def test_a_stop_comes_back_from_both_spellings(write: str, tmp_path: Path) -> None:
    marks = [pb.Point("p", "base", (0.0, 0.0, -0.2)), pb.Point("s", "arm", (0.0, 0.0, 0.201))]
    notes = pb.Annotations.of(marks, [pb.BoundaryMark("a", "p", "s", stop=True), pb.BoundaryMark("b", "p", "s")])
    path = tmp_path / "robot.urdf"
    text, urdf = getattr(notes, write)(), robot_xml(HINGE, {}, [])
    assert text.count("stop") == 1
    path.write_text(urdf.replace("</robot>", text + "</robot>") if write == "to_xml" else urdf)
    if write == "to_yaml":
        assert "stop: true" in text
        (tmp_path / "robot.pinbound.yaml").write_text(text)
    robot = pb.load(path)
    assert [boundary.stop for boundary in robot.boundaries] == [True, False]
    assert [boundary.is_stop for boundary in robot.boundaries] == [True, False]


def test_points_of_several_angles_follow_one_rule(load_text: Load) -> None:
    """Limits, certificates, regions and `free` keep two bare points `contact_tolerance` apart, all of them."""
    marks = (
        '<pinbound:point name="p" link="base" xyz="0.25 0 0.2"/><pinbound:point name="s" link="fore" xyz="0 0 0.2"/>'
    )
    marks += '<pinbound:boundary name="beta" a="p" b="s"/>'
    text = robot_xml(ELBOW, {}, [], marks)
    robot = load_text(text.replace("<pinbound:annotations>", '<pinbound:annotations contact_tolerance="1e-3">'))
    beta = robot.boundaries["beta"]
    touching = optimize.fsolve(lambda q: beta.vector(q)[[0, 2]], [0.3, 1.3], xtol=1e-14)
    assert beta.norm(touching) < 1e-12
    gradient = beta.gradient(touching + np.array([1e-3, 0.0]))
    for distance, clear in ((0.9e-3, False), (1.1e-3, True)):
        step = optimize.brentq(lambda s, d=distance: float(beta.norm(touching + s * gradient)) - d, 0.0, 0.1)
        q = touching + step * gradient
        assert beta.signed_clearance(q) == pytest.approx(distance - 1e-3, abs=1e-12)
        assert robot.boundaries.free(q) is clear
        assert (pb.certify(robot, [q]).verdict is pb.Verdict.CERTIFIED) is clear
        assert (robot.boundaries.limits("a", q).blocked_by == ()) is clear
        assert beta.limits("b", q).contains(q[1]) is clear
        assert bool(np.isnan(robot.boundaries.limits_table("b", [q])[0][0, 0])) is not clear
    with pytest.raises(pb.DimensionError, match="not free"):
        pb.feasible_region(robot, at=touching + 0.5e-3 * gradient)


def test_one_angle_with_a_threshold_below_the_tolerance_is_a_strip_of_the_tolerance(load_text: Load) -> None:
    robot = hinge(load_text, 0.2, 'min_distance="1e-6"', "1e-3")
    beta = robot.boundaries["beta"]
    assert beta.contact_distance == 1e-3
    edge = math.pi - beta.contact.half_width
    assert beta.norm([edge]) == pytest.approx(1e-3, abs=1e-15)
    assert [robot.boundaries.free([edge + x]) for x in (-1e-9, 1e-9)] == [True, False]


FLOOR = '<pinbound:plane name="f" link="base" xyz="0 0 {}" normal="0 0 1"/><pinbound:boundary name="h" a="f" b="s"/>'


def test_a_height_has_no_tolerance_and_a_distance_says_its_rule(load_text: Load) -> None:
    robot = load_text(robot_xml(HINGE, {"s": ("arm", "0 0 0.2")}, [], FLOOR.format(0.2 - 1e-6)))
    assert robot.boundaries["h"].signed_clearance(robot.home) == pytest.approx(1e-6, abs=1e-15)
    assert robot.boundaries.free(robot.home)
    assert robot.boundaries.limits("q", robot.home).blocked_by == ()
    with pytest.raises(pb.InputError, match=r"a distance of 0\.003575 mm, which is below contact_tolerance, 0\.02 mm"):
        load_text(robot_xml(ELBOW, {"p": ("base", "0 0 0.500003575"), "s": ("fore", "0 0 0.2")}, [("p", "s")]))
    extra = '<pinbound:boundary name="x" a="p" b="s" min_distance="0.002"/>'
    with pytest.raises(pb.InputError, match="distance of 1 mm, which is not above its threshold of 2 mm"):
        load_text(robot_xml(ELBOW, {"p": ("base", "0 0 0.501"), "s": ("fore", "0 0 0.2")}, [], extra))
    near = f'stop="true"/><pinbound:home q="{math.pi - 6e-5!r}"'
    with pytest.raises(pb.InputError, match=r"is a stop, and home is 0\.01.* mm from it, not more than contact_tol"):
        hinge(load_text, 0.2011, near)


def test_free_counts_the_limits_of_mimic_joints(load_text: Load) -> None:
    joints = [*HINGE, joint("f", "revolute", "arm", "tip", mimic="q 2 0.1", limit="-1 1")]
    robot = load_text(robot_xml(joints, {}, []))
    Q = np.array([[0.0], [0.45], [0.451], [-0.551], [np.nan], [np.inf]])
    assert robot.boundaries.free(Q).tolist() == [True, True, False, False, False, False]
    assert [robot.boundaries.free(q) for q in Q] == robot.boundaries.free(Q).tolist()
    assert robot.boundaries.free(Q, limits=False).tolist() == [True] * 4 + [False] * 2


@pytest.mark.parametrize("seed", range(4))
def test_an_end_that_limits_give_is_allowed_when_asked_again(load_text: Load, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(15):
        m = float(rng.uniform(0.3, 3.0) * rng.choice([-1, 1]))
        o = float(rng.choice([0.0, rng.uniform(-0.5, 0.5), 1e6]))
        low, high = o + float(rng.uniform(-2.0, -0.6)), o + float(rng.uniform(0.6, 2.0))
        joints = [
            joint("q", "revolute", "base", "arm", limit="-9 9"),
            joint("other", "revolute", "arm", "tip"),
            joint("f", "revolute", "arm", "end", mimic=f"q {m!r} {o!r}", limit=f"{low!r} {high!r}"),
        ]
        robot = load_text(robot_xml(joints, {}, []))
        found = robot.boundaries.limits("q", robot.home)
        for end in (found.lower, found.upper):
            q = np.array([end, 0.0])
            assert robot.boundaries.limits("q", q).blocked_by == ()
            assert robot.boundaries.limits("other", q).blocked_by == ()
            assert not np.isnan(robot.boundaries.limits_table("other", [q])[0]).any()
            assert robot.boundaries.free(q)
            assert pb.certify(robot, [q]).verdict is not pb.Verdict.VIOLATED
            assert pb.load(robot.document.path, annotations=pb.Annotations(home={"q": end})).home[0] == end
            assert not robot.boundaries.free(q + np.sign(end - robot.home[0]) * 1e-8)


def module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "benchmarks" / f"{name}.py")
    assert spec
    assert spec.loader
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.mark.parametrize("seed", [11, 12])
def test_five_questions_never_disagree(seed: int) -> None:
    """A seeded part of `benchmarks/agreement.py`."""
    asked, wrong = module("agreement").campaign(pairs=1_500, seed=seed, rows=250)
    assert sum(wrong.values()) == 0, wrong
    assert asked["stops"] > 0
    assert min(asked["region"], asked["certify, single q"], asked["limits, coordinate and q"]) > 300


def changed_minervabot(folder: Path, extra: str = 'stop="true"') -> pb.Robot:
    """Return MinervaBotV3 with o14 2.56 mm further out, so that the arms of beta_4 differ by 1.11 mm."""
    source = pb.packaged_robots()["minervabot_v3"]
    text = source.read_text().replace('xyz="-0.01344 0 0.03061"', 'xyz="-0.016 0 0.03061"')
    text = text.replace('a="o14" b="o15" stop="true"', f'a="o14" b="o15" {extra}')
    (folder / "parallelogram.xacro").write_text(source.with_name("parallelogram.xacro").read_text())
    (folder / "changed.urdf.xacro").write_text(text)
    return pb.load(folder / "changed.urdf.xacro")


def test_a_changed_minervabot_keeps_its_contact_and_says_what_it_is(tmp_path: Path, minerva: pb.Robot) -> None:
    assert [boundary.stop for boundary in minerva.boundaries] == [True] * 10
    assert minerva.notes == ()
    robot = changed_minervabot(tmp_path)
    assert [note for note in robot.notes if "1.11 mm" in note]
    region = pb.feasible_region(robot)
    assert "beta_4" in {edge.name for edge in region.edges}
    assert region.area < pb.feasible_region(minerva).area
    assert Study(minerva).changes == ()
    assert Study(robot).changes == ("o14 at (-16, 30.61) mm, printed (-13.44, 30.61)",)
    level = pb.cross_check(robot, samples=50, seed=0).boundaries
    assert level.holds
    bare = changed_minervabot(tmp_path, "")
    assert [note for note in bare.notes if note.startswith("o14 and o15 (beta_4) miss each other by 1.11 mm; if")]
    with pytest.raises(pb.UnsupportedError, match=r'miss each other by 1\.11 mm.*declare it: stop="true"'):
        Study(bare)


def test_batches_call_what_lies_beyond_a_stop_contact(minerva: pb.Robot) -> None:
    from pinbound.batch import VERDICTS, evaluation_of

    Q = np.radians([[0.0, 0.0, 0.0], [0.0, 0.0, 60.0], [140.0, 0.0, 0.0], [0.0, 30.0, 30.0]])
    table, counts = evaluation_of(minerva, ("smallest", "verdict"), backend="numpy").table(Q, 0)
    assert table["verdict"].to_pylist() == ["inside", "contact", "limit", "inside"]
    assert np.array_equal(table["smallest_clearance"], minerva.boundaries.signed_clearances(Q).min(axis=1))
    assert counts.verdicts[VERDICTS.index("contact")] == 1


def test_signed_gradients_are_the_slopes_of_signed_clearances(any_robot: pb.Robot) -> None:
    B, n = any_robot.boundaries, len(any_robot.coordinates)
    Q, h = np.random.default_rng(3).uniform(-1.5, 1.5, (40, n)), 1e-6
    G = B.signed_gradients(Q)
    assert G.shape == (40, len(B), n)
    for j in range(n):
        step = h * np.eye(n)[j]
        slope = (B.signed_clearances(Q + step) - B.signed_clearances(Q - step)) / (2 * h)
        sure = np.abs(B.signed_clearances(Q)) > 1e-3
        assert np.abs(G[:, :, j] - slope)[sure].max() < 1e-6
    assert np.allclose(B.signed_gradients(Q[0]), G[0], rtol=1e-12, atol=1e-14)
    assert np.array_equal(B.signed_clearances(Q), pb.signed_clearances(any_robot, Q))


def _enclosures(robot: pb.Robot, rng: np.random.Generator) -> Any:
    from pinbound.certificates.constraints import families

    _, one, *_ = families(robot, tuple(robot.boundaries), np.full(1, -30.0), np.full(1, 30.0))
    centre, half = rng.uniform(-20.0, 20.0, (300, 1)), rng.uniform(0.0, 4.0, (300, 1))
    return one, centre, half, one.enclose_box(np.zeros(300, dtype=np.intp), centre, half)


@pytest.mark.parametrize("length", [0.2, 0.2011])
def test_the_bounds_of_a_stop_over_an_interval_are_its_extremes(load_text: Load, length: float) -> None:
    robot = hinge(load_text, length)
    one, centre, half, found = _enclosures(robot, np.random.default_rng(5))
    samples = centre + half * np.linspace(-1.0, 1.0, 4001)
    values = one.signed(samples.reshape(-1, 1)).reshape(samples.shape)
    least = values.min(axis=1)
    assert np.all(found.lower <= least)
    assert np.all(least - found.lower < 1e-5)  # what 4,001 samples may miss
    assert np.array_equal(found.clear, np.all(np.abs(samples) < math.pi - 1e-11, axis=1))
    assert not np.any(found.violated & (np.abs(centre[:, 0]) < math.pi))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_every_backend_has_the_signs_of_the_rule(minerva: pb.Robot, backend: Any, dtype: Any) -> None:
    """At, next to, beside and turns beyond every contact line: what a fused sine cannot tell, the rule decides."""
    rng, B = np.random.default_rng(4), minerva.boundaries
    Q = rng.uniform(-3.0, 3.0, (400, 3))
    for boundary in B:
        stop = boundary.rule.stop
        assert stop is not None
        index = int(np.flatnonzero(stop.coefficients)[-1])
        near = rng.uniform(-1.0, 1.0, (60, 3))
        rest = near @ stop.coefficients - near[:, index] * stop.coefficients[index]
        off = rng.choice([0.0, 1e-17, -1e-17, 1e-15, -1e-15, 1e-9, -1e-9, 7.0, -7.0, 50.0], 60)
        near[:, index] = (np.array(stop.gap)[rng.integers(0, 2, 60)] - rest + off) / stop.coefficients[index]
        Q = np.vstack((Q, near))
    Q[7, 1], Q[9, 2] = np.nan, np.inf
    rule = np.stack([boundary.rule.signed(Q) for boundary in B], axis=1)
    found = B.signed_clearances(Q, backend=backend, dtype=dtype)
    smallest = B.smallest(Q, backend=backend, dtype=dtype)
    least, index = smallest.clearance, smallest.index
    assert np.array_equal(np.isnan(found), np.isnan(rule))
    finite = ~np.isnan(rule)
    assert np.array_equal(found[finite] > 0.0, rule[finite] > 0.0)
    rounding = 64.0 * np.finfo(dtype).eps * (1.0 + np.nan_to_num(np.abs(Q), posinf=0.0).max(axis=1))
    assert np.all((np.abs(found - rule) <= rounding[:, None])[finite])
    told = finite.all(axis=1)
    assert np.array_equal(index < 0, ~told)
    assert np.array_equal(least[told] > 0.0, rule[told].min(axis=1) > 0.0)
    assert np.all(np.abs(least - rule.min(axis=1))[told] <= rounding[told])
    assert np.array_equal(B.free(Q, limits=False), np.all(np.where(finite, rule, -1.0) > 0.0, axis=1))
