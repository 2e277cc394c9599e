"""Segments, sweeps, lines and planes against an oracle of Pinocchio and SciPy: certificates, limits, regions, kernels.

    python benchmarks/segments_campaign.py --count 300 --seed 0

Random mechanisms (planar, spatial, with a slide, with a follower on a branch) with random marks of every kind, some of
them degenerate: along an axis, parallel, flat, of no length, tiny, huge. Distances are resized so that a motion just
touches, or just misses, by 1e-3 to 1e-9 m. The oracle takes a robot's marks to the world by Pinocchio's placements and
solves for the nearest points by an active set (`scipy.optimize.lsq_linear`); nothing of it is pinbound's. Samples are
taken where pinbound says that something is tightest, and densely all along. Exit code 1 if a single answer is wrong.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear

import pinbound as pb
from pinbound.boundaries.boundary_set import BoundarySet

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from mechanisms import AXES, mechanism, write

SAMPLES = 160
ROUNDING = 2e-12  # of a length of 1 m: what the solver of the oracle leaves
KINDS = ("point", "segment", "rectangle", "box", "prism", "flat", "line", "plane")


def numbers(xyz: Any) -> str:
    return "[" + ", ".join(repr(float(value)) for value in xyz) + "]"


def random_mark(rng: np.random.Generator, name: str, link: str, sort: str) -> str:
    """Return a mark in the sidecar's words; in a planar mechanism, half of them lie in its plane."""
    kind = str(rng.choice(KINDS))
    flat = np.array([1.0, 0.0, 1.0]) if sort == "planar" and rng.random() < 0.5 else np.ones(3)
    axis = np.array(str(rng.choice(AXES[sort])).split(), dtype=float)
    size = 0.25 * float(rng.choice([1.0, 1.0, 1.0, 1e-9, 1e-3, 40.0]))
    xyz = 0.25 * rng.uniform(-1, 1, 3) * flat
    radius = float(rng.choice([0.0, 0.01]))
    head = f"name: {name}, link: {link}"
    if kind == "point":
        return f"points: {{{head}, xyz: {numbers(xyz)}, radius: {radius}}}"
    if kind in ("line", "plane"):
        towards = axis if rng.random() < 0.3 else rng.normal(size=3) * flat
        word = "direction" if kind == "line" else "normal"
        last = f", radius: {radius}" if kind == "line" else ""
        return f"{kind}s: {{{head}, xyz: {numbers(xyz)}, {word}: {numbers(towards)}{last}}}"
    count = {"segment": 1, "rectangle": 2, "box": 3, "prism": int(rng.integers(4, 6)), "flat": int(rng.integers(3, 5))}
    ways = size * rng.normal(size=(count[kind], 3)) * flat
    if kind == "flat":
        ways[:, int(rng.integers(3))] *= float(rng.choice([0.0, 1e-12, 1e-6]))
    if rng.random() < 0.3:
        ways[0] = size * axis  # along a joint's axis, or nearly
        ways[0] += float(rng.choice([0.0, 1e-13, 1e-8])) * rng.normal(size=3) * flat
    if len(ways) > 1 and rng.random() < 0.3:
        ways[1] = -0.7 * ways[0] + float(rng.choice([0.0, 1e-15, 1e-9])) * rng.normal(size=3) * flat
    if rng.random() < 0.2:
        ways[-1] *= 1e-3
    if kind == "segment":
        end = xyz + ways[0] * (rng.random() > 0.1)
        return f"segments: {{{head}, xyz_a: {numbers(xyz)}, xyz_b: {numbers(end)}, radius: {radius}}}"
    listed = "[" + ", ".join(map(numbers, ways)) + "]"
    return f"sweeps: {{{head}, xyz: {numbers(xyz)}, ways: {listed}, radius: {radius}}}"


