"""Certificates, boxes and limits of hulls, boxes and capsules against an oracle of Pinocchio, coal and SciPy.

    python benchmarks/hulls_campaign.py --count 500 --seed 1000 --seeds 200

A seed is a run of its own; sums are printed after each. The first wrong answer ends it.

Random trees (planar, spatial, with slides and a mimic joint on a branch) carry random bodies: hulls of 4 to 60
vertices, boxes, capsules, points, cylinders, planes; slivers and flat hulls, bodies inside others, huge offsets. The
distances to keep are chosen so that a motion just touches, or just misses, by 1e-2 to 1e-9 m, or are zero, so that
contact is where bodies overlap. The oracle places the vertices by Pinocchio. It looks at a motion densely, and closely
around the nearest place, with a solver of its own (`nearest_faces.py`): a distance of two points, and the bound that
its direction proves. Where the two differ by more than rounding, as of slivers that touch, the shortest vector of pairs
of vertices is looked for by nonnegative least squares (Lawson and Hanson). One motion in sixteen is held against coal,
whose distances are good to 1e-6 m. Nothing of it is pinbound's. Counted are motions, one certificate each with up to
ten boundaries. Exit code 1 if one is wrong.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline
from scipy.optimize import nnls
from scipy.spatial import ConvexHull, QhullError

import pinbound as pb
from pinbound.boundaries.boundary import Boundary
from pinbound.boundaries.boundary_set import BoundarySet
from pinbound.path.relative import relative_path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parent))
from nearest_faces import lowest, moved, nearest_of

from mechanisms import mechanism, write

SAMPLES = 64
THICK = 1e-3  # metres: coal has no segments but capsules
COAL = 2e-6  # of a length of 1 m: what coal's distances are good to
CLOSE = 1e-14  # of the size of what is placed: the oracle's bounds differ by no more, or another solver is asked
ROUNDING = 4e-12  # of a length of 1 m: what the solver of the oracle leaves
MOTIONS = 8  # of one robot
KINDS = ("hull", "hull", "hull", "sliver", "flat", "box", "box", "capsule", "point", "cylinder", "plane")


def random_mark(rng: np.random.Generator, name: str, link: str) -> Any:
    kind = str(rng.choice(KINDS))
    far = float(rng.choice([0.25, 0.25, 0.25, 0.25, 30.0]))
    xyz = far * rng.uniform(-1, 1, 3)
    size = 0.12 * float(rng.choice([1.0, 1.0, 1.0, 1e-3, 3.0]))
    radius = float(rng.choice([0.0, 0.01]))
    place = (float(xyz[0]), float(xyz[1]), float(xyz[2]))
    if kind in ("hull", "sliver", "flat"):
        vertices = size * rng.normal(size=(int(rng.integers(4, 61)), 3))
        if kind == "sliver":
            vertices *= rng.choice([1.0, 1e-3, 1e-6], 3)
        if kind == "flat":
            vertices[:, int(rng.integers(3))] = 0.0
        return pb.Hull(name, link, (vertices + xyz).tolist(), radius)
    if kind == "box":
        rpy = rng.uniform(-3, 3, 3) * float(rng.choice([0.0, 0.0, 1.0]))
        return pb.Box(name, link, place, tuple(rpy.tolist()), tuple((size * rng.uniform(0.1, 2, 3)).tolist()), radius)
    if kind == "capsule":
        return pb.Segment(name, link, place, tuple((xyz + 2 * size * rng.normal(size=3)).tolist()), 0.02)
    if kind == "cylinder":
        return pb.Cylinder(name, link, place, tuple((xyz + 2 * size * rng.normal(size=3)).tolist()), 0.5 * size)
    if kind == "plane":
        return pb.Plane(name, link, place, tuple(rng.normal(size=3).tolist()))
    return pb.Point(name, link, place, 0.02)


def random_robot(
    rng: np.random.Generator, folder: Path, number: int, most: int
) -> tuple[pb.Robot, list[tuple[Any, Any, Any]]]:
    """Return a robot, and pairs of marks that move against each other with their paths."""
    joints = int(rng.integers(2, 6))
    robot = pb.load(write(folder, mechanism(rng, ("planar", "spatial")[number % 2], joints, rng.random() < 0.3)))
    links = ["base", *(f"l{i}" for i in range(joints))]
    marks = [random_mark(rng, f"m{i}", str(rng.choice(links))) for i in range(6)]
    pairs = [
        (a, b)
        for index, a in enumerate(marks)
        for b in marks[:index]
        if a.link != b.link and not (isinstance(a, pb.Plane) and isinstance(b, pb.Plane))
    ]
    chosen = [pairs[index] for index in rng.permutation(len(pairs))[:most]]
    paths = [(pair, relative_path(robot.tree, robot.coupling, *pair)) for pair in chosen]
    return robot, [(*pair, path) for pair, path in paths if path.minimal.coordinates]


def bounded(robot: pb.Robot, pairs: list[tuple[Any, Any, Any]], distances: list[float]) -> pb.Robot:
    boundaries = [
        Boundary(f"beta_{i}", a, b, d, path, robot.coordinates, 2e-5, 0.0, robot.home)
        for i, ((a, b, path), d) in enumerate(zip(pairs, distances, strict=True))
    ]
    return dataclasses.replace(robot, boundaries=BoundarySet(boundaries, robot.coordinates, robot.linear_limits))


def vertices_of(mark: Any) -> Any:
    """Return a mark's vertices in its link, from what was written and not from what pinbound made of it."""
    if isinstance(mark, pb.Hull):
        return np.array(mark.vertices)
    if isinstance(mark, pb.Box):
        corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T * mark.size
        return corners @ pin.rpy.rpyToMatrix(*mark.rpy).T + mark.xyz
    if isinstance(mark, pb.Segment):
        return np.array([mark.xyz_a, mark.xyz_b])
    if isinstance(mark, pb.Cylinder):
        return mark.shape.vertices  # the prism around it is pinbound's own choice, which the notes state
    return np.array([mark.xyz])


