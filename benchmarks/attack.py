"""Attack on certificates with oracles of its own: no false CERTIFIED, no VIOLATED without a witness, no raw exception.

    python benchmarks/attack.py --trials 20000 --seed 0 --out docs/attack.md

Robots are generated with followers of followers, offsets, slides, multipliers, branches, and marks of every kind;
motions are of every type that `certify` reads, honest and lying; most distances are chosen so that the motion just
touches or just misses. The oracles are `tests/oracles.py`: kinematics joint by joint in plain NumPy, near ties again in
mpmath at 50 digits; SciPy's own evaluation of splines; distances of segments and boxes from points that lie on both (an
upper bound of the distance, which is what a false CERTIFIED has to beat). Nothing of pinbound's evaluators is used.

Each category is a function `(rng, folder) -> Outcome`, registered by `@category("name")`: add one for whatever else
makes a claim. Exit code 1 if anything is wrong.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mpmath as mp
import numpy as np
from scipy import interpolate, optimize

import pinbound as pb

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from oracles import DIGITS, Machine, random_machine

WRONG = ("FALSE CERTIFIED", "NO WITNESS", "RAW EXCEPTION", "FALSE BOUND", "LIE BELIEVED")
SAMPLES = 500
NEAR = 1e-9
"""Relative to the robot's size: float64 decides nothing below this, mpmath does."""


@dataclass(frozen=True)
class Outcome:
    """What came of one trial: certified, violated, undecided, refused or one of WRONG; and why."""

    result: str
    reason: str = ""


Trial = Callable[[np.random.Generator, Path], Outcome]
CATEGORIES: dict[str, Trial] = {}


def category(name: str) -> Callable[[Trial], Trial]:
    """Register a trial."""

    def register(trial: Trial) -> Trial:
        CATEGORIES[name] = trial
        return trial

    return register


# --- robots and their oracle -----------------------------------------------------------------------------------------


def machine_of(rng: np.random.Generator, plain: bool = False) -> Machine:
    """Return a random machine with marks and pairs of them, distances still zero."""
    wild = rng.random() < 0.2
    machine = random_machine(rng, int(rng.integers(2, 8)), wild, planar=rng.random() < 0.4)
    while not machine.active:
        machine = random_machine(rng, int(rng.integers(2, 8)), wild)
    length = max([abs(v) for joint in machine.joints for v in joint.xyz] + [1e-3])
    machine.tolerance = 1e-6 * length
    for index in range(int(rng.integers(1, 4))):
        links = rng.choice(len(machine.joints) + 1, 2, replace=False)
        kinds = ["point", "point"] if plain else list(rng.choice(["point", "point", "segment", "sweep", "plane"], 2))
        if kinds[0] == "plane":
            kinds[1] = "point" if kinds[1] == "plane" else kinds[1]
        for side, link, kind in zip("ab", links, kinds, strict=True):
            at = tuple(map(float, rng.normal(0, length, 3)))
            if kind == "point":
                numbers = {"xyz": at}
            elif kind == "segment":
                numbers = {"xyz_a": at, "xyz_b": tuple(map(float, np.array(at) + rng.normal(0, length, 3)))}
            elif kind == "sweep":
                numbers = {"xyz": at, "ways": tuple(map(float, np.diag(rng.uniform(0.1, 1.0, 3) * length).ravel()))}
            else:
                numbers = {"xyz": at, "normal": tuple(map(float, rng.normal(0, 1, 3)))}
            machine.marks[f"{side}{index}"] = (int(link), str(kind), numbers)
        machine.boundaries.append((f"a{index}", f"b{index}", 0.0))
    return machine


