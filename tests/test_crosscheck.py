"""Agreement with coal on four levels; and every kind of fault is caught on the level that should see it."""

import importlib.metadata
import json
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from typer.testing import CliRunner

import pinbound as pb
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.cli import app
from pinbound.coverage.bodies import collision_bodies
from pinbound.crosscheck.engine import Engine, body_shapes, sample, within_limits
from pinbound.crosscheck.sweep import approach_speed
from pinbound.model.coupling import Coupling
from pinbound.path.relative import relative_path
from pinbound.tolerances import CROSSCHECK_ANGLE, CROSSCHECK_BODY, CROSSCHECK_POINT
from robots import ZOO, random_q

Load = Callable[..., pb.Robot]
DATA = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
PUBLIC = DATA / "example-robot-data" / "robots"
FANUC = Path(__file__).parents[2] / "shared" / "robots" / "fanuc_m410ic_185_botrail" / "fanuc_m410ic_185_botrail.urdf"
MATHEMATICS = ("points", "boundaries")
EDGES = {"beta_3": "o12", "beta_4": "o14", "beta_7": "o22", "beta_8": "o24", "beta_9": "o25", "beta_10": "o29"}


def with_radii(name: str, radius: float, folder: Path) -> pb.Robot:
    """Return a robot of the zoo whose points are spheres, those of its boundaries that are free at home."""
    path = folder / f"{name}.urdf"
    path.write_text(ZOO[name])
    marks = pb.load(path).annotations
    points = [replace(point, radius=radius) for point in marks.points.values()]
    bare = folder / "bare.urdf"
    root = etree.fromstring(ZOO[name].encode())
    for element in root.findall("{urn:pinbound:1}annotations"):
        root.remove(element)
    bare.write_bytes(etree.tostring(root))
    home = pb.load(path).home
    boundaries = [b for b in marks.boundaries if pb.load(path).boundaries[b.name].norm(home) > 2 * radius + 1e-3]
    return pb.load(bare, annotations=pb.Annotations.of(points, [replace(b, min_distance=0.004) for b in boundaries]))


def test_mathematics_agrees_on_every_robot_of_the_zoo(any_robot: pb.Robot) -> None:
    found = pb.cross_check(any_robot, samples=1000, rays=60, seed=3, levels=MATHEMATICS)
    assert found.points is not None
    assert found.boundaries is not None
    assert set(found.boundaries.boundaries) == {b.name for b in any_robot.boundaries if b.coordinates}
    assert found.points.samples > 900
    assert found.points.worst < CROSSCHECK_POINT
    assert found.boundaries.worst < CROSSCHECK_ANGLE
    assert found.holds


@pytest.mark.parametrize("name", [name for name in ZOO if name != "minervabot_v3"])
@pytest.mark.parametrize("radius", [0.08, 0.14])
def test_spheres_meet_where_the_closed_form_says(name: str, radius: float, tmp_path: Path) -> None:
    robot = with_radii(name, radius, tmp_path)
    assert len(robot.boundaries) >= 1
    found = pb.cross_check(robot, samples=500, rays=80, seed=4, levels=MATHEMATICS)
    assert found.boundaries is not None
    assert found.holds, found.boundaries
    contacts = sum(one.rays - one.free for one in found.boundaries.boundaries.values())
    assert contacts >= 2


def test_every_way_to_find_a_contact_is_used(tmp_path: Path) -> None:
    methods = set()
    for name in ("planar_2r", "spatial_4r", "slides"):
        found = pb.cross_check(with_radii(name, 0.08, tmp_path), rays=60, levels=("boundaries",)).boundaries
        assert found is not None
        methods |= {word for one in found.boundaries.values() for word in one.method.split(" and ")}
    assert methods == {"contact strip", "smallest norm", "allowed arcs"}