def shape_of(vertices: Any) -> Any:
    """Return coal's shape of vertices; None where it has none of that kind that can be trusted."""
    if len(vertices) == 1:
        return coal.Sphere(0.0)
    if len(vertices) == 2:
        return coal.Capsule(THICK, float(np.linalg.norm(vertices[1] - vertices[0])))
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        return None
    if hull.volume < 1e-9 * np.ptp(vertices, axis=0).max() ** 3:
        return None
    points = coal.StdVec_Vec3s()
    points.extend(vertices)
    return coal.Convex.convexHull(points, True, "Qt")


def axis_of(mark: pb.Segment) -> Any:
    """Return where a capsule along z has to be placed to lie on a segment."""
    a, b = np.array(mark.xyz_a), np.array(mark.xyz_b)
    along = (b - a) / np.linalg.norm(b - a)
    across = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    across /= np.linalg.norm(across)
    return pin.SE3(np.column_stack((across, np.cross(along, across), along)), 0.5 * (a + b))


class Oracle:
    """Separations of one robot's pairs by Pinocchio's placements."""

    def __init__(self, robot: pb.Robot, marked: list[tuple[Any, Any, Any]]) -> None:
        pairs = [(a, b) for a, b, _ in marked]
        self.request, self.result = coal.DistanceRequest(), coal.DistanceResult()
        self.robot, self.pairs, self.model = robot, pairs, robot.model  # one copy: each access makes another
        self.data = self.model.createData()
        self.frames: dict[str, int] = {}
        self.towards: dict[int, Any] = {}
        self.vertices = {id(mark): vertices_of(mark) for pair in pairs for mark in pair}
        self.axes = {id(mark): axis_of(mark) for pair in pairs for mark in pair if isinstance(mark, pb.Segment)}
        self.shapes = {id(mark): shape_of(self.vertices[id(mark)]) for pair in pairs for mark in pair}

    def place(self, q: Any) -> None:
        """Place the links; vertices are placed when they are asked for."""
        pin.framesForwardKinematics(self.model, self.data, self.robot.coupling.expand(np.asarray(q)[None])[0])
        self.placed: dict[int, Any] = {}
        self.placed_shapes: dict[int, Any] = {}

    def frame(self, mark: Any) -> Any:
        return self.data.oMf[self.frame_of(mark)]

    def frame_of(self, mark: Any) -> int:
        if mark.link not in self.frames:
            self.frames[mark.link] = self.model.getFrameId(mark.link, pin.BODY)
        return self.frames[mark.link]

    def frames_at(self, Q: Any) -> Any:
        """Return rotation and place of every frame at every q, (N, frames, 12)."""
        found = np.zeros((len(Q), self.model.nframes, 12))
        used = sorted({self.frame_of(mark) for pair in self.pairs for mark in pair})
        for row, theta in enumerate(self.robot.coupling.expand(np.asarray(Q))):
            pin.framesForwardKinematics(self.model, self.data, theta)
            for index in used:
                frame = self.data.oMf[index]
                found[row, index, :9], found[row, index, 9:] = frame.rotation.ravel(), frame.translation
        return found

    def scan(self, pair: int, frames: Any, best: tuple[float, float]) -> tuple[float, float, int]:
        """Return the least of `best` and of what is met at placements (N, frames, 12), and at which; -1 if at none."""
        a, b = self.pairs[pair]
        where, ends = -1, (frames[:, self.frame_of(a)], frames[:, self.frame_of(b)])
        if isinstance(a, pb.Plane) or isinstance(b, pb.Plane):
            plane, (on, off) = (a, ends) if isinstance(a, pb.Plane) else (b, ends[::-1])
            other = self.vertices[id(b if plane is a else a)]
            unit = np.array(plane.normal) / np.linalg.norm(plane.normal)
            heights = lowest(np.asarray(other), off, np.array(plane.xyz), unit, on)
            where = int(np.argmin(heights))
            value = float(heights[where])
            return (value, value, where) if value < best[0] else (*best, -1)
        towards = self.towards.get(pair)
        towards = np.zeros(3) if towards is None else np.asarray(towards)
        rows = np.ascontiguousarray(ends[0]), np.ascontiguousarray(ends[1])
        value, lower, where, unit = nearest_of(self.vertices[id(a)], self.vertices[id(b)], *rows, towards, *best)
        if where >= 0:
            self.towards[pair] = unit
            size = np.abs(self.vertices[id(a)]).max() + np.abs(self.vertices[id(b)]).max() + np.abs(ends).max()
            if value - lower > CLOSE * size:
                placed = [moved(self.vertices[id(mark)], one[where]) for mark, one in zip((a, b), rows, strict=True)]
                tried = shortest(*placed, unit if unit.any() else None)
                value, lower = min(value, tried[0]), max(lower, tried[1])
        return value, lower, where

    def vertices_now(self, mark: Any) -> Any:
        """Return a mark's vertices where its link is now."""
        if id(mark) not in self.placed:
            frame = self.frame(mark)
            self.placed[id(mark)] = self.vertices[id(mark)] @ frame.rotation.T + frame.translation
        return self.placed[id(mark)]

    def rough(self, pair: int) -> float:
        """Return the distance as coal has it, where it has one; of overlapping bodies zero."""
        a, b = self.pairs[pair]
        shapes = self.shapes[id(a)], self.shapes[id(b)]
        if isinstance(a, pb.Plane) or isinstance(b, pb.Plane) or None in shapes:
            return self.exact(pair)[0]
        places, thick = [], 0.0
        for mark in (a, b):
            if id(mark) in self.placed_shapes:
                places.append(self.placed_shapes[id(mark)])
                thick += THICK * isinstance(mark, pb.Segment)
                continue
            place = self.frame(mark)
            if isinstance(mark, pb.Point):
                place = pin.SE3(np.eye(3), place.act(np.array(mark.xyz)))
            if isinstance(mark, pb.Segment):
                place, thick = place * self.axes[id(mark)], thick + THICK
            places.append(coal.Transform3s(place.rotation, place.translation))
            self.placed_shapes[id(mark)] = places[-1]
        self.result.clear()
        found = coal.distance(shapes[0], places[0], shapes[1], places[1], self.request, self.result)
        if found <= COAL:
            return self.exact(pair)[0] if thick else 0.0
        return found + thick

    def floor(self, pair: int) -> float:
        """Return what `rough` is at least: of overlapping bodies coal is taken for zero, of planes nothing."""
        return -np.inf if any(isinstance(mark, pb.Plane) for mark in self.pairs[pair]) else 0.0

    def exact(self, pair: int) -> tuple[float, float]:
        """Return the distance of two points of the bodies, or the height, and a proven lower bound of it."""
        a, b = self.pairs[pair]
        frames = np.zeros((1, self.model.nframes, 12))
        for mark in (a, b):
            index, frame = self.frame_of(mark), self.frame(mark)
            frames[0, index, :9], frames[0, index, 9:] = frame.rotation.ravel(), frame.translation
        return self.scan(pair, frames, (np.inf, np.inf))[:2]