def placed(machine: Machine, name: str, R: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a mark's own point (N, 3) and its ways (N, k, 3) in the world."""
    link, kind, numbers = machine.marks[name]
    first = np.array(numbers["xyz_a" if kind == "segment" else "xyz"])
    ways = np.zeros((0, 3))
    if kind == "segment":
        ways = np.array([numbers["xyz_b"]]) - first
    elif kind == "sweep":
        ways = np.array(numbers["ways"]).reshape(-1, 3)
    return p[:, link] + R[:, link] @ first, np.einsum("nij,kj->nki", R[:, link], ways)


def separations(machine: Machine, Q: np.ndarray, exact: bool = False) -> np.ndarray:
    """Return the separations (N, m): heights, distances of points; of bodies, of two points that lie on them."""
    R, p = machine.poses(Q)
    columns = []
    for a, b, _ in machine.boundaries:
        (x, e), (y, f) = placed(machine, a, R, p), placed(machine, b, R, p)
        w, ways = x - y, np.concatenate([e, -f], axis=1)
        planes = [(name, sign) for name, sign in ((a, -1.0), (b, 1.0)) if machine.marks[name][1] == "plane"]
        if planes:
            name, sign = planes[0]
            link, _, numbers = machine.marks[name]
            normal = R[:, link] @ (np.array(numbers["normal"]) / np.linalg.norm(numbers["normal"]))
            along = sign * np.einsum("nki,ni->nk", ways, normal)
            columns.append(sign * np.einsum("ni,ni->n", w, normal) + np.minimum(along, 0.0).sum(axis=1))
        else:
            columns.append(nearest(w, ways, exact))
    return np.array(columns).T


def nearest(w: np.ndarray, ways: np.ndarray, exact: bool) -> np.ndarray:
    """Return `|w + sum t_i ways_i|` (N,) at a t in the unit cube, nearly or (`exact`) fully the least."""
    count, k = ways.shape[:2]
    if not k:
        return np.linalg.norm(w, axis=1)
    if exact:
        found = [
            optimize.lsq_linear(e.T, -x, bounds=(0.0, 1.0), method="bvls").x if np.any(e) else np.zeros(k)
            for e, x in zip(ways, w, strict=True)
        ]
        t = np.clip(np.array(found), 0.0, 1.0)
    else:
        t, squares = np.full((count, k), 0.5), np.einsum("nki,nki->nk", ways, ways) + 1e-300
        for _ in range(30):  # one way after the other
            for i in range(k):
                rest = w + np.einsum("nk,nki->ni", t, ways) - t[:, i, None] * ways[:, i]
                t[:, i] = np.clip(-np.einsum("ni,ni->n", rest, ways[:, i]) / squares[:, i], 0.0, 1.0)
    return np.linalg.norm(w + np.einsum("nk,nki->ni", t, ways), axis=1)


def contact_distances(machine: Machine) -> np.ndarray:
    """Return what each separation must exceed: the distance, but heights, at least the contact tolerance."""
    tall = [any(machine.marks[name][1] == "plane" for name in pair[:2]) for pair in machine.boundaries]
    least = np.array([0.0 if flat else machine.tolerance for flat in tall])
    return np.maximum(np.array([distance for *_, distance in machine.boundaries]), least)


def is_contact(machine: Machine, q: np.ndarray, row: int) -> bool | None:
    """Return whether a boundary is in contact at q by an oracle that can tell; None if none can."""
    a, b, distance = machine.boundaries[row]
    threshold = contact_distances(machine)[row]
    kinds = {machine.marks[name][1] for name in (a, b)}
    if kinds == {"point"}:
        with mp.workdps(DIGITS):
            return bool(machine.exact_distance(list(map(float, q)), a, b) <= mp.mpf(threshold))
    value = separations(machine, np.array([q]), exact=True)[0, row]
    scale = NEAR * (1.0 + float(np.abs(q).max())) * (size_of(machine, q) + abs(distance))
    return None if abs(value - threshold) <= scale else bool(value < threshold)


def size_of(machine: Machine, q: np.ndarray) -> float:
    """Return a length that the robot's links and marks do not exceed by much [m]."""
    p = machine.poses(np.array([q]))[1]
    marks = [np.linalg.norm(next(iter(numbers.values()))) for _, _, numbers in machine.marks.values()]
    return float(np.abs(p).max() + sum(marks) + 1e-3)


def touched(rng: np.random.Generator, machine: Machine, folder: Path, path: np.ndarray) -> pb.robot.Robot | None:
    """Choose home and distances so that the path just touches or misses; None if home cannot be clear."""
    pairs, machine.boundaries = machine.boundaries, []
    machine.load(folder)  # for the order of its coordinates: nothing of it is evaluated
    machine.boundaries = pairs
    home = path[0] + rng.normal(0, 0.3, len(machine.active))
    machine.home = {index: float(value) for index, value in zip(machine.active, home, strict=True)}
    here, least = separations(machine, home[None])[0], separations(machine, path).min(axis=0)
    for row, (a, b, _) in enumerate(machine.boundaries):
        depth = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9, 0) * max(abs(here[row]), 1e-6)
        wanted = least[row] + depth if rng.random() < 0.7 else here[row] * rng.uniform(0.0, 0.9)
        machine.boundaries[row] = (a, b, float(min(max(wanted, machine.tolerance), here[row] * (1.0 - 1e-6))))
    if any(distance < machine.tolerance for *_, distance in machine.boundaries):
        return None
    try:
        return machine.load(folder)
    except pb.InputError:
        return None