def random_robot(rng: np.random.Generator, folder: Path, sort: str, slides: bool) -> pb.Robot | None:
    joints = int(rng.integers(2, 6))
    links = ["base", *(f"l{i}" for i in range(joints))]
    held = [str(rng.choice(links)) for _ in range(7)]
    marks = [random_mark(rng, f"m{i}", link, sort) for i, link in enumerate(held)]
    endless = [mark.split(":")[0] in ("lines", "planes") for mark in marks]
    pairs: list[str] = []
    for a, b in itertools.combinations(range(7), 2):
        if held[a] != held[b] and not (endless[a] and endless[b]) and rng.random() < 0.4:
            distance = float(rng.choice([0.0, 1e-4, 2e-5]))
            pairs.append(f"- {{name: beta_{len(pairs)}, a: m{a}, b: m{b}, min_distance: {distance}}}")
    if not pairs:
        return None
    text = ""
    for word in sorted({mark.split(":")[0] for mark in marks}):
        rows = [mark.split(": ", 1)[1] for mark in marks if mark.startswith(f"{word}:")]
        text += f"{word}:\n" + "".join(f"- {row}\n" for row in rows)
    text += "boundaries:\n" + "\n".join(pairs) + "\n"
    try:
        return pb.load(write(folder, mechanism(rng, sort, joints, slides), text))
    except pb.PinboundError as error:
        if "home" in str(error) or "contact" in str(error) or "never move" in str(error) or "constant" in str(error):
            return None
        raise


class Oracle:
    """Separations by Pinocchio's placements and a solver of bounded least squares."""

    def __init__(self, robot: pb.Robot) -> None:
        self.robot, self.data = robot, robot.model.createData()

    def separation(self, boundary: pb.Boundary, q: Any) -> float:
        pin.framesForwardKinematics(self.robot.model, self.data, self.robot.coupling.expand(np.asarray(q)[None])[0])
        found = []
        for mark in (boundary.point_a, boundary.point_b):
            place = self.data.oMf[self.robot.model.getFrameId(mark.link, pin.BODY)]
            towards = getattr(mark, "normal", None) or getattr(mark, "direction", None)
            turned = None if towards is None else place.rotation @ np.array(towards) / np.linalg.norm(towards)
            found.append((place.act(np.array(mark.xyz)), [place.rotation @ np.array(way) for way in mark.ways], turned))
        (x, ways_a, up_a), (y, ways_b, up_b) = found
        w, ways = x - y, [*ways_a, *(-way for way in ways_b)]
        if isinstance(boundary.point_a, pb.Plane) or isinstance(boundary.point_b, pb.Plane):
            n = up_a if up_b is None else up_b
            sign = 1.0 if up_a is None else -1.0  # from the plane to what is measured
            return float(sign * w @ n + sum(min(0.0, float(sign * way @ n)) for way in ways))
        along = up_a if up_b is None else up_b
        if along is not None:
            w, ways = w - (w @ along) * along, [way - (way @ along) * along for way in ways]
        return nearest(w, np.array(ways).reshape(-1, 3).T)

    def least(self, boundary: pb.Boundary, motion: Callable[[Any], Any], end: float, hint: float) -> float:
        """Return the smallest sampled separation: dense, around `hint`, and finer around the smallest."""
        best, where, width = np.inf, hint, end / SAMPLES
        times = np.append(np.linspace(0.0, end, SAMPLES), hint)
        for _ in range(4):
            values = [self.separation(boundary, q) for q in motion(times)]
            row = int(np.argmin(values))
            if values[row] < best:
                best, where = values[row], float(times[row])
            times = np.clip(np.linspace(where - width, where + width, 21), 0.0, end)
            width /= 9.0
        return best


def nearest(w: Any, A: Any) -> float:
    """Return `min |w + A t|`, t in [0, 1]; the solver's free t are solved for once more."""
    A = A[:, np.any(A != 0.0, axis=0)]
    if not A.shape[1]:
        return float(np.linalg.norm(w))
    best = np.inf
    size = np.linalg.norm(A, axis=0)  # the solver's columns of one length: t' = |e| t
    starts = [lsq_linear(A / size, -w, (np.zeros_like(size), size), method="bvls", tol=1e-15).x / size]
    if A.shape[1] == 1:
        starts.append(np.array([-(w @ A[:, 0]) / size[0] ** 2]))
    for start in starts:
        t = np.clip(start, 0.0, 1.0)
        best = min(best, float(np.linalg.norm(w + A @ t)))
        free = (t > 0.0) & (t < 1.0)
        if np.any(free):
            t[free] -= np.linalg.lstsq(A[:, free], w + A @ t, rcond=1e-13)[0]
            best = min(best, float(np.linalg.norm(w + A @ np.clip(t, 0.0, 1.0))))
    return best