def shortest(A: Any, B: Any, towards: Any = None, above: float = np.inf) -> tuple[float, float, Any]:
    """Return `min |x - y|` over two hulls, a lower bound that its own direction proves, and that direction.

    Of the pairs of vertices only those are kept that were least along a direction so far, until there is no lower one,
    or until the distance is proven to be `above` or more. The first direction is `towards`, or any.
    """
    kept = [A[0] - B[0]] if towards is None else [A[int(np.argmin(A @ towards))] - B[int(np.argmax(B @ towards))]]
    size = float(np.abs(A).max() + np.abs(B).max()) or 1.0
    best, lower = kept[0], 0.0
    if towards is not None:
        lower = float(kept[0] @ towards) - 1e-15 * size
        if lower >= above:
            return max(float(np.linalg.norm(best)), above), lower, towards
        lower = max(lower, 0.0)
    unit = np.zeros(3)
    for _ in range(60):
        upper = float(np.linalg.norm(best))
        if upper <= 1e-16 * size:
            break
        unit = best / upper
        corner = A[int(np.argmin(A @ unit))] - B[int(np.argmax(B @ unit))]
        lower = max(lower, float(corner @ unit))
        if lower - 1e-15 * size >= above or upper - lower <= 1e-15 * size:
            break
        if any(np.array_equal(corner, one) for one in kept):
            break
        kept.append(corner)
        points = np.array(kept)
        weights, _ = nnls(np.vstack((points.T / size, np.ones(len(points)))), np.array([0.0, 0.0, 0.0, 1.0]))
        used = np.flatnonzero(weights > 0.0)
        tried = [weights[used] / weights[used].sum() @ points[used]]
        if len(used) > 1:  # once more, with the corners that are used alone
            edges = points[used[1:]] - points[used[0]]
            shares = np.linalg.lstsq(edges.T, -points[used[0]], rcond=1e-13)[0]
            if shares.min() >= 0.0 and shares.sum() <= 1.0:
                tried.append(points[used[0]] + shares @ edges)
        best = min([*tried, best], key=np.linalg.norm)
    return float(np.linalg.norm(best)), lower, unit if unit.any() else towards