# --- judging ---------------------------------------------------------------------------------------------------------


def limits_passed(machine: Machine, q: np.ndarray, slack: float = 1e-12) -> bool:
    """Return whether a joint, followers too, is beyond its limits by more than is granted, in 50 digits."""
    with mp.workdps(DIGITS):
        values = machine.angles([mp.mpf(float(value)) for value in q])
        for value, joint in zip(values, machine.joints, strict=True):
            if joint.kind in ("revolute", "prismatic"):
                low, high = (mp.mpf(end) for end in joint.limits)
                if value < low - mp.mpf(slack) or value > high + mp.mpf(slack):
                    return True
    return False


def judged(machine: Machine, found, path: np.ndarray) -> Outcome:
    """Hold a certificate of a motion against samples of it (N, n)."""
    thresholds, values = contact_distances(machine), separations(machine, path)
    lines = {f.name for f in found.boundaries if f.lower < 0 < f.upper and f.verdict is pb.Verdict.VIOLATED}
    if found.verdict is pb.Verdict.CERTIFIED:
        for row in range(len(machine.boundaries)):
            worst = int(np.argmin(values[:, row]))
            if is_contact(machine, path[worst], row):
                return Outcome("FALSE CERTIFIED", f"{machine.boundaries[row]} at {path[worst].tolist()}")
        far = path[[0, -1, *np.abs(path).argmax(axis=0)]]
        if any(limits_passed(machine, q, 2e-12) for q in far):
            return Outcome("FALSE CERTIFIED", "a joint limit is passed")
    for row, finding in enumerate(found.boundaries):
        gap = float(values[:, row].min() - thresholds[row])
        rough = NEAR * (1.0 + float(np.abs(path).max())) * (size_of(machine, path[0]) + 1.0)
        if finding.verdict is pb.Verdict.CERTIFIED and finding.lower > gap + rough:
            return Outcome("FALSE BOUND", f"lower {finding.lower} above {gap} of {machine.boundaries[row]}")
        if (
            finding.contact is not None
            and finding.name not in lines
            and is_contact(machine, finding.contact.q, row) is False
        ):
            return Outcome("NO WITNESS", f"{machine.boundaries[row]} at {finding.contact.q.tolist()}")
    for finding in found.limits:
        if finding.contact is not None and not limits_passed(machine, finding.contact.q):
            return Outcome("NO WITNESS", f"{finding.name} at {finding.contact.q.tolist()}")
    return Outcome(found.verdict.value)


def refused(error: pb.PinboundError) -> Outcome:
    """Return a refusal by its reason, names and numbers left out."""
    first = re.split(r"[:;(]", str(error))[0]
    text = re.sub(r"'[^']*'", "'.'", first)
    text = re.sub(r"[-+]?\d[\d.e+-]*", "#", text)
    return Outcome("refused", text[:90])