def test_minervabot_holds_on_all_four_levels(minerva: pb.Robot) -> None:
    found = pb.cross_check(minerva, samples=1000, rays=100, seed=5, step=0.015)
    assert found.holds
    assert not found.not_checked
    assert found.points is not None
    assert max(found.points.pins.values()) < 1e-15
    assert found.bodies is not None
    assert len(found.bodies.pairs) == 7
    assert found.bodies.worst < 1e-9
    assert found.bodies.refusal < 1e-9
    assert min(pair.both_clear for pair in found.bodies.pairs) > 100
    assert min(pair.both_contact for pair in found.bodies.pairs) >= 3
    assert found.region is not None
    assert found.region.shapes == "bodies"
    assert found.region.nodes > 6_000
    assert (found.region.unsafe, found.region.refused) == (0, 0)
    assert max(found.region.contour_inside, found.region.contour_outside) < 1e-9


@pytest.mark.parametrize("argument", [{"pivot_z": "0.06901"}, {"bridge": "as_printed"}])
def test_the_bodies_follow_the_arguments_of_the_xacro(argument: dict[str, str]) -> None:
    robot = pb.load("minervabot_v3", xacro_args=argument)
    assert robot.boundaries["beta_10" if "pivot_z" in argument else "beta_5"].contact is not None
    found = pb.cross_check(robot, samples=100, levels=("bodies", "region"), step=0.02)
    assert found.holds
    assert found.region is not None
    assert found.region.ignored == ()
    assert found.region.contour_inside < 1e-9


def moved(
    robot: pb.Robot, load_text: Load, point: str, xyz: tuple[float, float, float], stops: bool = True
) -> pb.Robot:
    root = deepcopy(robot.document.root)
    for boundary in () if stops else root.iter("{urn:pinbound:1}boundary"):
        del boundary.attrib["stop"]
    element = next(e for e in root.iter("{urn:pinbound:1}point") if e.get("name") == point)
    old = [float(word) for word in str(element.get("xyz")).split()]
    element.set("xyz", " ".join(repr(a + b) for a, b in zip(old, xyz, strict=True)))
    return load_text(etree.tostring(root).decode())


@pytest.mark.parametrize("step", [(1e-3, 0, 0), (0, 0, -1e-3)])
@pytest.mark.parametrize("name", EDGES)
def test_a_marked_point_that_is_a_millimetre_off_is_caught_by_the_bodies(
    minerva: pb.Robot, load_text: Load, name: str, step: tuple[float, float, float]
) -> None:
    wrong = moved(minerva, load_text, EDGES[name], step)
    found = pb.cross_check(wrong, samples=300, seed=6, levels=("bodies",)).bodies
    assert found is not None
    assert any(name in pair.boundaries for pair in found.pairs if not found.pair_holds(pair))
    worst = max(found.worst, found.refusal)
    stated = any(f"({name}) miss each other" in note for note in wrong.notes)  # along its arm a stop keeps its angle
    assert worst > 1e-4 or (stated and worst > found.tolerance)


def test_a_point_off_is_caught_by_the_region_too(minerva: pb.Robot, load_text: Load) -> None:
    for step, stops in (((0, 0, 1e-3), True), ((1e-3, 0, 0), False)):
        wrong = moved(minerva, load_text, "o25", step, stops)
        found = pb.cross_check(wrong, levels=("region",), step=0.02).region
        assert found is not None
        assert not found.holds
        assert found.depth_unsafe > found.step or max(found.contour_inside, found.contour_outside) > found.tolerance
    along = moved(minerva, load_text, "o25", (1e-3, 0, 0))  # a declared stop keeps its angle, and says the millimetre
    found = pb.cross_check(along, levels=("region",), step=0.02).region
    assert found is not None
    assert found.holds
    assert any("o25 and o26 (beta_9) miss each other by" in note for note in along.notes)


