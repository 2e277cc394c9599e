"""Distances and depths of random hulls against coal's on the same hulls, placed by Pinocchio; outside the test suite.

python -m benchmarks.hull_samples [--samples 1000000] [--depths 20000] [--seed 0]

Pairs of hulls with 4 to 500 vertices: round, flat, slivers a million times longer than thick, boxes whose faces are
parallel, one inside the other. Half of the samples are placed so that the bodies touch, or nearly do. Where coal and
pinbound differ by more than 1e-9 m, two proofs decide, written here and shared with neither: any point of each body
gives an upper bound of the distance, any direction a lower one.
"""

from __future__ import annotations

import argparse
import collections
import functools
import itertools
import time
from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import scipy.optimize
import scipy.spatial

import pinbound as pb
from pinbound.geometry.exact_nearest import nearest_exactly

AGREED, DEEP = 1e-9, 1e-6  # [m]
SLACK = 1e-12  # [m], rounding of the bounds that decide
DECIDED = 1.1e-9  # [m], the widest proof that decides: coal says zero up to 1e-7 m, and gaps of 1e-9 m are placed
PAIRS, NEAR, ANYWHERE = 12, 20, 240
GAPS = (0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, -1e-9, -1e-6, -1e-3)
URDF = """<robot name="free_body"><link name="world"/>{links}{joints}<link name="body"/></robot>"""
AXES = (
    ("x", "prismatic"),
    ("y", "prismatic"),
    ("z", "prismatic"),
    ("a", "revolute"),
    ("b", "revolute"),
    ("c", "revolute"),
)


def urdf() -> str:
    """Return the URDF of a body that slides and turns freely over the world."""
    links, joints, parent = "", "", "world"
    for number, (name, kind) in enumerate(AXES):
        child = "body" if number == len(AXES) - 1 else f"l{name}"
        links += f'<link name="{child}"/>' if child != "body" else ""
        axis = " ".join("1" if k == number % 3 else "0" for k in range(3))
        reach = 20.0 if kind == "prismatic" else 3.2
        joints += (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
            f'<limit lower="-{reach}" upper="{reach}" effort="1" velocity="1"/></joint>'
        )
        parent = child
    return URDF.format(links=links, joints=joints)


def shape(rng: np.random.Generator, kind: str) -> np.ndarray:
    """Return vertices (k, 3) [m] of a hull of a kind."""
    if kind == "box":
        return np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T * rng.uniform(0.05, 0.4, 3)
    if kind == "flat":
        points = rng.normal(size=(int(rng.integers(3, 40)), 3))
        points[:, 2] = 0.0
        return points / np.linalg.norm(points, axis=1)[:, None] * 0.3 @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    count = 4 if kind == "tetrahedron" else int(10 ** rng.uniform(0.7, 2.7))
    points = rng.normal(size=(count, 3))
    points *= rng.uniform(0.05, 0.4, 3) / np.linalg.norm(points, axis=1)[:, None]
    if kind == "sliver":
        points[:, 1:] *= 10.0 ** rng.uniform(-6, -2, 2)
        points = points @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return points


KINDS = ("tetrahedron", "round", "round", "flat", "sliver", "box")


def convex(vertices: np.ndarray) -> Any:
    """Return coal's hull with triangles by Qhull: of flat ones both sides (coal's own Qhull ends the interpreter)."""
    centred = vertices - vertices.mean(axis=0)
    _, sizes, turn = np.linalg.svd(centred, full_matrices=False)
    if sizes[2] > 1e-9 * sizes[0]:
        triangles = scipy.spatial.ConvexHull(
            vertices / sizes[0] @ turn.T / (sizes / sizes[0]), qhull_options="Qt"
        ).simplices
    else:
        rim = scipy.spatial.ConvexHull(centred @ turn[:2].T).vertices
        triangles = np.array([(rim[0], rim[k], rim[k + 1]) for k in range(1, len(rim) - 1)])
        triangles = np.concatenate((triangles, triangles[:, ::-1]))
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    used, index = np.unique(triangles, return_inverse=True)
    for vertex in vertices[used]:
        points.append(vertex)
    for i, j, k in index.reshape(-1, 3).tolist():
        faces.append(coal.Triangle(i, j, k))
    return coal.Convex(points, faces)