def walk(rng: np.random.Generator, n: int, count: int) -> np.ndarray:
    steps = rng.normal(0.0, 10.0 ** rng.uniform(-3, 0.7), (count, n))
    return rng.normal(0.0, 10.0 ** rng.uniform(-1, 1), n) + np.cumsum(steps, axis=0)


def tried(
    rng: np.random.Generator, folder: Path, motion: Callable[[int], tuple[object, Callable]], plain: bool = False
):
    """Certify a motion of `motion(n)`, (what is given, q of fractions of it), and judge it."""
    machine = machine_of(rng, plain)
    given, at = motion(len(machine.active))
    path = at(np.linspace(0.0, 1.0, SAMPLES))
    robot = touched(rng, machine, folder, path)
    if robot is None:
        return Outcome("skipped", "home is in contact")
    if rng.random() < 0.3:
        limited(rng, machine, path)
        try:
            robot = machine.load(folder)
        except pb.InputError:
            return Outcome("skipped", "home is outside limits")
    try:
        found = pb.certify(robot, given, budget=pb.Budget(40_000, 5.0))
    except pb.PinboundError as error:
        return refused(error)
    near = fine(machine, at, path)
    return judged(machine, found, np.concatenate([path, near]))


def limited(rng: np.random.Generator, machine: Machine, path: np.ndarray) -> None:
    """Give one joint a limit near what the path reaches."""
    import dataclasses

    bound = [i for i, joint in enumerate(machine.joints) if joint.kind in ("revolute", "prismatic")]
    if not bound:
        return
    index = int(rng.choice(bound))
    values = [float(machine.angles(list(map(float, q)))[index]) for q in path]
    home = float(machine.angles([machine.home[i] for i in machine.active])[index])
    margin = rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, -1)
    high, low = max(max(values) + margin, home), min(min(values) - 1.0, home)
    machine.joints[index] = dataclasses.replace(machine.joints[index], limits=(low, high))


def fine(machine: Machine, at: Callable, path: np.ndarray) -> np.ndarray:
    """Return more of the path about the smallest separations."""
    values = separations(machine, path)
    centres = {int(row) for row in values.argmin(axis=0)}
    u = np.concatenate([np.linspace(c - 1, c + 1, 80) / (len(path) - 1) for c in centres])
    return at(np.clip(u, 0.0, 1.0))


# --- categories ------------------------------------------------------------------------------------------------------


@category("waypoints")
def waypoints(rng: np.random.Generator, folder: Path) -> Outcome:
    def motion(n: int):
        Q = walk(rng, n, int(rng.integers(1, 6)))
        knots = np.linspace(0.0, 1.0, len(Q)) if len(Q) > 1 else np.zeros(1)
        return Q, lambda u: np.stack([np.interp(u, knots, column) for column in Q.T], axis=1)

    return tried(rng, folder, motion, plain=rng.random() < 0.5)


def spline_trial(rng: np.random.Generator, folder: Path, make: Callable) -> Outcome:
    def motion(n: int):
        x = np.cumsum(rng.uniform(0.1, 1.0, int(rng.integers(4, 8)))) + rng.choice([0.0, 1e4])
        spline = make(x, walk(rng, n, len(x)))
        low, high = (
            (spline.t[spline.k], spline.t[-spline.k - 1]) if hasattr(spline, "t") else (spline.x[0], spline.x[-1])
        )
        return spline, lambda u: spline(np.minimum(low + u * (high - low), np.nextafter(high, low)))

    return tried(rng, folder, motion, plain=rng.random() < 0.6)


@category("PPoly, linear")
def linear(rng: np.random.Generator, folder: Path) -> Outcome:
    def make(x, Q):
        return interpolate.PPoly(np.stack([np.diff(Q, axis=0) / np.diff(x)[:, None], Q[:-1]]), x)

    return spline_trial(rng, folder, make)


@category("PPoly, cubic")
def cubic(rng: np.random.Generator, folder: Path) -> Outcome:
    kind = rng.choice(["CubicSpline", "Akima1DInterpolator", "PchipInterpolator"])
    return spline_trial(rng, folder, getattr(interpolate, str(kind)))