def test_a_wrong_path_is_caught_by_the_mathematics_and_named(minerva: pb.Robot) -> None:
    boundary = minerva.boundaries["beta_4"]
    off = replace(boundary.point_a, xyz=(boundary.point_a.xyz[0] + 1e-3, 0.0, boundary.point_a.xyz[2]))
    path = relative_path(minerva.tree, minerva.coupling, off, boundary.point_b)
    boundaries = [replace(b, path=path) if b.name == "beta_4" else b for b in minerva.boundaries]
    wrong = replace(
        minerva, boundaries=BoundarySet(boundaries, minerva.coordinates, minerva.linear_limits, minerva.home)
    )
    found = pb.cross_check(wrong, samples=200, rays=40, levels=MATHEMATICS)
    assert found.points is not None
    assert found.boundaries is not None
    assert not found.points.holds
    assert not found.boundaries.holds
    assert found.points.differences["beta_4"] == pytest.approx(1e-3, rel=0.2)
    assert {name for name, value in found.points.differences.items() if value > CROSSCHECK_POINT} == {"beta_4"}
    seen = found.boundaries.boundaries["beta_4"]
    assert seen.metres > 1e-4
    q = found.points.witnesses["beta_4"]
    assert abs(wrong.boundaries["beta_4"].clearance(q) - minerva.boundaries["beta_4"].clearance(q)) > 5e-4


def test_a_wrong_closure_and_a_wrong_coupling_are_caught(minerva: pb.Robot) -> None:
    first = minerva.closures[0]
    x, y, z = first.mark.xyz_a
    off = replace(first, mark=replace(first.mark, xyz_a=(x, y, z + 1e-3)))
    found = pb.cross_check(replace(minerva, closures=(off, *minerva.closures[1:])), samples=50, levels=("points",))
    assert not found.holds
    assert found.points is not None
    assert found.points.pins["drive"] == pytest.approx(1e-3, abs=1e-12)
    S = minerva.coupling.S.copy()
    S[minerva.coupling.joints.index("q2_orientation_rod")] *= 0.99
    coupling = Coupling(minerva.coupling.coordinates, minerva.coupling.joints, S, minerva.coupling.offset)
    found = pb.cross_check(replace(minerva, coupling=coupling), samples=50, rays=20, levels=MATHEMATICS)
    assert found.points is not None
    assert found.points.pins["orientation"] > 1e-4
    assert found.points.differences["beta_10"] > 1e-6
    assert not found.boundaries.holds


def test_region_of_spheres_equals_the_flood_fill(tmp_path: Path) -> None:
    robot = with_radii("planar_2r", 0.11, tmp_path)
    robot = pb.load(
        tmp_path / "bare.urdf",
        annotations=replace(
            robot.annotations, boundaries=tuple(b for b in robot.annotations.boundaries if b.name != "p_t")
        ),
    )
    assert len(robot.boundaries) >= 1
    found = pb.cross_check(robot, levels=("region",), step=0.03)
    if found.region is None:
        pytest.fail(str(found.not_checked))
    assert found.region.shapes == "spheres"
    assert found.region.holds
    assert len(found.region.contour) > 50
    assert max(found.region.contour_inside, found.region.contour_outside) < 1e-7


def test_bodies_of_minervabot_touch_at_the_stops_only(minerva: pb.Robot) -> None:
    """Pivots that links share do not collide, nor do any two links of the robot, anywhere in the region."""
    bodies = collision_bodies(minerva)
    links = {body.link for body in bodies}
    assert {point.link for point in minerva.annotations.points.values()} <= links
    pairs = [
        (a, b)
        for a, b in combinations(range(len(bodies)), 2)
        if any(joint.moves for joint in minerva.tree.path_between(bodies[a].link, bodies[b].link))
    ]
    region = pb.feasible_region(minerva)
    rng = np.random.default_rng(8)
    weights = rng.dirichlet(np.ones(len(region.vertices)) * 0.4, 150)
    Q = np.column_stack((rng.uniform(-2.3, 2.3, 150), weights @ region.vertices))
    Q = Q[region.signed_distance(Q) > 1e-6]
    assert len(Q) > 100
    assert Engine(minerva, body_shapes(bodies), pairs).distances(Q).min() > 0.0