class Coal:
    """Distances of two hulls by coal."""

    def __init__(self, a: np.ndarray, b: np.ndarray) -> None:
        self.vertices = (a, b)
        self.bodies = (convex(a), convex(b))
        self.request = coal.DistanceRequest(True)
        self.request.gjk_tolerance, self.request.epa_tolerance = 1e-12, 1e-9
        self.request.gjk_max_iterations, self.request.epa_max_iterations = 1000, 256

    def distance(self, place: Any) -> tuple[float, np.ndarray]:
        """Return the signed distance, and the direction from a to b, with b placed."""
        result = coal.DistanceResult()
        found = coal.distance(self.bodies[0], coal.Transform3s(), self.bodies[1], place, self.request, result)
        return found, np.array(result.normal)


def bounds(a: np.ndarray, b: np.ndarray, normals: tuple[np.ndarray, ...]) -> tuple[float, float]:
    """Return a lower and an upper bound of the distance of two hulls.

    Weights of vertices (from non-negative least squares, and from whole numbers) are points of the bodies, whoever
    proposes them: an upper bound. The least of `n . b` less the greatest of `n . a` is a lower one, for any n: the
    direction between those points, coal's normals, and products of edges, which stay sharp where the bodies touch.
    """
    weight = 1e4 * (np.abs(a).max() + np.abs(b).max())
    matrix = np.block(
        [
            [a.T, -b.T],
            [weight * np.ones((1, len(a))), np.zeros((1, len(b)))],
            [np.zeros((1, len(a))), weight * np.ones((1, len(b)))],
        ]
    )
    found, _ = scipy.optimize.nnls(matrix, np.array([0.0, 0.0, 0.0, weight, weight]), maxiter=50 * matrix.shape[1])
    exact = nearest_exactly(np.zeros(3), np.concatenate((a, -b)), _choices(len(a), len(b)))
    lower, upper = 0.0, np.inf
    for shares in (found, exact):
        one, two = np.maximum(shares[: len(a)], 0.0), np.maximum(shares[len(a) :], 0.0)
        apart = two @ b / two.sum() - one @ a / one.sum()
        upper = min(upper, float(np.linalg.norm(apart)))
        edges = [corner - side[0] for side in (a[one > 1e-9], b[two > 1e-9]) for corner in side[1:]]
        crossed = [sign * np.cross(e, f) for e, f in itertools.combinations(edges, 2) for sign in (1.0, -1.0)]
        for normal in (apart, *normals, *crossed):
            size = float(np.linalg.norm(normal))
            if size > 0.0:
                lower = max(lower, float((b @ normal).min() - (a @ normal).max()) / size)
    return lower, upper