@category("PPoly, jumps")
def jumps(rng: np.random.Generator, folder: Path) -> Outcome:
    def make(x, Q):
        c = np.stack([np.diff(Q, axis=0) / np.diff(x)[:, None], Q[:-1]])
        row = int(rng.integers(0, c.shape[1]))
        c[0, row] += rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, 1, c.shape[2])
        return interpolate.PPoly(c, x)

    return spline_trial(rng, folder, make)


@category("BPoly")
def bernstein(rng: np.random.Generator, folder: Path) -> Outcome:
    def make(x, Q):
        return interpolate.BPoly.from_derivatives(x, np.stack([Q, 0.3 * Q, 0.0 * Q], axis=1))

    return spline_trial(rng, folder, make)


@category("BSpline, degrees 1 to 10")
def bspline(rng: np.random.Generator, folder: Path) -> Outcome:
    degree = int(rng.integers(1, 11))

    def make(x, Q):
        inner = np.sort(rng.uniform(x[0], x[-1], int(rng.integers(0, 5))))
        if degree > 2 and len(inner) > 1 and rng.random() < 0.3:
            inner[1] = inner[0]
        t = np.concatenate([np.repeat(x[0], degree + 1), inner, np.repeat(x[-1], degree + 1)])
        return interpolate.BSpline(t, walk(rng, Q.shape[1], len(t) - degree - 1), degree)

    return spline_trial(rng, folder, make)


def function_of(rng: np.random.Generator, n: int):
    """Return a sum of sines with true bounds of speed and acceleration."""
    a, w, f = rng.normal(0, 1.0, (3, n)), rng.uniform(0.3, 3.0, (3, n)), rng.uniform(0, 6, (3, n))

    def q(t, order=0):
        angle = w * np.asarray(t)[:, None, None] + f
        return (a * (np.sin(angle) if order == 0 else w * np.cos(angle))).sum(axis=1)

    return q, np.abs(a * w).sum(axis=0), np.abs(a * w * w).sum(axis=0)


@category("BoundedMotion, honest")
def honest(rng: np.random.Generator, folder: Path) -> Outcome:
    def motion(n: int):
        q, speed, acceleration = function_of(rng, n)
        given = pb.BoundedMotion(q, 0.0, 2.0, speed, acceleration if rng.random() < 0.7 else None)
        return given, lambda u: q(2.0 * u)

    return tried(rng, folder, motion, plain=True)


@category("BoundedMotion, lying")
def lying(rng: np.random.Generator, folder: Path) -> Outcome:
    """A certificate of a lie is no fault of its own, unless samples at hand disprove the lie: then it is."""
    machine = machine_of(rng, plain=True)
    n = len(machine.active)
    q, speed, acceleration = function_of(rng, n)
    path = q(np.linspace(0.0, 2.0, SAMPLES))
    robot = touched(rng, machine, folder, path)
    if robot is None:
        return Outcome("skipped", "home is in contact")
    lie = str(rng.choice(["no order", "wrong sign", "speed", "acceleration", "jump", "buffer", "scale"]))
    steps = np.diff(path, axis=0) / (2.0 / (SAMPLES - 1))

    def told(t, order=0):
        if lie == "no order":
            return q(t)
        if lie == "scale":
            return q(t, order) * (0.5 if order else 1.0)
        if lie == "jump" and not order:
            return q(t) + 0.3 * (t[:, None] > 1.0)
        return q(t, order) * (-1.0 if lie == "wrong sign" and order else 1.0)

    small = 0.5 * np.abs(steps).max(axis=0)
    own = small if lie == "speed" else speed
    bend = 0.1 * acceleration if lie == "acceleration" else acceleration
    try:
        pb.certify(robot, pb.BoundedMotion(told, 0.0, 2.0, own, bend), budget=pb.Budget(20_000, 5.0), limits=False)
    except pb.PinboundError as error:
        return refused(error)
    return Outcome("believed" if lie in ("buffer", "acceleration") else "LIE BELIEVED", lie)