def test_stock_pinocchio_reads_the_same_bodies(minerva: pb.Robot) -> None:
    text = etree.tostring(minerva.document.root).decode()
    model = pin.buildModelFromXML(text, mimic=True)
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    assert model.nq == 3
    bodies = collision_bodies(minerva)
    assert geometry.ngeoms == len(bodies)
    data, places = model.createData(), pin.GeometryData(geometry)
    own = minerva.model.createData()
    for q in random_q(minerva, 5, seed=9):
        pin.updateGeometryPlacements(model, data, geometry, places, minerva.to_pinocchio(model, q))
        pin.framesForwardKinematics(minerva.model, own, minerva.coupling.expand(q))
        for body in bodies:
            index = geometry.getGeometryId(f"{body.link}_{body.index}")
            frame = own.oMf[minerva.model.getFrameId(body.link, pin.BODY)]
            expected = frame * pin.SE3(body.rotation, body.translation)
            assert np.abs(places.oMg[index].homogeneous - expected.homogeneous).max() < 1e-12
            shape = geometry.geometryObjects[index].geometry
            if body.shape == "box":
                assert 2 * shape.halfSide == pytest.approx(np.array(body.size), abs=1e-15)


@pytest.mark.parametrize(
    ("path", "accuracy", "samples"),
    [
        pytest.param(PUBLIC / "panda_description/urdf/panda_collision.urdf", 0.05, 250, id="panda_collision"),
        pytest.param(PUBLIC / "z1_description/urdf/z1.urdf", 0.05, 400, id="z1"),
        pytest.param(PUBLIC / "a1_description/urdf/a1.urdf", 0.05, 150, id="a1"),
        pytest.param(FANUC, 0.2, 200, id="fanuc_m410ic_185"),
    ],
)
def test_covers_of_public_robots_never_miss(path: Path, accuracy: float, samples: int) -> None:
    """A seeded subset of benchmarks/validate.py."""
    if not path.is_file():
        pytest.skip(f"{path.name} is not beside the checkout")
    proposal = pb.propose_marks(pb.load(path), accuracy)
    robot = pb.load(path, annotations=proposal.annotations)
    overlapping = {frozenset((a, b)) for a, b, reason in proposal.left_out if reason.startswith("in contact")}
    assert all("all of" in reason for _, _, reason in proposal.left_out if reason.startswith("in contact"))
    found = pb.cross_check(robot, samples=samples, seed=10, levels=("points", "bodies"))
    assert found.points is not None
    assert found.points.holds
    assert found.bodies is not None
    pairs = found.bodies.pairs
    assert pairs
    assert not overlapping & {frozenset(pair.links) for pair in pairs}  # by design, and not watched at all
    for pair in pairs:
        assert pair.touching == 0
        assert pair.misses == 0
        assert pair.miss <= CROSSCHECK_BODY
        assert pair.refusal <= 2 * proposal.excess + CROSSCHECK_BODY
    assert sum(pair.both_contact for pair in pairs) > 0


def test_bodies_never_approach_faster_than_the_sweep_assumes(minerva: pb.Robot, tmp_path: Path) -> None:
    bodies = [body for body in collision_bodies(minerva) if body.link in ("link_16", "link_13")]
    sliding = tmp_path / "slides.urdf"
    ball = '<collision><origin xyz="0.1 0 0.1"/><geometry><sphere radius="0.02"/></geometry></collision>'
    text = ZOO["slides"]
    for link in ("base", "e"):
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{ball}</link>')
    sliding.write_text(text)
    slides = pb.load(sliding)
    for robot, links, found in (
        (minerva, ("link_13", "link_16"), bodies),
        (slides, ("base", "e"), list(collision_bodies(slides))),
    ):
        pairs = [(i, j) for i, j in combinations(range(len(found)), 2) if found[i].link != found[j].link]
        engine = Engine(robot, body_shapes(found), pairs)
        ends = sample(robot, 60, np.random.default_rng(11))
        speed = approach_speed(robot, found, links, ends - robot.home)
        t = np.linspace(0.0, 1.0, 60)
        fastest = []
        for end, v in zip(ends, speed, strict=True):
            distance = np.min(engine.distances(robot.home + t[:, None] * (end - robot.home)), axis=1)
            rate = np.abs(np.diff(distance)) / np.diff(t)
            assert rate.max() <= v
            fastest.append(rate.max() / v)
        assert max(fastest) > 0.05  # a bound, but not an empty one