class Campaign:
    """Counts of answers, and of wrong ones."""

    def __init__(self, seed: int, pairs: int) -> None:
        self.rng, self.pairs = np.random.default_rng(seed), pairs
        self.asked: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.open_clearance, self.slowest, self.gap = 0.0, 0.0, 0.0

    def check(self, what: str, ok: bool, *context: Any) -> None:
        self.asked[what] += 1
        if not ok:
            self.wrong.append(f"{what}: {context}")

    def motion(self, n: int) -> tuple[Any, Any, float]:
        rng = self.rng
        start, width = rng.uniform(-2, 2, n), 10.0 ** rng.uniform(-2, 0.3)
        kind = rng.integers(3)
        if kind == 0:
            t, points = np.linspace(0.0, 1.0, 4), start + width * rng.normal(size=(4, n))
            spline = CubicSpline(t, points)
            return spline, spline, 1.0
        if kind == 1:
            rate, phase, swing = rng.uniform(0.5, 3, n), rng.uniform(0, 6, n), 0.3 * width * rng.uniform(0.1, 1, n)

            def wave(t: Any, order: int = 0) -> Any:
                angle = np.asarray(t)[:, None] * rate + phase
                return swing * rate * np.cos(angle) if order else start + swing * np.sin(angle)

            return pb.BoundedMotion(wave, 0.0, 1.0, swing * rate * 1.0001, swing * rate**2 * 1.0001), wave, 1.0
        points = np.cumsum(np.vstack((start, width * rng.normal(size=(int(rng.integers(1, 4)), n)))), axis=0)
        times = np.arange(len(points), dtype=float)

        def along(t: Any) -> Any:
            return np.stack([np.interp(t, times, column) for column in points.T], axis=-1)

        return points, along, float(len(points) - 1)

    def least(self, oracle: Oracle, along: Any, end: float, hints: dict[int, float]) -> list[tuple[float, float]]:
        """Return of each pair the smallest sampled separation, and a lower bound of it there."""
        times = np.linspace(0.0, end, SAMPLES)
        frames = oracle.frames_at(along(times))
        found: list[tuple[float, float]] = []
        for pair in range(len(oracle.pairs)):
            value, lower, row = oracle.scan(pair, frames, (np.inf, np.inf))
            where, width = float(times[row]), end / SAMPLES
            near = np.append(np.clip(where + width * np.array([-0.5, 0.5]), 0.0, end), hints.get(pair, where))
            for _ in range(3):
                value, lower, row = oracle.scan(pair, oracle.frames_at(along(near)), (value, lower))
                where = where if row < 0 else float(near[row])
                width /= 4.0
                near = np.clip(where + width * np.array([-1.0, -0.5, 0.5, 1.0]), 0.0, end)
            self.gap = max(self.gap, value - lower)
            found.append((value, lower))
        if self.rng.random() < 1.0 / 16.0:
            for row in range(0, SAMPLES, 8):
                oracle.place(along(times[row : row + 1])[0])
                for pair in range(len(oracle.pairs)):
                    known = max(oracle.exact(pair)[0], oracle.floor(pair))
                    apart, size = abs(oracle.rough(pair) - known), max(1.0, abs(known))
                    self.check("the oracle agrees with coal", apart <= COAL * size, oracle.pairs[pair], apart)
        return found

    def run(self, folder: Path, number: int) -> None:
        rng = self.rng
        bare, pairs = random_robot(rng, folder, number, self.pairs)
        if not pairs:
            return
        oracle = Oracle(bare, pairs)
        budget = pb.Budget(boxes=20_000, seconds=2.0)
        zero = bounded(bare, pairs, [0.0] * len(pairs))
        n = len(bare.coordinates)
        for _ in range(MOTIONS):
            motion, along, end = self.motion(n)
            first = pb.certify(zero, motion, None, None, budget, limits=False)
            hints = {i: float(np.clip(one.time, 0.0, end)) for i, one in enumerate(first.boundaries)}
            least = self.least(oracle, along, end, hints)
            self.judge(zero, first, least, oracle)
            sizes: list[float] = []
            for boundary, (value, _) in zip(zero.boundaries, least, strict=True):
                depth = float(rng.choice([-1.0, 1.0])) * 10.0 ** rng.uniform(-9, -2)
                sizes.append(max(value - boundary.threshold + depth, 0.0))
            tried = bounded(bare, pairs, sizes)
            again = pb.certify(tried, motion, None, None, budget, limits=False)
            self.judge(tried, again, least, oracle)
            self.box(tried, along(np.array([end / 2]))[0], oracle)
        if rng.random() < 0.05:
            self.limits(zero, oracle)

    def judge(self, robot: pb.Robot, found: Any, least: list[tuple[float, float]], oracle: Oracle) -> None:
        self.asked["motions"] += 1
        self.slowest = max(self.slowest, found.seconds)
        for pair, (one, (value, _)) in enumerate(zip(found.boundaries, least, strict=True)):
            boundary = robot.boundaries[one.name]
            size = ROUNDING * max(1.0, boundary.path.minimal.scale)
            clearance = value - boundary.contact_distance
            self.asked[f"motion {one.verdict.value}"] += 1
            false = one.verdict is pb.Verdict.CERTIFIED and clearance <= -size
            self.check("no false CERTIFIED", not false, boundary, clearance, one.lower)
            self.check("lower bound below every sample", one.lower <= clearance + size, boundary, one.lower - clearance)
            if one.contact is not None:
                oracle.place(one.contact.q)
                met, below = oracle.exact(pair)
                there = met - boundary.contact_distance
                self.check("VIOLATED has a witness", there < size + met - below, boundary, there)
            if one.verdict is pb.Verdict.UNDECIDED:
                self.open_clearance = max(self.open_clearance, abs(clearance))

    def box(self, robot: pb.Robot, centre: Any, oracle: Oracle) -> None:
        half = 10.0 ** self.rng.uniform(-4, -1)
        box = pb.certify_box(
            robot, centre - half, centre + half, None, pb.Budget(boxes=3_000, seconds=0.5), limits=False
        )
        self.asked[f"box {box.verdict.value}"] += 1
        if box.verdict is pb.Verdict.CERTIFIED:
            for q in centre + half * np.clip(self.rng.uniform(-1.3, 1.3, (6, len(centre))), -1, 1):
                oracle.place(q)
                for pair, boundary in enumerate(robot.boundaries):
                    size = ROUNDING * max(1.0, boundary.path.minimal.scale)
                    clearance = oracle.exact(pair)[0] - boundary.contact_distance
                    self.check("no false box", clearance > -size and clearance >= box.lower - size, boundary, clearance)
        if box.witness is not None:
            oracle.place(box.witness)
            pair = list(robot.boundaries.names).index(str(box.violated))
            boundary = robot.boundaries[pair]
            value, below = oracle.exact(pair)
            size = ROUNDING * max(1.0, boundary.path.minimal.scale)
            there = value - boundary.contact_distance
            self.check("box VIOLATED has a witness", there < size + value - below, boundary, there)

    def limits(self, robot: pb.Robot, oracle: Oracle) -> None:
        q = self.rng.uniform(-2, 2, len(robot.coordinates))
        for pair, boundary in enumerate(robot.boundaries):
            j = int(self.rng.integers(len(q)))
            line = np.linspace(-3.1, 3.1, 24)
            values: list[float] = []
            for x in line:
                q[j] = x
                oracle.place(q)
                values.append(oracle.exact(pair)[0])
            depth = float(self.rng.choice([-1, 1])) * 10.0 ** self.rng.uniform(-9, -3)
            size = max(float(self.rng.choice(values)) - boundary.threshold + depth, 0.0)
            tried = dataclasses.replace(boundary, min_distance=size)
            room = 10 * ROUNDING * max(1.0, boundary.path.minimal.scale)
            try:
                arcs = tried.limits(robot.coordinates[j], q, window=(-4.0, 4.0))
            except pb.UnsupportedError as error:
                self.asked[f"limits refused: {' '.join(str(error).split()[-8:])}"] += 1
                continue
            for x, value in zip(line, values, strict=True):
                gap = value - tried.contact_distance
                if abs(gap) > room:
                    self.check("limits", arcs.contains(float(x)) == (gap > 0.0), tried, q, j, x, gap)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000, help="motions of each seed")
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, default=1, help="how many seeds, one after the other")
    parser.add_argument("--pairs", type=int, default=10, help="boundaries of each robot, at most")
    parser.add_argument("--seconds", type=float, default=np.inf, help="stop after so many, whatever the count")
    arguments = parser.parse_args()
    started, wrong, total = time.perf_counter(), 0, Counter[str]()
    for seed in range(arguments.seed, arguments.seed + arguments.seeds):
        campaign, number, began = Campaign(seed, arguments.pairs), 0, (time.perf_counter(), time.process_time())
        with tempfile.TemporaryDirectory() as folder:
            while campaign.asked["motions"] < arguments.count and time.perf_counter() - started < arguments.seconds:
                campaign.run(Path(folder), number)
                number += 1
        total += campaign.asked
        for line in campaign.wrong[:20]:
            print(line)
        for what, count in sorted((campaign.asked if arguments.seeds == 1 else total).items()):
            print(f"{count:9d}  {what}")
        print(f"{number} robots, seed {seed}; slowest certificate {campaign.slowest:.2f} s")
        print(f"largest clearance of an undecided boundary {campaign.open_clearance:.1e} m")
        print(f"largest gap between the oracle's own bounds {campaign.gap:.1e} m")
        wall, processor = time.perf_counter() - began[0], time.process_time() - began[1]
        wrong += len(campaign.wrong)
        print(f"{wrong} wrong answers; this seed took {wall:.0f} s, processor {processor:.1f} s", flush=True)
        if wrong or time.perf_counter() - started > arguments.seconds:
            break
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
