"""Attack on limits: random robots with every kind of mark, against kinematics and distances of this file alone.

    python -m benchmarks.attack_limits --trials 200 --seed 0

A trial makes a robot (joints that turn, slide, follow by any multiplier, huge limits), two or three boundaries between
points, segments, boxes, prisms, lines and planes, some of them face to face, parallel or along an axis, and asks for
the limits of each coordinate. The oracle places marks by NumPy alone and finds distances by an active set
(`scipy.optimize.lsq_linear`, BVLS); it knows nothing of pinbound's chains. Asked is:

- no sample within the limits may be in contact, and a stop must be a contact that the next step beyond enters;
- a value is blocked if, and only if, its own clearance or a joint limit says so;
- `limits_table` says the same as `limits`, and `Boundary.limits` of each sample what its clearance says;
- windows that are reversed, not a number, or do not hold the value are refused.

`attack_limits(rng)` returns "held", "refused: ..." or "WRONG: ..."; the exit code is 1 if anything is wrong.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

import pinbound as pb

TIGHT = 2e-9  # of the robot's length: what the oracle and rounding may be apart
RADII = (1e-3, 0.01, 0.05)
MULTIPLIERS = (-3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 7.0)


@dataclasses.dataclass(frozen=True)
class Joint:
    """One joint of a chain; a follower has a primary."""

    kind: str
    xyz: Any
    rotation: Any
    axis: Any
    lower: float
    upper: float
    primary: int | None = None
    multiplier: float = 1.0
    offset: float = 0.0


@dataclasses.dataclass(frozen=True)
class Shape:
    """A mark: a point and its ways, or a line, or a plane, on link number `link` (0 is the base)."""

    kind: str
    link: int
    xyz: Any
    ways: Any
    radius: float = 0.0


def turned(axis: Any, angle: float) -> Any:
    """Return the rotation about a unit axis."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def random_rotation(rng: np.random.Generator) -> Any:
    """Return a rotation: the identity, a quarter turn, or any."""
    kind = rng.integers(3)
    if kind == 0:
        return np.eye(3)
    axis = np.eye(3)[rng.integers(3)] if kind == 1 else rng.normal(size=3)
    return turned(axis / np.linalg.norm(axis), np.pi / 2 if kind == 1 else float(rng.uniform(-3, 3)))


def random_axis(rng: np.random.Generator) -> Any:
    """Return a unit axis, most often that of a coordinate."""
    axis = np.eye(3)[rng.integers(3)] if rng.random() < 0.7 else rng.normal(size=3)
    return axis / np.linalg.norm(axis)


def random_joints(rng: np.random.Generator) -> list[Joint]:
    """Return a chain of one to four joints."""
    joints: list[Joint] = []
    for number in range(int(rng.integers(1, 5))):
        kind = "revolute" if rng.random() < 0.6 else "prismatic"
        wide = (
            float(rng.choice([2.0, 3.0, 10.0, 1e3, 1e7])) if kind == "prismatic" else float(rng.choice([2.0, 3.1, 9.0]))
        )
        active = [i for i, one in enumerate(joints) if one.primary is None]
        follows = bool(active) and rng.random() < 0.25
        joints.append(
            Joint(
                kind,
                rng.choice([0.0, 0.3, 0.5], 3) if rng.random() < 0.5 else rng.uniform(-0.5, 0.5, 3),
                random_rotation(rng),
                random_axis(rng),
                -wide,
                wide,
                int(rng.choice(active)) if follows else None,
                float(rng.choice(MULTIPLIERS)) if follows else 1.0,
                float(rng.choice([0.0, 0.3])) if follows else 0.0,
            )
        )
        assert number < 4
    return joints


def random_shape(rng: np.random.Generator, link: int, flat: bool) -> Shape:
    """Return a mark of any kind on a link."""
    xyz = rng.uniform(-0.5, 0.5, 3)
    frame = random_rotation(rng)
    radius = float(rng.choice(RADII))
    if flat:
        kind = str(rng.choice(["line", "plane"]))
        return Shape(kind, link, xyz * 2, frame[:, :1].T, radius if kind == "line" else 0.0)
    kind = str(rng.choice(["point", "segment", "rectangle", "box", "prism"]))
    count = {"point": 0, "segment": 1, "rectangle": 2, "box": 3, "prism": 4}[kind]
    ways = (frame * rng.uniform(0.1, 0.8, 3)).T[:count]
    if kind == "prism":
        ways = np.vstack(((frame * rng.uniform(0.1, 0.8, 3)).T, frame[:, 0] * 0.2 + frame[:, 1] * 0.3))
    return Shape(kind, link, xyz, ways.reshape(-1, 3), radius)


