"""The rounding bound against 50 digits: whatever a robot's numbers are, the true value lies within it."""

from fractions import Fraction
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

import pinbound as pb
from oracles import DIGITS, JointData, Machine, random_machine
from pinbound.bounds.bounds import bundle
from pinbound.bounds.rounding import rounding_bound, walks


def marked(rng: np.random.Generator, machine: Machine, pairs: int) -> Machine:
    """Mark points on random links, with thresholds that home keeps; home is zero."""
    machine.tolerance = 0.0
    sizes = [abs(v) for joint in machine.joints for v in joint.xyz]
    length = max([*sizes, 1e-4])
    for index in range(pairs):
        links = rng.choice(len(machine.joints) + 1, 2, replace=False)
        for side, link in zip("ab", links, strict=True):
            xyz = tuple(map(float, rng.normal(0, length, 3)))
            machine.marks[f"{side}{index}"] = (int(link), "point", {"xyz": xyz})
        home = [0.0] * len(machine.active)
        least = float(machine.exact_distance(home, f"a{index}", f"b{index}"))
        if least > 0.0:
            machine.boundaries.append((f"a{index}", f"b{index}", 0.25 * least))
    return machine


def configurations(rng: np.random.Generator, machine: Machine, wild: bool) -> list[list[float]]:
    n = len(machine.active)
    sizes = [0.5, 3.0, 100.0] + ([1e6, 1e8] if wild else [])
    return [list(map(float, rng.normal(0, size, n))) for size in sizes]


