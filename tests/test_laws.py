"""Laws that every boundary of every robot of the zoo must obey."""

from collections.abc import Callable

import numpy as np
import pytest
import sympy

import pinbound as pb
from robots import joint, oracle_vectors, random_q, robot_xml


def test_vectors_and_norms_equal_pinocchio_placements(any_robot: pb.Robot) -> None:
    Q = random_q(any_robot, 300, seed=1)
    expected = oracle_vectors(any_robot, Q)
    scale = np.linalg.norm(expected, axis=2).max()
    assert np.abs(any_robot.boundaries.vectors(Q) - expected).max() < 1e-14 * max(scale, 1.0) * 10
    assert np.abs(any_robot.boundaries.norms(Q) - np.linalg.norm(expected, axis=2)).max() < 1e-13 * max(scale, 1.0)


def test_gradients_equal_central_differences(any_robot: pb.Robot) -> None:
    Q, step = random_q(any_robot, 50, seed=2), 1e-6
    gradients = any_robot.boundaries.gradients(Q)
    for index in range(len(any_robot.coordinates)):
        h = step * np.eye(len(any_robot.coordinates))[index]
        difference = (any_robot.boundaries.norms(Q + h) - any_robot.boundaries.norms(Q - h)) / (2 * step)
        assert np.abs(gradients[:, :, index] - difference).max() < 1e-7


def test_hessians_equal_central_differences_and_are_symmetric(any_robot: pb.Robot) -> None:
    Q, step = random_q(any_robot, 80, seed=3), 1e-6
    Q = Q[any_robot.boundaries.norms(Q).min(axis=1) > 5e-3]  # differences are useless beside a kink
    assert len(Q) > 40
    hessians = any_robot.boundaries.hessians(Q)
    assert np.abs(hessians - np.swapaxes(hessians, 2, 3)).max() < 1e-12
    for index in range(len(any_robot.coordinates)):
        h = step * np.eye(len(any_robot.coordinates))[index]
        difference = (any_robot.boundaries.gradients(Q + h) - any_robot.boundaries.gradients(Q - h)) / (2 * step)
        assert np.abs(hessians[:, :, index] - difference).max() < 1e-5


def test_batch_equals_one_at_a_time(any_robot: pb.Robot) -> None:
    Q = random_q(any_robot, 7, seed=4)
    B = any_robot.boundaries
    for ask in (B.vectors, B.norms, B.clearances, B.gradients, B.hessians):
        assert np.allclose(ask(Q), np.stack([ask(q) for q in Q]), rtol=1e-12, atol=1e-14)
    for column, boundary in enumerate(B):
        assert np.allclose(B.norms(Q)[:, column], boundary.norm(Q), rtol=1e-12, atol=1e-14)
        assert np.array_equal(boundary.norm(Q), [boundary.norm(q) for q in Q])


def test_symbolic_equals_numeric(any_robot: pb.Robot) -> None:
    q = random_q(any_robot, 1, seed=5)[0]
    values = dict(zip(any_robot.coordinates, q, strict=True))
    for boundary in any_robot.boundaries:
        minimal, ancestor = boundary.expression(), boundary.expression("ancestor")
        point = {symbol: values[symbol.name] for symbol in minimal.free_symbols | ancestor.free_symbols}
        r = np.array(ancestor.evalf(30, subs=point), dtype=float).ravel()
        assert np.abs(r - boundary.vector(q)).max() < 1e-14
        assert abs(float(sympy.sqrt(minimal.dot(minimal)).evalf(30, subs=point)) - boundary.norm(q)) < 1e-14
        assert {symbol.name for symbol in minimal.free_symbols} == set(boundary.coordinates)


def test_a_norm_depends_on_its_coordinates_and_on_no_other(any_robot: pb.Robot) -> None:
    Q = random_q(any_robot, 20, seed=6)
    for boundary in any_robot.boundaries:
        for index, name in enumerate(any_robot.coordinates):
            moved = Q.copy()
            moved[:, index] += 0.7
            change = np.abs(boundary.norm(moved) - boundary.norm(Q)).max()
            assert (change > 1e-6) if name in boundary.coordinates else (change < 1e-13)


def test_clearance_is_zero_at_the_limits_and_has_the_promised_signs(any_robot: pb.Robot) -> None:
    checked = 0
    for boundary in any_robot.boundaries:
        wide = pb.Boundary(
            boundary.name,
            boundary.point_a,
            boundary.point_b,
            0.9 * float(np.median(boundary.norm(random_q(any_robot, 200, seed=7)))),
            boundary.path,
            boundary.robot_coordinates,
            boundary.contact_tolerance,
        )
        for q in random_q(any_robot, 20, seed=8):
            for index, name in enumerate(any_robot.coordinates):
                try:
                    arcs = wide.limits(name, q)
                except pb.UnsupportedError:
                    continue
                for end, inwards in ((arcs.intervals[:, 0], 1.0), (arcs.intervals[:, 1], -1.0)):
                    for value in end[np.isfinite(end)]:
                        there = q.copy()
                        there[index] = value
                        assert abs(wide.clearance(there)) < 1e-12
                        there[index] = value + 1e-5 * inwards
                        assert wide.clearance(there) > 0
                        there[index] = value - 1e-5 * inwards
                        assert wide.clearance(there) < 0
                        checked += 1
    assert checked > 40


def test_non_finite_rows_give_nan_and_never_a_clearance(any_robot: pb.Robot) -> None:
    Q = np.repeat(any_robot.home[None], 3, axis=0)
    Q[1], Q[2] = np.nan, np.inf
    clearances = any_robot.boundaries.clearances(Q)
    assert np.all(np.isfinite(clearances[0]))
    assert not np.any(clearances[1:] > -np.inf)


def test_input_is_never_written(any_robot: pb.Robot) -> None:
    Q = random_q(any_robot, 5, seed=9)
    Q.flags.writeable = False
    any_robot.boundaries.hessians(Q)
    any_robot.closure_residuals(Q)


@pytest.mark.parametrize("wrong", [[0.0], [[0.0]], "abc", [[[0.0, 0.0, 0.0]]], [0.0, 1j, 0.0]])
def test_a_wrong_shape_says_what_is_right(minerva: pb.Robot, wrong: object) -> None:
    with pytest.raises(pb.DimensionError, match=r"q1, q2, q3|not an array of numbers|complex"):
        minerva.boundaries.norms(wrong)


def test_gradients_are_nan_where_the_norm_is_zero(load_text: Callable[..., pb.Robot]) -> None:
    """Two prismatic axes reach the point exactly: the norm has a kink there, and no gradient is made up."""
    robot = load_text(
        robot_xml(
            [joint("x", "prismatic", "base", "a", axis="1 0 0")],
            {"p": ("base", "1 0 0"), "s": ("a", "0 0 0")},
            [("p", "s")],
        )
    )
    assert robot.boundaries.norms([1.0])[0] == 0.0
    assert np.isnan(robot.boundaries.gradients([1.0])).all()
    assert np.isnan(robot.boundaries.hessians([1.0])).all()
    assert robot.boundaries.gradients([1.5])[0] == 1.0