def test_a_thin_wall_between_the_samples_is_found_by_the_sweep(load_text: Load) -> None:
    """The marked point is behind the wall: pinbound calls the way clear, and the wall is 0.4 mm thick."""
    wall = '<collision><origin xyz="0 0 0.3"/><geometry><box size="0.0004 0.1 0.1"/></geometry></collision>'
    finger = '<collision><origin xyz="0 0 0.3"/><geometry><sphere radius="0.001"/></geometry></collision>'
    robot = load_text(
        '<robot name="r" xmlns:pinbound="urn:pinbound:1">'
        f'<link name="base">{wall}</link><link name="arm">{finger}</link>'
        '<joint name="q" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>'
        '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        '<pinbound:annotations><pinbound:home q="1.5"/>'
        '<pinbound:point name="p" link="base" xyz="0 0 -0.3"/><pinbound:point name="s" link="arm" xyz="0 0 0.3"/>'
        '<pinbound:boundary name="beta" a="p" b="s"/></pinbound:annotations></robot>'
    )
    found = pb.cross_check(robot, samples=60, seed=1, levels=("bodies",)).bodies
    assert found is not None
    (pair,) = found.pairs
    assert pair.misses <= 1
    assert pair.miss > 0.5e-3
    assert pair.miss_q is not None
    assert abs(pair.miss_q[0]) < 0.01
    assert not found.holds


def test_a_link_and_a_joint_of_one_name_are_not_confused(load_text: Load) -> None:
    text = ZOO["spatial_4r"].replace('joint name="j3"', 'joint name="a"').replace('joint name="j4"', 'joint name="b"')
    robot = load_text(text)
    assert "b" in robot.tree.links
    assert "b" in robot.coordinates
    assert pb.cross_check(robot, samples=100, rays=8, levels=MATHEMATICS).holds


def test_samples_respect_followers_limits(load_text: Load) -> None:
    text = ZOO["slides"].replace('lower="-3" upper="3"', 'lower="-1" upper="1"')
    robot = load_text(text)
    Q = sample(robot, 500, np.random.default_rng(0))
    assert len(Q) == 500
    assert within_limits(robot, Q).all()
    theta = robot.coupling.expand(Q)[:, robot.coupling.joints.index("copy")]
    assert np.abs(theta).max() <= 1.0


def test_the_same_seed_gives_the_same_answer_and_levels_do_not_disturb_each_other(minerva: pb.Robot) -> None:
    whole = pb.cross_check(minerva, samples=50, rays=20, levels=("points", "boundaries", "bodies")).to_dict()
    again = pb.cross_check(minerva, samples=50, rays=20, levels=("points", "boundaries", "bodies")).to_dict()
    alone = pb.cross_check(minerva, samples=50, rays=20, levels=("bodies",)).to_dict()
    assert json.dumps(whole) == json.dumps(again)
    assert alone["bodies"] == whole["bodies"]
    assert json.dumps(whole) != json.dumps(
        pb.cross_check(minerva, 50, 1, ("points", "boundaries", "bodies"), 20).to_dict()
    )


