"""Robots that we did not make: a seeded subset of benchmarks/sweep.py, and panda_collision's spheres against coal."""

import importlib.metadata
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import coal
import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import pinbound as pb

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = DATA / "example-robot-data" / "robots"
SHARED = ROOT.parent / "shared" / "robots"
SUBSET = [
    "panda_description/urdf/panda.urdf",
    "pr2_description/urdf/pr2.urdf",
    "romeo_description/urdf/romeo.urdf",
    "talos_data/robots/talos_full_v2.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "anymal_b_simple_description/robots/anymal.urdf",
    "icub_description/robots/icub.urdf",
]


@pytest.fixture(scope="module")
def sweep() -> ModuleType:
    spec = importlib.util.spec_from_file_location("sweep", ROOT / "benchmarks" / "sweep.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["sweep"] = module
    spec.loader.exec_module(module)
    return module


def holds(sweep: ModuleType, path: Path) -> None:
    rng = np.random.default_rng(3)
    row = sweep.check(sweep.marked(path, 12, rng), path, 10, rng)
    assert row.pairs == 12
    assert row.vector < 1e-12
    assert row.gradient < 1e-7
    assert row.hessian < 1e-5


@pytest.mark.parametrize("name", SUBSET)
def test_a_robot_of_example_robot_data(sweep: ModuleType, name: str) -> None:
    holds(sweep, ROBOTS / name)


SHARED_FILES = sorted(SHARED.rglob("*.urdf")) if SHARED.is_dir() else []


@pytest.mark.skipif(not SHARED_FILES, reason="../shared/robots is not there")
@pytest.mark.parametrize("path", SHARED_FILES, ids=lambda path: path.stem)
def test_a_parallelogram_found_in_the_wild(sweep: ModuleType, path: Path) -> None:
    holds(sweep, path)


def test_every_urdf_loads_but_those_that_cannot_be_right() -> None:
    refused: dict[str, str] = {}
    paths = sorted(ROBOTS.rglob("*.urdf"))
    for path in paths:
        try:
            robot = pb.load(path)
        except pb.InputError as error:
            refused[path.name] = error.problems[0].message
            continue
        assert robot.model.nq == len(robot.coupling.joints)
    assert len(paths) == 69
    assert sorted(refused) == ["alex_psyonic_hands.urdf", "ur3.urdf"]
    assert refused["ur3.urdf"] == "the robot has no links"
    assert "follows 'index_q1', which is no joint of this robot" in refused["alex_psyonic_hands.urdf"]


@pytest.mark.parametrize(
    ("name", "coordinates", "joints"),
    [("romeo_description/urdf/romeo.urdf", 33, 55), ("talos_data/robots/talos_full_v2.urdf", 32, 44)],
)
def test_followers_that_stock_pinocchio_refuses_are_coupled(name: str, coordinates: int, joints: int) -> None:
    with pytest.raises((ValueError, RuntimeError)):
        pin.buildModelFromUrdf(str(ROBOTS / name), mimic=True)
    robot = pb.load(ROBOTS / name)
    assert (len(robot.coordinates), len(robot.coupling.joints)) == (coordinates, joints)


@pytest.mark.parametrize("allowed", [1e-13, 1e-9])
@pytest.mark.parametrize("mimic", [True, False])
def test_to_pinocchio_on_a_model_with_a_free_flyer_and_continuous_joints(mimic: bool, allowed: float) -> None:
    path = ROBOTS / "kinova_description/robots/kinova.urdf"
    robot = pb.load(path)
    text = path.read_text()
    if allowed < 1e-12:  # the file prints pi to 11 digits, which load reads as pi and says so
        text = etree.tostring(robot.document.root).decode()
        assert any("3.14159265359 as pi" in note for note in robot.notes)
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), mimic=mimic)
    assert model.nq > model.nv
    data, own = model.createData(), robot.model.createData()
    Q = np.random.default_rng(5).uniform(-2, 2, (5, len(robot.coordinates)))
    for q, theta in zip(robot.to_pinocchio(model, Q), robot.coupling.expand(Q), strict=True):
        pin.framesForwardKinematics(model, data, q)
        pin.framesForwardKinematics(robot.model, own, theta)
        for link in robot.tree.links:
            there = data.oMf[model.getFrameId(link, pin.BODY)].homogeneous
            assert np.abs(there - own.oMf[robot.model.getFrameId(link, pin.BODY)].homogeneous).max() < allowed


def test_a_boundary_does_not_depend_on_a_floating_base() -> None:
    path = ROBOTS / "talos_data/robots/talos_left_arm.urdf"
    robot = pb.load(path)
    links = list(robot.tree.links)
    marks = pb.Annotations.of(
        [pb.Point("p", links[1], (0.1, 0.0, 0.0)), pb.Point("s", links[-1], (0.0, 0.1, 0.0))],
        [pb.BoundaryMark("b", "p", "s")],
        contact_tolerance=0.0,
    )
    boundary = pb.load(path, annotations=marks).boundaries["b"]
    free = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    marked = pb.load(path, annotations=marks)
    data, rng = free.createData(), np.random.default_rng(6)
    for _ in range(5):
        q = rng.uniform(-1, 1, len(robot.coordinates))
        full = marked.to_pinocchio(free, q)
        full[:7] = pin.randomConfiguration(free, -np.ones(free.nq), np.ones(free.nq))[:7]
        pin.framesForwardKinematics(free, data, full)
        a, b = (
            data.oMf[free.getFrameId(point.link, pin.BODY)] * np.array(point.xyz)
            for point in (boundary.point_a, boundary.point_b)
        )
        assert np.linalg.norm(a - b) == pytest.approx(boundary.norm(q), rel=1e-12)


def test_panda_spheres_equal_coal_sphere_distances() -> None:
    """All sphere pairs of links that are not adjacent as boundaries in one call."""
    path = ROBOTS / "panda_description/urdf/panda_collision.urdf"
    proposal = pb.propose_marks(pb.load(path), shapes=("sphere",))
    assert sum(body.shape == "sphere" for cover in proposal.covers for body in cover.bodies) == 26
    robot = pb.load(path, annotations=proposal.annotations)
    assert len(robot.boundaries) > 100
    data = robot.model.createData()
    Q = np.random.default_rng(7).uniform(robot.lower, robot.upper, (20, len(robot.coordinates)))
    clearances = robot.boundaries.clearances(Q)
    request = coal.DistanceRequest()
    worst = 0.0
    for row, theta in enumerate(robot.coupling.expand(Q)):
        pin.framesForwardKinematics(robot.model, data, theta)
        for column, boundary in enumerate(robot.boundaries):
            shapes, places = [], []
            for point in (boundary.point_a, boundary.point_b):
                frame = data.oMf[robot.model.getFrameId(point.link, pin.BODY)]
                shapes.append(coal.Sphere(point.radius))
                places.append(coal.Transform3s(frame.rotation, frame * np.array(point.xyz)))
            found = coal.distance(shapes[0], places[0], shapes[1], places[1], request, coal.DistanceResult())
            worst = max(worst, abs(found - clearances[row, column]))
    assert worst < 1e-12
