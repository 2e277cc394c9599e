"""Inverse kinematics: Pinocchio's Jacobian through the coupling, reached targets, limits, honest failure."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import pinbound as pb
from pinbound.evaluate import numeric
from pinbound.motion.inverse_kinematics import Ending, _Solver, solve_ik
from pinbound.path.chain import Chain
from pinbound.path.relative import absolute_chain
from robots import joint, random_q, robot_xml


def test_jacobian_is_pinocchios_through_the_coupling(any_robot: pb.Robot) -> None:
    """J = J_tree S, for every link, an eccentric point."""
    model, xyz = any_robot.model, np.array([0.03, -0.02, 0.05])
    data = model.createData()
    for link in any_robot.tree.links:
        chain = absolute_chain(any_robot.tree, any_robot.coupling, link, tuple(xyz))
        frame = model.getFrameId(link)
        for q in random_q(any_robot, 5, seed=3):
            theta = any_robot.coupling.expand(q)
            tree = pin.computeFrameJacobian(model, data, theta, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            arm = data.oMf[frame].rotation @ xyz
            J_point = tree[:3] - pin.skew(arm) @ tree[3:]
            expected = J_point @ any_robot.coupling.S
            assert numeric.derivative(chain, q[None])[0] == pytest.approx(expected, abs=1e-13)


def test_every_reachable_target_is_reached(minerva: pb.Robot) -> None:
    rng = np.random.default_rng(1)
    Q = rng.uniform([-2.3, -0.3, -0.3], [2.3, 1.3, 1.2], (200, 3))
    targets = minerva.positions("link_6", Q)
    found = solve_ik(minerva, "link_6", targets)
    assert found.reached.all()
    assert np.linalg.norm(minerva.positions("link_6", found.q) - targets, axis=1).max() < 1e-10
    assert np.all(found.q >= minerva.lower - 1e-12)
    assert np.all(found.q <= minerva.upper + 1e-12)
    assert found.text() == "200 of 200 targets reached"


def test_a_path_stays_on_its_branch(minerva: pb.Robot) -> None:
    s = np.linspace(0, 1, 100)[:, None]
    Q = (1 - s) * np.array([-1.0, 0.1, 0.1]) + s * np.array([1.0, 1.1, 0.6])
    found = solve_ik(minerva, "link_6", minerva.positions("link_6", Q), start=Q[0], restarts=0)
    assert np.abs(found.q - Q).max() < 1e-8
    assert not found.restarts.any()


def test_out_of_reach_ends_at_the_nearest_place(minerva: pb.Robot) -> None:
    """Far away in the plane of the arm the nearest tool point has arm and forearm straight towards the target."""
    found = solve_ik(minerva, "link_6", [2.0, 0.0, 0.3])
    assert found.endings == (Ending.OUT_OF_REACH,)
    assert not found.reached[0]
    wrist = np.array([2.0 - 0.03546, 0.3 + 0.02771 - 0.0385 - 0.072])
    nearest = np.linalg.norm(wrist) - (0.1 + np.hypot(0.09397, 0.0342))
    assert found.residuals[0] == pytest.approx(nearest, rel=1e-6)
    assert "no nearer configuration" in found.text()
    assert found.residuals[0] == pytest.approx(
        np.linalg.norm(minerva.positions("link_6", found.q[0]) - [2.0, 0.0, 0.3]), rel=1e-12
    )


def test_a_limit_that_holds_is_named(load_text: Callable[..., pb.Robot]) -> None:
    """One joint; its target lies beyond its limit. The nearest place is the limit."""
    arm = joint("q1", "revolute", "base", "a", axis="0 0 1", limit="-0.5 0.5")
    robot = load_text(robot_xml([arm, joint("x", "fixed", "a", "tip", xyz="1 0 0")], {}, []))
    found = solve_ik(robot, "tip", [np.cos(0.8), np.sin(0.8), 0.0])
    assert found.endings == (Ending.HELD_BY_LIMITS,)
    assert found.limits == (("q1",),)
    assert found.q[0, 0] == pytest.approx(0.5, abs=1e-12)


def test_a_followers_limit_binds(load_text: Callable[..., pb.Robot]) -> None:
    """The follower turns twice as far and stops at 0.6: q1 ends at 0.3, inside its own limit."""
    robot = load_text(
        robot_xml(
            [
                joint("q1", "revolute", "base", "a", axis="0 0 1", limit="-1 1"),
                joint("tip", "fixed", "a", "end", xyz="1 0 0"),
                joint("z_follow", "revolute", "base", "b", axis="0 0 1", limit="-0.6 0.6", mimic="q1 2 0"),
            ],
            {},
            [],
        )
    )
    found = solve_ik(robot, "end", [np.cos(0.8), np.sin(0.8), 0.0])
    assert found.limits == (("z_follow",),)
    assert found.q[0, 0] == pytest.approx(0.3, abs=1e-12)


def test_sliding_along_a_limit(minerva: pb.Robot) -> None:
    """q1 stands at its limit; q2 and q3 still go to where the residual is smallest in that plane."""
    azimuth = float(minerva.upper[0]) + 0.3
    inside = minerva.positions("link_6", [0.0, 0.6, 0.4])
    target = np.array([inside[0] * np.cos(azimuth), inside[0] * np.sin(azimuth), inside[2]])
    start = np.array([minerva.upper[0], 0.6, 0.4])
    found = solve_ik(minerva, "link_6", target, start=start, restarts=0)
    assert found.endings == (Ending.HELD_BY_LIMITS,)
    assert found.limits == (("q1",),)
    tool = minerva.positions("link_6", found.q[0])
    assert np.hypot(tool[0], tool[1]) == pytest.approx(inside[0] * np.cos(0.3), abs=1e-6)
    assert tool[2] == pytest.approx(target[2], abs=1e-6)


def test_limits_said_of_several_coordinates() -> None:
    """Rows `q1 + q2 <= 0.4` and `q1 - q2 <= 0.1` at once: every step stays inside, the nearest place is found."""
    chain = Chain(
        np.array([[0.0, 0, 0], [0.3, 0, 0], [0.2, 0, 0]]),
        np.zeros((3, 3, 2)),
        np.array([[0.0, 0, 1], [0.0, 0, 1]]),
        np.eye(2),
        0.5,
    )
    A, b = np.array([[1.0, 1.0], [1.0, -1.0]]), np.array([0.4, 0.1])
    solver = _Solver(chain, A, b, ("sum", "difference"), 200, 1e-10)
    goal = np.array([0.1, 0.45, 0.0])
    answer = solver.solve(np.zeros(2), goal)
    assert np.all(A @ answer.q <= b + 1e-12)
    grid = np.stack(np.meshgrid(np.linspace(-3, 3, 601), np.linspace(-3, 3, 601)), axis=-1).reshape(-1, 2)
    allowed = grid[np.all(grid @ A.T <= b, axis=1)]
    best = np.linalg.norm(numeric.positions(chain, allowed) - goal, axis=1)
    near = np.abs(allowed - answer.q).max(axis=1) < 0.3
    assert answer.residual <= best[near].min() + 1e-9
    assert answer.ending is Ending.HELD_BY_LIMITS
    assert answer.limits


def test_spatial_robot_with_slides_and_followers(any_robot: pb.Robot) -> None:
    rng = np.random.default_rng(12)
    lower, upper = np.maximum(any_robot.lower, -1.5), np.minimum(any_robot.upper, 1.5)
    tips = sorted(any_robot.tree.links)
    Q = rng.uniform(lower, upper, (10, len(lower)))
    A = np.array([limit.coefficients for limit in any_robot.linear_limits])
    ends = np.array([(one.lower - one.offset, one.upper - one.offset) for one in any_robot.linear_limits])
    Q = Q[np.all((Q @ A.T >= ends[:, 0]) & (Q @ A.T <= ends[:, 1]), axis=1)]
    for link in tips:
        found = solve_ik(any_robot, link, any_robot.positions(link, Q, (0.05, 0, 0.02)), xyz=(0.05, 0, 0.02))
        theta = found.q @ A.T
        assert np.all(theta >= ends[:, 0] - 1e-9)
        assert np.all(theta <= ends[:, 1] + 1e-9)
        assert found.reached.all()


def test_bad_input(minerva: pb.Robot) -> None:
    with pytest.raises(pb.UnknownNameError, match="link_6"):
        solve_ik(minerva, "link_7", [0, 0, 0])
    with pytest.raises(pb.DimensionError, match="targets have shape"):
        solve_ik(minerva, "link_6", [[0, 0]])
    with pytest.raises(pb.DimensionError, match="within all joint limits"):
        solve_ik(minerva, "link_6", [0, 0, 0], start=[9.0, 0, 0])
    with pytest.raises(pb.DimensionError, match="within all joint limits"):
        solve_ik(minerva, "link_6", [0, 0, 0], start=[np.nan, 0, 0])
    found = solve_ik(minerva, "link_6", [np.nan, 0, 0])
    assert found.endings == (Ending.NO_TARGET,)
    assert solve_ik(minerva, "link_6", np.empty((0, 3))).q.shape == (0, 3)