@category("box")
def box(rng: np.random.Generator, folder: Path) -> Outcome:
    machine = machine_of(rng, plain=rng.random() < 0.7)
    n = len(machine.active)
    centre, half = rng.normal(0, 1.0, n), 10.0 ** rng.uniform(-4, 0) * rng.uniform(0, 1, n)
    Q = centre + half * np.concatenate([rng.uniform(-1, 1, (SAMPLES, n)), rng.choice([-1.0, 1.0], (200, n))])
    robot = touched(rng, machine, folder, Q)
    if robot is None:
        return Outcome("skipped", "home is in contact")
    try:
        found = pb.certify_box(robot, centre - half, centre + half, budget=pb.Budget(20_000, 3.0))
    except pb.PinboundError as error:
        return refused(error)
    thresholds = contact_distances(machine)
    if found.verdict is pb.Verdict.VIOLATED:
        if np.any((found.witness < centre - half) | (found.witness > centre + half)):
            return Outcome("NO WITNESS", "outside its box")
        names = [f"b{row}" for row in range(len(machine.boundaries))]
        if found.violated in names:
            row = names.index(found.violated)
            if is_contact(machine, found.witness, row) is False and thresholds[row] > machine.tolerance:
                return Outcome("NO WITNESS", f"{machine.boundaries[row]} at {found.witness.tolist()}")
        elif not limits_passed(machine, found.witness):
            return Outcome("NO WITNESS", f"{found.violated} at {found.witness.tolist()}")
        return Outcome("violated")
    values = separations(machine, Q)
    if found.verdict is pb.Verdict.CERTIFIED:
        for row in range(len(machine.boundaries)):
            worst = Q[int(np.argmin(values[:, row]))]
            worst = descended(machine, row, worst, centre - half, centre + half)
            if is_contact(machine, worst, row):
                return Outcome("FALSE CERTIFIED", f"{machine.boundaries[row]} at {worst.tolist()}")
    return Outcome(found.verdict.value)


