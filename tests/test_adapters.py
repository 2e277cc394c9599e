"""Controllers in closed loop, sent where they must not go: Pink and mink, where they are installed."""

import re
import sys
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import pinbound as pb
from pinbound.adapters import mink as our_mink
from pinbound.adapters import pink as our_pink
from pinbound.adapters.shared import SafeSteps
from robots import joint, robot_xml
from test_steps import JOINTS, MARKS

KINDS = ("spheres", "capsules", "floor", "pole")
ARM = [one for one in JOINTS if "mimic" not in one] + [
    joint("e", "revolute", "l4", "l5", axis="0 1 1", xyz="0.1 0.2 0", limit="-2 2")
]


def arm(joints: list[str]) -> tuple[str, pb.Robot]:
    marks = {mark.name: mark for kind in KINDS for mark in MARKS[kind]}
    bounds = [pb.BoundaryMark(kind, *(mark.name for mark in MARKS[kind])) for kind in KINDS]
    text = robot_xml(joints, {}, [])
    return text, pb.load(text, annotations=pb.Annotations.of(marks.values(), bounds))


def with_masses(text: str) -> str:
    """Return a URDF that MuJoCo compiles: every link has an inertia, and every body keeps its name."""
    inertia = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    head = '<mujoco><compiler fusestatic="false" balanceinertia="true" discardvisual="false"/></mujoco>'
    text = re.sub(r'<link name="(\w+)"/>', rf'<link name="\1">{inertia}</link>', text)
    return re.sub(r"<pinbound:annotations.*</pinbound:annotations>", head, text)


def goals() -> list[np.ndarray]:
    """Return places that the hand cannot reach without contact: below the floor, in the pole, in the post."""
    return [np.array(x) for x in ([0.3, 0.2, -0.3], [0.5, 0.45, 0.5], [0.6, 0.05, 0.45])]


@pytest.mark.parametrize("dt", [1e-3, 0.05, 0.2])
def test_pink_meets_no_boundary(dt: float) -> None:
    pink = pytest.importorskip("pink", reason="pin-pink is not installed: pip install 'pinbound[bridges]'")
    text, robot = arm(JOINTS)
    model = pin.buildModelFromXML(text, mimic=True)
    limit = our_pink.StepLimit(robot, model, velocity=3.0)
    view, smallest, infeasible = robot.on(model), np.inf, 0
    configuration = pink.Configuration(model, model.createData(), robot.to_pinocchio(model, robot.home))
    for goal in goals():
        task = pink.FrameTask("l5", position_cost=1.0, orientation_cost=0.0, gain=0.5)
        task.set_target(pin.SE3(np.eye(3), goal))
        for _ in range(25):
            before = configuration.q
            v = pink.solve_ik(configuration, [task], dt, "quadprog", damping=1e-6, limits=[limit], safety_break=False)
            infeasible += bool(limit.steps.last and limit.steps.last.blocked)
            for share in (0.25, 0.5, 0.75, 1.0):
                assert view.free(pin.integrate(model, before, share * v * dt))
            configuration.update(pin.integrate(model, before, v * dt))
            smallest = min(smallest, float(view.clearances(configuration.q).min()))
    assert infeasible == 0
    assert smallest < (0.1 if dt > 0.01 else 1.0), "the targets must lead near contact"


def test_pinks_barrier_has_the_rows_of_its_base_class_without_the_cache() -> None:
    pink = pytest.importorskip("pink", reason="pin-pink is not installed: pip install 'pinbound[bridges]'")
    text, robot = arm(JOINTS)
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), mimic=True)
    barrier, view = our_pink.BoundaryBarrier(robot, model, gain=2.0), robot.on(model)
    q = robot.to_pinocchio(model, robot.home)
    for turn in (0.0, 1e-7, 0.1):  # the second is the same q for the base class
        moved = robot.to_pinocchio(model, robot.home + turn)
        configuration = pink.Configuration(model, model.createData(), moved)
        G, h = barrier.compute_qp_inequalities(configuration, 0.01)
        assert np.array_equal(h, 2.0 * view.clearances(moved))
        assert np.array_equal(G, -view.gradients(moved) / 0.01)
    assert G.shape == (4, model.nv)
    few = our_pink.BoundaryBarrier(robot, model, boundaries=["pole"])
    assert few.compute_barrier(pink.Configuration(model, model.createData(), q)).shape == (1,)