def text(values: Any) -> str:
    """Return numbers with all their digits."""
    return " ".join(repr(float(v)) for v in np.ravel(values))


def angles_of(R: Any) -> Any:
    """Return roll, pitch and yaw of a rotation."""
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    if np.hypot(R[0, 0], R[1, 0]) < 1e-9:
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def rotation_of(rpy: Any) -> Any:
    """Return the rotation of roll, pitch and yaw, as a URDF means it."""
    r, p, y = rpy
    ex, ey, ez = np.eye(3)
    return turned(ez, y) @ turned(ey, p) @ turned(ex, r)


class Oracle:
    """Kinematics and distances of a chain of joints, by NumPy and an active set."""

    def __init__(self, joints: list[Joint], pairs: list[tuple[Shape, Shape, float]]) -> None:
        """Hold a robot; angles go through the URDF's own roll, pitch, yaw."""
        self.joints, self.pairs = joints, pairs
        self.rpy = [angles_of(one.rotation) for one in joints]
        self.rotations = [rotation_of(rpy) for rpy in self.rpy]
        self.active = [i for i, one in enumerate(joints) if one.primary is None]
        self.names = [f"j{i}" for i in self.active]

    def theta(self, q: Any) -> Any:
        """Return every joint's value."""
        values = np.zeros(len(self.joints))
        values[self.active] = q
        for i, one in enumerate(self.joints):
            if one.primary is not None:
                values[i] = one.multiplier * values[one.primary] + one.offset
        return values

    def placements(self, q: Any) -> list[tuple[Any, Any]]:
        """Return rotation and position of every link, the base first."""
        R, p = np.eye(3), np.zeros(3)
        found = [(R, p)]
        for one, rotation, value in zip(self.joints, self.rotations, self.theta(q), strict=True):
            p, R = p + R @ one.xyz, R @ rotation
            if one.kind == "revolute":
                R = R @ turned(one.axis, value)
            else:
                p = p + R @ one.axis * value
            found.append((R, p))
        return found

    def clearance(self, k: int, q: Any) -> float:
        """Return the clearance of pair k at q [m]."""
        a, b, more = self.pairs[k]
        links = self.placements(q)
        placed = [(links[s.link][1] + links[s.link][0] @ s.xyz, s.ways @ links[s.link][0].T) for s in (a, b)]
        threshold = a.radius + b.radius + more
        flat = next((i for i, s in enumerate((a, b)) if s.kind in ("line", "plane")), None)
        if flat is not None:
            (foot, direction), (w, ways) = placed[flat], placed[1 - flat]
            unit = direction[0]
            if (a, b)[flat].kind == "plane":
                return float((w - foot) @ unit + np.minimum(ways @ unit, 0.0).sum()) - threshold
            across = np.eye(3) - np.outer(unit, unit)
            return nearest(across @ (w - foot), ways @ across) - threshold
        (w_a, ways_a), (w_b, ways_b) = placed
        return nearest(w_a - w_b, np.vstack((ways_a, -ways_b))) - threshold

    def size(self, q: Any) -> float:
        """Return a length that all positions stay within [m]."""
        return 5.0 + float(np.abs(np.concatenate([p for _, p in self.placements(q)])).max())

    def is_within(self, q: Any, tolerance: float) -> bool:
        """Return whether all joints are within their limits."""
        values = self.theta(q)
        scale = tolerance * np.maximum(1.0, np.abs(values))
        lower, upper = (np.array([getattr(one, end) for one in self.joints]) for end in ("lower", "upper"))
        return bool(np.all((values >= lower - scale) & (values <= upper + scale)))

    def urdf(self, home: Any) -> str:
        """Return the robot as a URDF."""
        parts = ['<robot name="r" xmlns:pinbound="urn:pinbound:1"><link name="l0"/>']
        for i, one in enumerate(self.joints):
            mimic = ""
            if one.primary is not None:
                mimic = f'<mimic joint="j{one.primary}" multiplier="{one.multiplier!r}" offset="{one.offset!r}"/>'
            parts.append(
                f'<link name="l{i + 1}"/><joint name="j{i}" type="{one.kind}"><parent link="l{i}"/>'
                f'<child link="l{i + 1}"/><origin xyz="{text(one.xyz)}" rpy="{text(self.rpy[i])}"/>'
                f'<axis xyz="{text(one.axis)}"/>{mimic}'
                f'<limit lower="{one.lower!r}" upper="{one.upper!r}" effort="1" velocity="1"/></joint>'
            )
        places = " ".join(f'{name}="{value!r}"' for name, value in zip(self.names, home.tolist(), strict=True))
        marks = [f"<pinbound:home {places}/>"]
        for k, (a, b, more) in enumerate(self.pairs):
            marks += [mark_text(f"m{k}{side}", shape) for side, shape in zip("ab", (a, b), strict=True)]
            marks.append(f'<pinbound:boundary name="b{k}" a="m{k}a" b="m{k}b" min_distance="{more!r}"/>')
        return "".join([*parts, "<pinbound:annotations>", *marks, "</pinbound:annotations></robot>"])