def descended(machine: Machine, row: int, q: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Walk downhill within the box, one coordinate after the other."""
    step = 0.25 * (high - low)
    best = float(separations(machine, q[None])[0, row])
    for _ in range(25):
        trials = np.clip(q + np.concatenate([np.diag(step), -np.diag(step)]), low, high)
        values = separations(machine, trials)[:, row]
        if values.min() < best:
            best, q = float(values.min()), trials[int(np.argmin(values))]
        else:
            step = step / 2.0
    return q


@category("single configuration")
def single(rng: np.random.Generator, folder: Path) -> Outcome:
    """Bounds of one q against 50 digits: the true clearance lies between lower and upper."""
    machine = machine_of(rng, plain=True)
    q = rng.normal(0, 10.0 ** rng.uniform(-1, 8), len(machine.active))
    robot = touched(rng, machine, folder, rng.normal(0, 1.0, (2, len(machine.active))))
    if robot is None:
        return Outcome("skipped", "home is in contact")
    try:
        found = pb.certify(robot, [q], limits=False, each=True)
    except pb.PinboundError as error:
        return refused(error)
    with mp.workdps(DIGITS):
        for (a, b, distance), finding in zip(machine.boundaries, found.boundaries, strict=True):
            true = machine.exact_distance(list(map(float, q)), a, b) - mp.mpf(max(distance, machine.tolerance))
            if not mp.mpf(finding.lower) <= true <= mp.mpf(finding.upper):
                return Outcome("FALSE BOUND", f"{finding.lower} <= {true} <= {finding.upper}")
    return Outcome(found.verdict.value)


@category("nonsense")
def nonsense(rng: np.random.Generator, folder: Path) -> Outcome:
    """Whatever is handed over: an answer or a refusal, never another exception."""
    machine = machine_of(rng, plain=True)
    n = len(machine.active)
    robot = touched(rng, machine, folder, walk(rng, n, 3))
    if robot is None:
        return Outcome("skipped", "home is in contact")
    Q = walk(rng, n, 3)
    c = rng.normal(0, 1, (2, 2, n))
    ppoly = interpolate.PPoly
    things = [
        (Q * 1e300, None), (Q * np.nan, None), (Q[:, :-1], None), (Q[None], None), (Q.astype(complex), None),
        (Q.astype(str), None), (Q.tolist(), [0, 1, 1]), (Q, [2, 1, 0]), (Q, "abc"), (Q[:0], None), (Q[:1], [5.0]),
        (Q.astype(object), None), (Q.astype(np.float32), None), (np.round(Q).astype(int), None), (None, None),
        ("q", None), (5.0, None), (lambda t: t, None), (ppoly(c * 1j, [0, 1, 2]), None), ({"q": 1}, None),
        (ppoly(c, [2, 1, 0]), None), (ppoly(c, [0, 1, 1]), None), (ppoly(c[:, :1], [0, 1]), None), (b"q", None),
        (ppoly(c[:1], [0, 1, 2]), None), (ppoly(c[:, :, 0], [0, 1, 2]), None), (Q * 57.29577951308232, None),
        (interpolate.interp1d([0, 1, 2], Q, axis=0), None), (ppoly(c * 1e200, [0, 1, 2]), None),
        (ppoly(c, [0, 1e-300, 1]), None),
    ]  # fmt: skip
    given, times = things[int(rng.integers(len(things)))]
    try:
        found = pb.certify(robot, given, times, budget=pb.Budget(5_000, 2.0))
    except pb.PinboundError as error:
        return refused(error)
    return Outcome(found.verdict.value)


# --- the table -------------------------------------------------------------------------------------------------------


def report(
    counts: dict[str, Counter[str]], reasons: Counter[tuple[str, str]], wrong: list[str], seconds: float, seed: int
) -> str:
    columns = ("certified", "violated", "undecided", "refused", "believed", "skipped", *WRONG)
    shown = [column for column in columns if any(count[column] for count in counts.values()) or column in WRONG]
    total = sum(sum(count.values()) for count in counts.values())
    command = f"python benchmarks/attack.py --trials {total} --seed {seed}"
    lines = ["# An attack on certificates", "", f"`{command}`; the script describes the trials and the oracles.", ""]
    lines += [f"| category | {' | '.join(shown)} |", f"| --- | {' | '.join('---:' for _ in shown)} |"]
    lines += [f"| {name} | {' | '.join(f'{count[one]:,}' for one in shown)} |" for name, count in counts.items()]
    lines += ["", f"{total:,} trials, seed {seed}, {seconds:.0f} s. A trial is skipped if home is in contact.", ""]
    lines += ["| refused: category | reason | count |", "| --- | --- | ---: |"]
    lines += [f"| {name} | {reason} | {count:,} |" for (name, reason), count in sorted(reasons.items())]
    return "\n".join([*lines, "", *(f"- {text}" for text in wrong[:50])]) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=2_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", choices=sorted(CATEGORIES), help="these categories alone")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    names = options.only or list(CATEGORIES)
    counts: dict[str, Counter[str]] = {name: Counter() for name in names}
    reasons: Counter[tuple[str, str]] = Counter()
    wrong: list[str] = []
    started, folder = time.perf_counter(), Path(tempfile.mkdtemp())
    for trial in range(options.trials):
        name = names[trial % len(names)]
        rng = np.random.default_rng([options.seed, trial])
        try:
            found = CATEGORIES[name](rng, folder)
        except Exception as error:
            found = Outcome("RAW EXCEPTION", f"{type(error).__name__}: {error}\n{traceback.format_exc(limit=-3)}")
        counts[name][found.result] += 1
        if found.result == "refused":
            reasons[name, found.reason] += 1
        if found.result in WRONG:
            wrong.append(f"{name}, trial {trial}: {found.result}: {found.reason}")
            print(wrong[-1], file=sys.stderr, flush=True)
        if options.out and trial % 2_000 == 1_999:
            options.out.write_text(report(counts, reasons, wrong, time.perf_counter() - started, options.seed))
    text = report(counts, reasons, wrong, time.perf_counter() - started, options.seed)
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