def test_pink_stays_in_a_convex_region(minerva: pb.Robot) -> None:
    pink = pytest.importorskip("pink", reason="pin-pink is not installed: pip install 'pinbound[bridges]'")
    model = pin.buildModelFromXML(etree.tostring(minerva.document.root).decode(), mimic=True)
    region = pb.feasible_region(minerva, ("q2", "q3"))
    limit = our_pink.PolytopeLimit(minerva, model, region.inset(1e-3))
    configuration = pink.Configuration(model, model.createData(), minerva.to_pinocchio(model, minerva.home))
    task = pink.PostureTask(cost=1.0)
    task.set_target(minerva.to_pinocchio(model, np.array([0.0, -1.0, 2.0])))
    for _ in range(30):
        v = pink.solve_ik(configuration, [task], 0.1, "quadprog", damping=1e-9, limits=[limit], safety_break=False)
        configuration.update(pin.integrate(model, configuration.q, v * 0.1))
        assert region.contains(minerva.from_pinocchio(model, configuration.q))
    assert minerva.boundaries.signed_clearances(minerva.from_pinocchio(model, configuration.q)).min() < 2e-3


@pytest.mark.parametrize("dt", [1e-3, 0.1])
def test_mink_meets_no_boundary(dt: float) -> None:
    mink = pytest.importorskip("mink", reason="mink is not installed: pip install 'pinbound[bridges]'")
    mujoco = pytest.importorskip("mujoco")
    text, robot = arm(ARM)
    model = mujoco.MjModel.from_xml_string(with_masses(text))
    limit = our_mink.StepLimit(robot, model, velocity=dict.fromkeys(robot.coordinates, 3.0))
    view = our_mink.view_of(robot, model)
    configuration, smallest = mink.Configuration(model), np.inf
    for goal in goals():
        task = mink.FrameTask("l5", "body", position_cost=1.0, orientation_cost=0.0, gain=0.5)
        task.set_target(mink.SE3.from_translation(goal))
        for _ in range(25):
            v = mink.solve_ik(configuration, [task], dt, "quadprog", damping=1e-6, limits=[limit])
            configuration.integrate_inplace(v, dt)
            assert view.free(configuration.q)
            smallest = min(smallest, float(view.clearances(configuration.q).min()))
    assert smallest < (0.1 if dt > 0.01 else 1.0)


def test_another_mujoco_model_is_refused() -> None:
    mujoco = pytest.importorskip("mujoco", reason="mink is not installed: pip install 'pinbound[bridges]'")
    text, robot = arm(ARM)
    for found, other, said in (
        ('xyz="0.1 0 0.2"', 'xyz="0.1 0 0.21"', "places body 'l2' elsewhere"),
        ('joint name="e"', 'joint name="z"', "joint 'z' does not move"),
        ('joint name="e" type="revolute"', 'joint name="e" type="fixed"', "has no joint 'e'"),
    ):
        model = mujoco.MjModel.from_xml_string(with_masses(text.replace(found, other)))
        with pytest.raises(pb.DimensionError, match=said):
            our_mink.view_of(robot, model)


def test_a_region_that_holds_what_boundaries_need_is_refused() -> None:
    pytest.importorskip("pink", reason="pin-pink is not installed: pip install 'pinbound[bridges]'")
    text, robot = arm(JOINTS)
    some = pb.load(text, annotations=pb.Annotations.of(MARKS["spheres"], [pb.BoundaryMark("s", "p", "s")]))
    region = pb.feasible_region(some, ("a", "b"))
    model = pin.buildModelFromXML(text, mimic=True)
    with pytest.raises(pb.UnsupportedError, match="which the region of a, b holds"):
        our_pink.PolytopeLimit(some, model, region)
    with pytest.raises(pb.DimensionError, match="A has shape"):
        our_pink.PolytopeLimit(robot, model, np.eye(2), [1.0, 1.0])


def test_speeds_are_asked_for(minerva: pb.Robot) -> None:
    view = minerva.on(minerva.model)
    for given, said in (
        ({"q1": 1.0}, "has no entry for 'q2'"),
        ({"q9": 1.0}, "q9"),
        ([1.0, 0.0, 1.0], "velocity is"),
        (np.inf, "velocity is"),
    ):
        with pytest.raises(pb.PinboundError, match=said):
            SafeSteps(minerva, view, given)
    with pytest.raises(pb.DimensionError, match="dt is 0"):
        SafeSteps(minerva, view, 1.0).half_spaces(minerva.to_pinocchio(minerva.model, minerva.home), 0.0)


@pytest.mark.parametrize(("module", "needed"), [(our_pink, "pink"), (our_mink, "mink")])
def test_without_the_library_it_is_said_what_to_type(module: Any, needed: str, minerva: pb.Robot) -> None:
    if needed in sys.modules:
        pytest.skip(f"{needed} is installed")
    with pytest.raises(pb.UnsupportedError, match=r"pip install 'pinbound\[bridges\]'"):
        module.StepLimit(minerva, minerva.model, 1.0)