def resized(robot: pb.Robot, distances: dict[str, float]) -> pb.Robot:
    changed = [dataclasses.replace(b, min_distance=distances.get(b.name, b.min_distance)) for b in robot.boundaries]
    return dataclasses.replace(robot, boundaries=BoundarySet(changed, robot.coordinates, robot.linear_limits))


def scale_of(boundary: pb.Boundary) -> float:
    return max(1.0, boundary.path.minimal.scale)


class Campaign:
    """Counts of answers, and of wrong ones."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.asked: Counter[str] = Counter()
        self.wrong: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self.slowest = 0.0
        self.open_clearance = 0.0

    def check(self, name: str, is_right: Any, *details: Any) -> None:
        self.asked[name] += 1
        if not is_right:
            self.wrong[name] += 1
            sys.stderr.write(f"WRONG {name}: {details}\n")

    def measures(self, robot: pb.Robot, oracle: Oracle) -> None:
        """Compare norms of reference and kernels, NaN, and gradients."""
        B, n = robot.boundaries, len(robot.coordinates)
        Q = self.rng.uniform(-3, 3, (12, n))
        kernel, gradients = B.norms(Q, backend="numpy"), B.gradients(Q, backend="numpy")
        small = B.smallest(Q, backend="numpy")
        bad = Q.copy()
        bad[np.arange(12), self.rng.integers(n, size=12)] = self.rng.choice([np.nan, np.inf, -np.inf], 12)
        for column, boundary in enumerate(B):
            size = scale_of(boundary) + float(np.abs(Q).max())
            found, t = boundary.norm(Q), boundary.nearest(Q)
            solved = np.array([oracle.separation(boundary, q) for q in Q])
            above = found - solved
            self.check("norm above the true distance", np.all(above <= ROUNDING * size), boundary, above)
            thin = 1e-8 * size if boundary.path.is_solid else ROUNDING * size
            self.check("norm below the true distance", np.all(above >= -thin), boundary, above)
            self.check("kernel", np.all(np.abs(kernel[:, column] - found) <= 2e-14 * size), boundary)
            self.check("t in [0, 1]", np.all((t >= 0.0) & (t <= 1.0)), boundary)
            vectors = np.linalg.norm(boundary.vector(Q), axis=1)
            self.check("vector as long as the norm", np.all(np.abs(vectors - np.abs(found)) <= 1e-11 * size), boundary)
            depends = [robot.coordinates.index(name) for name in boundary.coordinates]
            row_is_bad = ~np.isfinite(bad[:, depends]).all(axis=1)
            with np.errstate(invalid="ignore"):
                self.check("NaN of a bad row", np.all(np.isnan(boundary.norm(bad))[row_is_bad]), boundary)
            slopes, bends = boundary.gradient(Q), boundary.hessian(Q)
            self.check("shapes", slopes.shape == (12, n) and bends.shape == (12, n, n))
            self._slopes(boundary, Q, slopes, gradients[:, column], found, size)
        self.check(
            "smallest",
            np.all(np.abs(small.clearance - B.clearances(Q).min(axis=1)) < 1e-12 * (1 + np.abs(small.clearance))),
        )
        self.check("NaN is not free", not np.any(B.free(np.full((1, n), np.nan), backend="numpy")) or not len(B))

    def _slopes(self, boundary: pb.Boundary, Q: Any, slopes: Any, kernel: Any, norms: Any, size: float) -> None:
        """Compare gradients with differences where no nearest feature changes nearby."""
        step = 1e-6
        for j in range(Q.shape[1]):
            e = step * np.eye(Q.shape[1])[j]
            below, above = boundary.gradient(Q - e)[:, j], boundary.gradient(Q + e)[:, j]
            smooth = (np.abs(above - below) < 1e-3 * size) & (np.abs(norms) > 1e-2) & np.isfinite(slopes[:, j])
            smooth &= np.ptp([below, above, slopes[:, j]], axis=0) < 1e-3 * size
            difference = (boundary.norm(Q + e) - boundary.norm(Q - e)) / (2 * step)
            right = np.abs(difference - slopes[:, j]) < 1e-3 * size
            self.check("gradient", np.all(right[smooth]), boundary, j)
        self.check("gradient is a number", np.all(np.isfinite(kernel[np.abs(norms) > 1e-6])), boundary)

    def motion(self, robot: pb.Robot) -> tuple[Any, Callable[[Any], Any], float]:
        n, rng = len(robot.coordinates), self.rng
        start = robot.home + rng.normal(0.0, 0.4, n)
        points = start + np.cumsum(rng.normal(0.0, 10.0 ** rng.uniform(-2, 0.3), (int(rng.integers(2, 5)), n)), axis=0)
        sort = int(rng.integers(3))
        if sort == 1 and len(points) > 2:
            spline = CubicSpline(np.arange(float(len(points))), points)
            return spline, spline, float(len(points) - 1)
        if sort == 2:
            turn, phase, size = rng.uniform(0.3, 2.0, n), rng.uniform(0, 6, n), rng.uniform(0.01, 1.0, n)

            def wave(t: Any, order: int = 0) -> Any:
                angle = np.asarray(t)[:, None] * turn + phase
                return size * turn * np.cos(angle) if order else start + size * np.sin(angle)

            bounded = pb.BoundedMotion(wave, 0.0, 2.0, size * turn * 1.0001, size * turn**2 * 1.0001)
            return bounded, wave, 2.0

        def along(t: Any) -> Any:
            i = np.minimum(np.asarray(t).astype(int), len(points) - 2)
            return points[i] + (t - i)[:, None] * (points[i + 1] - points[i])

        return points, along, float(len(points) - 1)

    def certificates(self, robot: pb.Robot, oracle: Oracle) -> None:
        motion, along, end = self.motion(robot)
        budget = pb.Budget(boxes=200_000, seconds=5.0)
        first = pb.certify(robot, motion, None, None, budget, each=True, limits=False)
        hints = {one.name: self._time(motion, one.time, end) for one in first.boundaries}
        least = {b.name: oracle.least(b, along, end, hints[b.name]) for b in robot.boundaries}
        for one in first.boundaries:
            self._finding(robot.boundaries[one.name], one, least[one.name], oracle)
        sizes = {}
        for boundary in robot.boundaries:
            depth = float(self.rng.choice([-1.0, 1.0])) * 10.0 ** self.rng.uniform(-9, -3)
            rest = boundary.point_a.radius + boundary.point_b.radius
            sizes[boundary.name] = float(max(least[boundary.name] - rest + depth, 0.0))
        tried = resized(robot, sizes)
        again = pb.certify(tried, motion, None, None, budget, each=True, limits=False)
        self.slowest = max(self.slowest, again.seconds)
        for one in again.boundaries:
            self._finding(tried.boundaries[one.name], one, least[one.name], oracle)
        centre, half = along(np.array([end / 2]))[0], 10.0 ** self.rng.uniform(-4, -1.5)
        box = pb.certify_box(
            tried, centre - half, centre + half, None, pb.Budget(boxes=20_000, seconds=1.0), limits=False
        )
        if box.verdict is pb.Verdict.CERTIFIED:
            for q in centre + half * self.rng.uniform(-1, 1, (8, len(centre))):
                clear = [oracle.separation(b, q) - b.contact_distance for b in tried.boundaries if not b.path.is_plain]
                self.check("box CERTIFIED", min(clear, default=1.0) > -1e-13, clear)
        self.asked[f"box {box.verdict.value}"] += 1

    @staticmethod
    def _time(motion: Any, time: float, end: float) -> float:
        return float(np.clip(time, 0.0, end))

    def _finding(self, boundary: pb.Boundary, one: Any, least: float, oracle: Oracle) -> None:
        if boundary.path.is_plain:
            return
        clearance, size = least - boundary.contact_distance, ROUNDING * scale_of(boundary)
        self.asked[f"motion {one.verdict.value}"] += 1
        false = one.verdict is pb.Verdict.CERTIFIED and clearance <= -1e-15 * scale_of(boundary)
        self.check("false CERTIFIED", not false, boundary, clearance, one.lower)
        self.check("lower bound above a sample", one.lower <= clearance + size, boundary, one.lower - clearance)
        there = oracle.separation(boundary, one.q) - boundary.contact_distance
        self.check("upper bound met at its q", there <= one.upper + size, boundary, there - one.upper)
        if one.contact is not None:
            there = oracle.separation(boundary, one.contact.q) - boundary.contact_distance
            self.check("VIOLATED has a witness", there < size, boundary, there)
        if one.verdict is pb.Verdict.UNDECIDED:
            self.open_clearance = max(self.open_clearance, abs(clearance) / scale_of(boundary))

    def limits(self, robot: pb.Robot, oracle: Oracle) -> None:
        q = self.rng.uniform(-2, 2, (1, len(robot.coordinates)))
        for boundary in robot.boundaries:
            if boundary.path.is_plain:
                continue
            j = int(self.rng.integers(q.shape[1]))
            line = np.linspace(-3.1, 3.1, 41)
            points = np.repeat(q, len(line), axis=0)
            points[:, j] = line
            values = np.array([oracle.separation(boundary, one) for one in points])
            rest = boundary.point_a.radius + boundary.point_b.radius
            depth = self.rng.choice([-1, 1]) * 10.0 ** self.rng.uniform(-9, -3)
            size = float(max(self.rng.choice(values) - rest + depth, 0.0))
            tried = dataclasses.replace(boundary, min_distance=size)
            try:
                arcs = tried.limits(robot.coordinates[j], q, window=(-4.0, 4.0))[0]
            except pb.UnsupportedError as error:
                self.refused[f"limits: {' '.join(str(error).split()[-8:])}"] += 1
                continue
            room = ROUNDING * 10 * scale_of(boundary)
            for x, value in zip(line, values, strict=True):
                free = arcs.contains(float(x))
                gap = value - tried.contact_distance
                self.check("allowed holds no contact", not free or gap > -room, tried, x, gap)
                near = 1e-8 * scale_of(boundary) if boundary.path.is_solid else room
                self.check("what is free is allowed", free or gap <= near, tried, x, gap)

    def region(self, robot: pb.Robot, oracle: Oracle) -> None:
        if len(robot.coordinates) < 2:
            return
        names = tuple(robot.coordinates[:2])
        window = dict.fromkeys(names, (-1.5, 1.5))
        try:
            region = pb.feasible_region(robot, names, window=window)
        except (pb.UnsupportedError, pb.DimensionError) as error:
            self.refused[f"region: {' '.join(str(error).split()[-7:])}"] += 1
            return
        self.asked["region"] += 1
        inside = self.rng.uniform(-1.5, 1.5, (4000, 2))
        inside = inside[np.asarray(region.contains(inside))][:25]
        Q = np.tile(robot.home, (len(inside), 1))
        Q[:, :2] = inside
        for q, boundary in itertools.product(Q, robot.boundaries):
            distance = boundary.contact_distance if not boundary.path.is_plain else boundary.threshold
            gap = oracle.separation(boundary, q) - distance
            self.check("region holds no contact", gap > -ROUNDING * scale_of(boundary), boundary, q, gap)

    def report(self, count: int, seed: int, seconds: float) -> str:
        rows = [f"| {name} | {asked:,} | {self.wrong[name]:,} |" for name, asked in sorted(self.asked.items())]
        refused = [f"- {count:,} x {name}" for name, count in sorted(self.refused.items())]
        head = ["| answer | asked | wrong |", "| --- | ---: | ---: |"]
        tail = f"{count:,} mechanisms, seed {seed}, {seconds:.0f} s; slowest certificate {self.slowest:.2f} s; largest "
        tail += f"|clearance| left undecided {self.open_clearance:.1e} of a path's length."
        return "\n".join([*head, *rows, "", tail, "", "Refused:", *refused]) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long")
    options = parser.parse_args()
    campaign, folder = Campaign(options.seed), Path(tempfile.mkdtemp())
    started = time.monotonic()
    done = tried = 0
    while done < options.count and time.monotonic() - started < options.seconds:
        sort, slides = ("planar", "spatial")[tried % 2], tried % 5 == 4
        tried += 1
        robot = random_robot(campaign.rng, folder, sort, slides)
        if robot is None:
            continue
        done += 1
        oracle = Oracle(robot)
        campaign.measures(robot, oracle)
        campaign.certificates(robot, oracle)
        campaign.limits(robot, oracle)
        campaign.region(robot, oracle)
    sys.stdout.write(campaign.report(done, options.seed, time.monotonic() - started))
    return int(any(campaign.wrong.values()))


if __name__ == "__main__":
    sys.exit(main())