@pytest.mark.parametrize("wild", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_certificates_of_single_configurations_hold_the_true_clearance(tmp_path: Path, seed: int, wild: bool) -> None:
    rng = np.random.default_rng(100 * seed + wild)
    looked = 0
    for _ in range(12):
        machine = marked(rng, random_machine(rng, int(rng.integers(2, 9)), wild), 3)
        if not machine.active or not machine.boundaries:
            continue
        robot = machine.load(tmp_path)
        for q in configurations(rng, machine, wild):
            found = pb.certify(robot, [q], limits=False, each=True)
            for (a, b, distance), finding in zip(machine.boundaries, found.boundaries, strict=True):
                with mp.workdps(DIGITS):
                    true = machine.exact_distance(q, a, b) - mp.mpf(distance)
                    assert mp.mpf(finding.lower) <= true <= mp.mpf(finding.upper)
                looked += 1
    assert looked > 50


@pytest.mark.parametrize("seed", range(3))
def test_true_values_lie_within_error_of_computed_ones(tmp_path: Path, seed: int) -> None:
    """Sharper than certificates: the bound itself, and it is no mere infinity for robots of ordinary size."""
    rng = np.random.default_rng(seed)
    for wild in (True, False):
        for _ in range(8):
            machine = marked(rng, random_machine(rng, int(rng.integers(2, 10)), wild), 3)
            if not machine.active or not machine.boundaries:
                continue
            robot = machine.load(tmp_path)
            chains = bundle([boundary.path.minimal for boundary in robot.boundaries], len(robot.coordinates))
            ends = [(b.ancestor, b.point_a.link, b.point_b.link) for b in robot.boundaries]
            walked = walks(robot.tree, robot.coupling, ends)
            for q in configurations(rng, machine, wild):
                error = rounding_bound(chains, walked, np.array(q), np.array(q))
                for row, (a, b, _) in enumerate(machine.boundaries):
                    with mp.workdps(DIGITS):
                        true = machine.exact_distance(q, a, b)
                        assert abs(true - mp.mpf(float(robot.boundaries[row].norm(q)))) <= mp.mpf(error[row])
                if not wild and np.abs(q).max() < 10.0:
                    assert error.max() < 1e-10


def follower(off1: float, off2: float, distance: float, limit: float = 10.0) -> Machine:
    """Return a joint that follows a follower, whose offsets cancel but for the digits of 0.1."""
    joints = [
        JointData("continuous", 0),
        JointData("continuous", 0, mimic=(0, 1.0, off1)),
        JointData("revolute", 1, (0.5, 0.0, 0.0), mimic=(1, 0.1, off2), limits=(-1.0, limit)),
    ]
    marks = {"a": (3, "point", {"xyz": (1.3, 0.2, 0.0)}), "b": (0, "point", {"xyz": (0.2, -1.9, 0.0)})}
    return Machine(joints, marks, [("a", "b", distance)], {0: 1.5}, tolerance=0.0)


@pytest.mark.parametrize(("off1", "off2"), [(1e6, -1e5), (1e8, -1e7), (1e12, -1e11)])
def test_offsets_that_cancel_are_exact(tmp_path: Path, off1: float, off2: float) -> None:
    robot = follower(off1, off2, 0.1).load(tmp_path)
    true = Fraction(0.1) * Fraction(off1) + Fraction(off2)
    assert robot.coupling.row("j2")[1] == float(true) != 0.0
    for q in (-2.2, -3.0):
        machine = follower(off1, off2, 0.1)
        clearance = machine.exact_distance([q], "a", "b")
        for side in (-0.2, 0.2):
            with mp.workdps(DIGITS):
                distance = float(clearance + side * mp.mpf(float(true)))
                machine = follower(off1, off2, distance)
                left = clearance - mp.mpf(distance)
            found = pb.certify(machine.load(tmp_path), [[q]], limits=False)
            assert found.verdict is not (pb.Verdict.CERTIFIED if left < 0 else pb.Verdict.VIOLATED)
            with mp.workdps(DIGITS):
                assert mp.mpf(found.lower) <= left <= mp.mpf(found.upper)


def test_limits_of_followers_carry_their_offsets(tmp_path: Path) -> None:
    """Limit and offset of 1e6 cancel, their rounding does not: within it nothing is certified beyond the limit."""
    rng = np.random.default_rng(5)
    verdicts = set()
    for _ in range(60):
        one, two = float(rng.choice([0.1, 0.3, -1.7])), float(rng.choice([0.7, -0.9, 3e-3]))
        first, second = (float(rng.choice([-1, 1]) * 10 ** rng.uniform(0, 9)) for _ in range(2))
        offset = Fraction(two) * Fraction(first) + Fraction(second)
        middle = float(offset) + float(rng.normal())
        joints = [
            JointData("continuous", 0),
            JointData("continuous", 0, mimic=(0, one, first)),
            JointData("revolute", 0, mimic=(1, two, second), limits=(middle - 3.0, middle)),
        ]
        robot = Machine(joints).load(tmp_path)
        multiplier = Fraction(one) * Fraction(two)
        q = float((Fraction(middle) - offset) / multiplier)
        for value in (q, np.nextafter(q, 1e9), q + 1e-11, q - 1e-11, q + 1e-7, q - 1e-7, q + 1e-3, q - 1e-3):
            margin = Fraction(middle) - (multiplier * Fraction(float(value)) + offset)
            found = pb.certify(robot, [[value]], limits_only=True)
            verdicts.add(found.verdict)
            if found.verdict is pb.Verdict.CERTIFIED:
                assert margin >= -Fraction(1e-12)
            if found.verdict is pb.Verdict.VIOLATED:
                assert margin < -Fraction(1e-12)
            upper = found.limits[0]
            assert upper.name == "j2 upper"
            assert Fraction(upper.lower) <= margin <= Fraction(upper.upper)
    assert verdicts >= {pb.Verdict.CERTIFIED, pb.Verdict.VIOLATED}


def test_slides_of_tiny_multipliers_are_in_the_bound(tmp_path: Path) -> None:
    """A short robot, and a slide that follows at 9e-15 a unit: reduction takes it for nothing, the bound does not."""
    for multiplier in (9e-15, 1e-14, 1.1e-14, 3e-14):
        joints = [
            JointData("continuous", 0, axis=(0.0, 0.0, 1.0)),
            JointData("prismatic", 1, axis=(1.0, 0.0, 0.0), mimic=(0, multiplier, 0.0)),
        ]
        machine = Machine(joints, tolerance=0.0)
        machine.marks = {"a": (2, "point", {"xyz": (0.0, 0.0, 0.0)}), "b": (0, "point", {"xyz": (0.0, 5e-4, 0.0)})}
        machine.boundaries = [("a", "b", 1e-5)]
        robot = machine.load(tmp_path)
        for q in (1.0, 3.0, 1e3, 1e6):
            found = pb.certify(robot, [[q]], limits=False, each=True)
            with mp.workdps(DIGITS):
                true = machine.exact_distance([q], "a", "b") - mp.mpf(1e-5)
                assert mp.mpf(found.lower) <= true <= mp.mpf(found.upper)


def test_long_slides(tmp_path: Path) -> None:
    """A gantry of a thousand kilometres whose slides cancel: the error is that of the way there and back."""
    joints = [
        JointData("prismatic", 0, axis=(1.0, 0.0, 0.0)),
        JointData("prismatic", 1, (0.1, 0.2, 0.3), (0.1, 0.2, 0.3), axis=(1.0, 0.0, 0.0)),
        JointData("prismatic", 2, rpy=(0.3, -0.2, 0.1), axis=(0.6, 0.0, 0.8), mimic=(0, -0.999, 12345.678)),
    ]
    machine = Machine(joints, tolerance=0.0)
    machine.marks = {"a": (3, "point", {"xyz": (0.1, 0.0, 0.0)}), "b": (0, "point", {"xyz": (0.0, 0.1, 0.0)})}
    machine.boundaries = [("a", "b", 0.01)]
    robot = machine.load(tmp_path)
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = rng.normal(0, 1e6, 2)
        found = pb.certify(robot, [q], limits=False, each=True)
        with mp.workdps(DIGITS):
            true = machine.exact_distance(list(map(float, q)), "a", "b") - mp.mpf(0.01)
            assert mp.mpf(found.lower) <= true <= mp.mpf(found.upper)


def test_multipliers_that_cancel_are_counted_as_they_are(tmp_path: Path) -> None:
    joints = [
        JointData("continuous", 0),
        JointData("continuous", 1, mimic=(0, 1e6 / 3.0, 0.0)),
        JointData("continuous", 2, mimic=(0, -1e6 / 3.0 + 0.1, 0.0)),
    ]
    machine = Machine(joints, tolerance=0.0)
    machine.marks = {"a": (3, "point", {"xyz": (1.0, 0.0, 0.0)}), "b": (0, "point", {"xyz": (0.0, 1.5, 0.0)})}
    machine.boundaries = [("a", "b", 0.01)]
    robot = machine.load(tmp_path)
    ends = [(b.ancestor, b.point_a.link, b.point_b.link) for b in robot.boundaries]
    walked = walks(robot.tree, robot.coupling, ends)
    assert walked.turning[0, 0] == pytest.approx(2e6 / 3.0, rel=1e-5)
    for q in (0.3, 1.0, 2.0, 50.0):
        found = pb.certify(robot, [[q]], limits=False, each=True)
        with mp.workdps(DIGITS):
            true = machine.exact_distance([q], "a", "b") - mp.mpf(0.01)
            assert mp.mpf(found.lower) <= true <= mp.mpf(found.upper)
        assert found.upper - found.lower > 1e-12 * abs(q)


def test_a_chain_of_followers_that_overflows_is_refused(tmp_path: Path) -> None:
    joints = [JointData("continuous", 0)]
    joints += [JointData("continuous", i, mimic=(i - 1, 1e200, 0.0)) for i in range(1, 4)]
    with pytest.raises(pb.UnsupportedError, match="overflow float64"):
        Machine(joints).load(tmp_path)