def mark_text(name: str, shape: Shape) -> str:
    """Return a mark as an annotation."""
    where = f'name="{name}" link="l{shape.link}" xyz="{text(shape.xyz)}"'
    if shape.kind == "plane":
        return f'<pinbound:plane {where} normal="{text(shape.ways[0])}"/>'
    thick = f'radius="{shape.radius!r}"'
    if shape.kind == "line":
        return f'<pinbound:line {where} direction="{text(shape.ways[0])}" {thick}/>'
    if not len(shape.ways):
        return f"<pinbound:point {where} {thick}/>"
    return f'<pinbound:sweep {where} ways="{text(shape.ways)}" {thick}/>'


def nearest(w: Any, ways: Any) -> float:
    """Return the least length of `w + sum_i t_i e_i`, t in [0, 1], by an active set."""
    ways = ways[np.linalg.norm(ways, axis=1) > 0.0]
    if not len(ways):
        return float(np.linalg.norm(w))
    found = lsq_linear(ways.T, -w, (0.0, 1.0), method="bvls", tol=1e-15)
    return float(np.linalg.norm(w + np.clip(found.x, 0.0, 1.0) @ ways))


def random_case(rng: np.random.Generator) -> tuple[Oracle, Any, pb.Robot] | None:
    """Return a robot with its oracle and a free home, or None if none was found."""
    joints = random_joints(rng)
    pairs: list[tuple[Shape, Shape, float]] = []
    for _ in range(int(rng.integers(1, 3))):
        low, high = sorted(rng.choice(len(joints) + 1, 2, replace=False).tolist())
        flat = rng.random() < 0.3
        a, b = random_shape(rng, low, flat), random_shape(rng, high, False)
        pairs.append((a, b, float(rng.choice([0.0, 0.02]))) if rng.random() < 0.5 else (b, a, 0.0))
    oracle = Oracle(joints, pairs)
    spread = np.array([min(joints[i].upper, 3.0) for i in oracle.active])
    for _ in range(20):
        home = rng.uniform(-spread, spread)
        free = all(oracle.clearance(k, home) > 1e-3 for k in range(len(pairs)))
        if free and oracle.is_within(home, 0.0):
            break
    else:
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.urdf"
        path.write_text(oracle.urdf(home))
        return oracle, home, pb.load(path)


def attack_limits(rng: np.random.Generator) -> str:
    """Return "held", "refused: why", "none" (no free home was found) or "WRONG: what"."""
    made = random_case(rng)
    if made is None:
        return "none"
    oracle, home, robot = made
    spread = np.array([min(one.upper, 3.0) for one in (oracle.joints[i] for i in oracle.active)])
    Q = np.vstack((home, rng.uniform(-spread, spread, (2, len(home)))))
    for j, name in enumerate(oracle.names):
        try:
            found = [robot.boundaries.limits(name, q) for q in Q]
            table, stops = robot.boundaries.limits_table(name, Q)
        except pb.UnsupportedError as error:
            return f"refused: {str(error)[:60]}"
        for q, one, ends, stop in zip(Q, found, table, stops, strict=True):
            fault = _checked(oracle, q, j, one, rng) or _same(one, ends, stop)
            if fault:
                return f"WRONG: {name} at {q.tolist()}: {fault}\n{oracle.urdf(home)}"
        fault = _arcs(oracle, robot, Q[0], j, rng) or _windows(robot, name, Q[0])
        if fault:
            return f"WRONG: {name} at {Q[0].tolist()}: {fault}\n{oracle.urdf(home)}"
    return "held"


def _at(q: Any, j: int, value: float) -> Any:
    there = q.copy()
    there[j] = value
    return there