def _choices(k: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    return np.eye(k), np.eye(m)


class Tally:
    """What was seen so far."""

    def __init__(self) -> None:
        self.counts: collections.Counter[str] = collections.Counter()
        self.worst: dict[str, float] = collections.defaultdict(float)

    def distance(self, kinds: str, ours: float, theirs: float, proof: Callable[[], tuple[float, float]]) -> None:
        """Count one distance; where coal differs, the proof decides."""
        self.counts["samples"] += 1
        self.counts["touching, or nearer than 1e-6 m"] += ours < 1e-6
        difference = abs(ours - max(theirs, 0.0))
        if difference <= AGREED:
            self._worst("difference where both agree", difference)
            return
        lower, upper = proof()
        if not lower - SLACK <= ours <= upper + SLACK:
            self.counts["PINBOUND WRONG"] += 1
            print(f"wrong: {kinds}: {ours!r}, coal {theirs!r}, proof [{lower!r}, {upper!r}]", flush=True)
        elif upper - lower <= DECIDED:
            zero = "says zero" if theirs <= 0.0 else "differs"
            self.counts[f"coal {zero}, and is proven wrong"] += 1
            self._worst(f"coal {zero}, off by", difference)
        else:
            self.counts["not decided"] += 1
            self._worst("width of the proof where it does not decide", upper - lower)

    def depth(self, kinds: str, ours: float, left: float, theirs: float) -> None:
        """Count one depth; `left` is the gap after the body was moved out by it."""
        self.counts["depths"] += 1
        if abs(left) > AGREED:
            self.counts["DEPTH WRONG"] += 1
            print(f"depth: {kinds} {ours!r} leaves {left!r}", flush=True)
        if abs(ours - theirs) <= DEEP:
            self._worst("difference of depths where both agree", abs(ours - theirs))
            return
        self.counts[f"depths proven, {'less' if ours < theirs else 'MORE'} than coal's by more than 1e-6 m"] += 1
        self._worst("depth, difference from coal's", abs(ours - theirs))

    def _worst(self, what: str, value: float) -> None:
        self.worst[what] = max(self.worst[what], value)

    def show(self) -> None:
        """Print all."""
        for what, count in self.counts.items():
            print(f"{count:>9}  {what}")
        for what, value in self.worst.items():
            print(f"{value:9.1e}  {what} [m]")


class Round:
    """Twelve pairs of hulls on one robot, and where they are placed."""

    def __init__(self, rng: np.random.Generator, text: str, model: Any) -> None:
        kinds = [(KINDS[rng.integers(len(KINDS))], KINDS[rng.integers(len(KINDS))]) for _ in range(PAIRS)]
        self.kinds = ["/".join(sorted(pair)) for pair in kinds]
        self.vertices = [(shape(rng, first), shape(rng, second)) for first, second in kinds]
        self.peers = [Coal(*pair) for pair in self.vertices]
        marks = [
            pb.Hull(f"{side}{number}", link, tuple(map(tuple, pair[k].tolist())))
            for number, pair in enumerate(self.vertices)
            for k, (side, link) in enumerate((("a", "world"), ("b", "body")))
        ]
        watched = tuple(pb.BoundaryMark(f"p{number}", f"a{number}", f"b{number}") for number in range(PAIRS))
        annotations = pb.Annotations.of(marks, watched, home={"x": 10.0})
        self.boundaries = pb.load(text, annotations=annotations).boundaries
        rows = PAIRS * NEAR + ANYWHERE
        self.Q = np.column_stack((rng.uniform(-0.6, 0.6, (rows, 3)), rng.uniform(-np.pi, np.pi, (rows, 3))))
        self.Q[rng.random(rows) < 0.15, 3:] = 0.0  # faces of boxes are parallel
        self.Q[rng.random(rows) < 0.05, :3] = 0.0  # nested
        data, body = model.createData(), model.getFrameId("body")
        self.places = [self._place(row, model, data, body) for row in range(rows)]

    def _place(self, row: int, model: Any, data: Any, body: int) -> Any:
        pin.framesForwardKinematics(model, data, self.Q[row])
        place = coal.Transform3s(data.oMf[body].rotation, data.oMf[body].translation)
        if row >= PAIRS * NEAR:
            return place
        found, normal = self.peers[row // NEAR].distance(place)
        if found <= 0.0:
            return place
        self.Q[row, :3] += (GAPS[row % len(GAPS)] - found) * normal  # the distance changes one to one that way
        pin.framesForwardKinematics(model, data, self.Q[row])
        return coal.Transform3s(data.oMf[body].rotation, data.oMf[body].translation)

    def compare(self, tally: Tally, chosen: np.ndarray) -> None:
        """Compare all distances, and the depths of the chosen rows."""
        norms = self.boundaries.norms(self.Q)
        nth = np.cumsum(chosen) - 1
        for number, (peer, (a, b)) in enumerate(zip(self.peers, self.vertices, strict=True)):
            deep = self.boundaries[f"p{number}"].penetration(self.Q[chosen])
            for row, place in enumerate(self.places):
                theirs, normal = peer.distance(place)
                placed = b @ place.getRotation().T + place.getTranslation()
                kinds, ours = self.kinds[number], float(norms[row, number])
                tally.distance(kinds, ours, theirs, functools.partial(bounds, a, placed, (normal, -normal)))
                if chosen[row] and ours == 0.0:
                    depth, n = float(deep.depth[nth[row]]), deep.direction[nth[row]]
                    tally.depth(kinds, depth, float((a @ n).min() + depth - (placed @ n).max()), -theirs)


def main() -> None:
    """Print how many samples differ from coal's, and who is right."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--depths", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    text = urdf()
    model = pin.buildModelFromXML(text)
    tally = Tally()
    began = time.process_time()
    while tally.counts["samples"] < options.samples:
        one = Round(rng, text, model)
        one.compare(tally, rng.random(len(one.Q)) < options.depths / options.samples * 4.0)
    print(f"seed {options.seed}, {time.process_time() - began:.0f} s of CPU")
    tally.show()


if __name__ == "__main__":
    main()