def test_wrong_questions_and_levels_that_do_not_apply(load_text: Load, minerva: pb.Robot) -> None:
    with pytest.raises(pb.UnknownNameError, match="points, boundaries, bodies, region"):
        pb.cross_check(minerva, levels=("meshes",))
    with pytest.raises(pb.UnknownNameError, match="no level ''"):
        pb.cross_check(minerva, levels=())
    with pytest.raises(pb.DimensionError, match="samples is 0; give a whole number of 1 or more"):
        pb.cross_check(minerva, samples=0)
    with pytest.raises(pb.DimensionError, match="positive angle"):
        pb.cross_check(minerva, levels=("region",), step=-1.0)
    arm = load_text(ZOO["spatial_4r"])
    found = pb.cross_check(arm, samples=10, rays=4)
    assert set(found.not_checked) == {"bodies", "region"}
    assert found.holds
    stuck = load_text(
        ZOO["slides"].replace(
            '<mimic joint="tilt" multiplier="-2" offset="0.25"', '<mimic joint="tilt" multiplier="-2" offset="9"'
        )
    )  # one value of tilt alone keeps the limits of both: home has it, no random one does
    with pytest.raises(pb.UnsupportedError, match="satisfies the limits"):
        pb.cross_check(stuck, levels=("points",))
    nothing = load_text('<robot name="r"><link name="only"/></robot>')
    found = pb.cross_check(nothing)
    assert not found.holds
    assert set(found.not_checked.values()) == {"the robot has no boundaries"}


def run(*arguments: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, ["crosscheck", *arguments])
    assert result.exit_code == code, result.output
    return result.stdout if code != 2 else result.stderr


def test_command_line(minerva: pb.Robot, load_text: Load, tmp_path: Path) -> None:
    few = ("--samples", "60", "--rays", "20")
    text = run("minervabot_v3", *few, "--out", str(tmp_path / "region.png"))
    assert "points holds, boundaries holds, bodies holds, region holds" in text
    assert (tmp_path / "region.png").read_bytes().startswith(b"\x89PNG")
    record = json.loads(run("minervabot_v3", *few, "--levels", "points,bodies", "--json"))
    assert record["holds"] is True
    assert record["points"]["worst"] < 1e-12
    assert record["region"] is None
    moved(minerva, load_text, "o22", (0, 0, -1e-3))
    wrong = str(tmp_path / "robot.urdf")
    text = run(wrong, "--samples", "100", "--levels", "bodies", code=1)
    assert "bodies DISAGREES" in text
    assert "worst needless refusal at q1=" in text or "worst miss at q1=" in text
    assert json.loads(run(wrong, "--samples", "100", "--levels", "bodies", "--json", code=1))["holds"] is False
    assert "points, boundaries, bodies, region" in run("minervabot_v3", "--levels", "points,body", code=2)
    assert ".png or .svg" in run("minervabot_v3", "--out", "region.pdf", code=2)
    assert "Add it to --levels" in run("minervabot_v3", "--levels", "points", "--out", "region.png", code=2)


BOXES = """<robot name="boxes" xmlns:pinbound="urn:pinbound:1"><link name="base"/><link name="arm"/><link name="hand"/>
  <joint name="q1" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="q2" type="revolute"><parent link="arm"/><child link="hand"/><origin xyz="{l} 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <pinbound:annotations contact_tolerance="{t}"><pinbound:home q1="0.2" q2="0.1"/>
    <pinbound:sweep name="fist" link="hand" xyz="{a} -{b} -{b}" ways="{l} 0 0  0 {c} 0  0 0 {c}"/>
    <pinbound:sweep name="palm" link="hand" xyz="{a} -{b} 0" ways="{l} 0 0  0 {c} 0"/>
    <pinbound:line name="pole" link="base" xyz="-{l} {l} 0" direction="0 0 1" radius="{b}"/>
    <pinbound:plane name="floor" link="base" xyz="0 -{l} 0" normal="0.6 0.8 0"/>
    <pinbound:point name="post" link="base" xyz="{l} {l} 0" radius="{b}"/>
    <pinbound:boundary name="fist_pole" a="fist" b="pole"/>
    <pinbound:boundary name="fist_floor" a="fist" b="floor"/>
    <pinbound:boundary name="fist_post" a="post" b="fist"/>
    <pinbound:boundary name="palm_pole" a="palm" b="pole"/>
    <pinbound:boundary name="palm_post" a="palm" b="post"/></pinbound:annotations></robot>"""