def _checked(oracle: Oracle, q: Any, j: int, found: Any, rng: np.random.Generator) -> str:
    """Compare limits with the oracle."""
    count, tight = len(oracle.pairs), TIGHT * oracle.size(q)
    here = [oracle.clearance(k, q) for k in range(count)]
    within = oracle.is_within(q, 1e-12)
    if found.blocked_by:
        sure = within and min(here) > tight
        return f"blocked by {found.blocked_by}, but clearances are {here}" if sure else ""
    if not oracle.is_within(q, 1e-9) or min(here) < -tight:
        return f"not blocked, but clearances are {here}"
    low, high = found.lower, found.upper
    reach = min(high - low, 50.0)
    start, stop = max(low, q[j] - reach), min(high, q[j] + reach)
    samples = np.concatenate(
        (
            rng.uniform(start, stop, 60),
            *(end + side * (stop - start) * 10.0 ** -np.arange(1.0, 9.0) for end, side in ((start, 1.0), (stop, -1.0))),
        )
    )
    for x in samples[(samples > low) & (samples < high)]:
        there = _at(q, j, float(x))
        worst = min(oracle.clearance(k, there) for k in range(count))
        if worst < -TIGHT * oracle.size(there) or not oracle.is_within(there, 1e-9):
            return f"{x} is within [{low}, {high}], but has a clearance of {worst}"
    for end, side, name in ((low, -1.0, found.lower_stop), (high, 1.0, found.upper_stop)):
        if name is None:
            continue
        there = _at(q, j, end)
        step = 1e-6 * max(1.0, abs(end))
        if name.startswith("b"):
            k = int(name[1:])
            touch, beyond = oracle.clearance(k, there), oracle.clearance(k, _at(q, j, end + side * step))
            scale = TIGHT * oracle.size(there)
            if abs(touch) > scale:
                return f"{name} stops at {end}, but has a clearance of {touch} there"
            if beyond > scale and not any(
                oracle.clearance(k, _at(q, j, end + side * step * part)) <= scale for part in np.geomspace(1e-6, 1, 30)
            ):
                return f"{name} stops at {end}, but is {beyond} beyond it"
        elif oracle.is_within(_at(q, j, end + side * step), 1e-9):
            return f"limit {name} stops at {end}, but allows more"
    return ""


def _same(one: Any, ends: Any, stop: Any) -> str:
    if one.blocked_by:
        return "" if np.all(np.isnan(ends)) else f"limits: blocked, table: {ends}"
    for value, other in ((one.lower, ends[0]), (one.upper, ends[1])):
        if value != other and not abs(value - other) <= 1e-9 * max(1.0, abs(value)):
            return f"limits: [{one.lower}, {one.upper}] by {one.lower_stop}, {one.upper_stop}; table: {ends} by {stop}"
    return ""


def _arcs(oracle: Oracle, robot: pb.Robot, q: Any, j: int, rng: np.random.Generator) -> str:
    """Compare the arcs of each boundary with its clearances at samples of a window."""
    window = (float(q[j]) - 4.0, float(q[j]) + 4.0)
    for k, boundary in enumerate(robot.boundaries):
        try:
            arcs = boundary.limits(oracle.names[j], q, window)
        except pb.UnsupportedError:
            continue
        for x in rng.uniform(*window, 40).tolist():
            there = _at(q, j, x)
            value = oracle.clearance(k, there)
            if abs(value) > TIGHT * oracle.size(there) and arcs.contains(x) != (value > 0.0):
                return f"arcs of {boundary.name} say {arcs.contains(x)} at {x}, where the clearance is {value}"
    return ""


def _windows(robot: pb.Robot, name: str, q: Any) -> str:
    for window in ((1.0, -1.0), (np.nan, 1.0), (q.max() + 1.0, q.max() + 2.0), (0.0,), "ab"):
        try:
            robot.boundaries.limits(name, q, window=window)  # type: ignore[arg-type]
        except pb.DimensionError:
            continue
        return f"the window {window} was taken"
    return ""


def campaign(attack: Callable[[np.random.Generator], str], about: str) -> int:
    """Make `--trials` attacks from `--seed`, print how often each answered what, and return 1 if one found a fault.

    Args:
        attack: Returns "WRONG: what was found", or a line that says how the trial ended.
        about: Of the command line; its first line is shown.
    """
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    began = time.process_time()
    for number, child in enumerate(np.random.default_rng(given.seed).spawn(given.trials)):
        answer = attack(child)
        wrong = answer.startswith("WRONG")
        counts["WRONG" if wrong else answer.split("\n")[0]] += 1
        if wrong:
            print(f"trial {number}: {answer}")
    for answer, count in counts.most_common():
        print(f"{count:6d}  {answer}")
    print(f"{given.trials} trials, {time.process_time() - began:.0f} s of processor time")
    return int("WRONG" in counts)


if __name__ == "__main__":
    sys.exit(campaign(attack_limits, __doc__ or "\n"))