@pytest.mark.parametrize("size", [1.0, 1e3, 1e5])
def test_boxes_across_lines_and_above_planes_hold_at_every_size(load_text: Load, size: float) -> None:
    """A pole goes through a fist: distance zero, not coal's depth. Coal makes boxes larger by 1e-10 of themselves."""
    lengths = {name: repr(value * size) for name, value in {"l": 0.5, "a": 0.1, "b": 0.05, "c": 0.1, "t": 2e-5}.items()}
    robot = load_text(BOXES.format(**lengths))
    found = pb.cross_check(robot, samples=1_500, rays=25, levels=("points", "boundaries"))
    assert found.points is not None
    assert found.holds, (found.points.differences, found.boundaries)
    Q = np.random.default_rng(0).uniform(-2.0, 2.0, (4_000, 2))
    pierced = robot.boundaries["fist_pole"].clearance(Q) == -robot.boundaries["fist_pole"].threshold
    assert np.any(pierced)


def test_a_wrong_box_is_still_caught(load_text: Load) -> None:
    """The allowance of boxes is far below a tenth of a micrometre."""
    lengths = {"l": "0.5", "a": "0.1", "b": "0.05", "c": "0.1", "t": "2e-5"}
    robot = load_text(BOXES.format(**lengths))
    boundary = robot.boundaries["fist_floor"]
    chain = boundary.path.difference.chain
    moved = replace(chain, offsets=chain.offsets + 1e-7)
    path = replace(boundary.path, difference=replace(boundary.path.difference, chain=moved))
    wrong = replace(boundary, path=path)
    others = [wrong if one is boundary else one for one in robot.boundaries]
    made = replace(robot, boundaries=BoundarySet(others, robot.coordinates, robot.linear_limits, robot.home))
    found = pb.cross_check(made, samples=50, levels=("points",))
    assert found.points is not None
    assert not found.holds
    assert found.points.differences["fist_floor"] > found.points.allowed["fist_floor"]


THREE = """<robot name="three" xmlns:pinbound="urn:pinbound:1">
  <link name="base"/><link name="a"/><link name="b"/><link name="c"/>
  <joint name="q1" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
  <joint name="q2" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="q3" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 1 0"/></joint>
  <pinbound:annotations><pinbound:point name="tip" link="c" xyz="0.3 0 0" radius="0.05"/>
    <pinbound:point name="post" link="base" xyz="0.7 0.7 0.1" radius="0.1"/>
    <pinbound:boundary name="beta" a="tip" b="post"/></pinbound:annotations></robot>"""


def test_what_the_region_level_asks_for_can_be_given(load_text: Load, tmp_path: Path) -> None:
    """Three coordinates without limits: it asks for two of them, then for a window; both are parameters."""
    robot = load_text(THREE)
    asked = pb.cross_check(robot, levels=("region",)).not_checked["region"]
    assert "give coordinates=" in asked
    asked = pb.cross_check(robot, levels=("region",), coordinates=("q1", "q2")).not_checked["region"]
    assert "give window=" in asked
    window = {"q1": (-0.6, 0.6), "q2": (-0.6, 0.6)}
    found = pb.cross_check(robot, levels=("region",), coordinates=("q1", "q2"), window=window, step=0.03, accuracy=1e-4)
    assert found.region is not None
    assert found.holds
    assert found.region.region.accuracy <= 1e-4
    path = tmp_path / "three.urdf"
    path.write_text(THREE)
    words = [str(path), "--levels", "region", "--coordinates", "q1,q2", "--step", "0.05"]
    assert "region holds" in run(*words, "--window", "q1=-0.6..0.6,q2=-0.6..0.6")
    assert "NAME=LOWER..UPPER" in run(*words, "--window", "q1=-0.6:0.6", code=2)
