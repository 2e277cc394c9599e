"""Hulls in batches: the Panda's 17 collision bodies, against Pinocchio and coal on the same hulls, in one run.

python -m benchmarks.hulls [--rows 2000] [--repetitions 7]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pinocchio as pin

import pinbound as pb
from benchmarks.segments_speed import SHARE
from pinbound.kernel import MixedKernel, Pair, Reference, kernel_of
from pinbound.path.relative import relative_path

URDF = SHARE / "example-robot-data/robots/panda_description/urdf/panda.urdf"


def bodies() -> tuple[Any, Any, list[np.ndarray]]:
    """Return Pinocchio's model, its bodies as coal's hulls, and their vertices; pairs that a joint joins are out."""
    model = pin.buildModelFromUrdf(str(URDF))
    geometry = pin.buildGeomFromUrdf(model, str(URDF), pin.COLLISION, package_dirs=[str(SHARE)])
    vertices: list[np.ndarray] = []
    for body in geometry.geometryObjects:
        shape = body.geometry
        if isinstance(shape, coal.Box):
            corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * np.array(shape.halfSide)
        else:
            corners = np.array(shape.vertices())
        points = coal.StdVec_Vec3s()
        for corner in corners:
            points.append(corner)
        body.geometry = coal.Convex.convexHull(points, True, "Qt")
        vertices.append(corners)
    geometry.addAllCollisionPairs()
    for pair in list(geometry.collisionPairs):
        first, second = (geometry.geometryObjects[k].parentJoint for k in (pair.first, pair.second))
        if model.parents[first] == second or model.parents[second] == first:
            geometry.removeCollisionPair(pair)
    return model, geometry, vertices


def kernel(robot: pb.Robot, model: Any, geometry: Any, vertices: list[np.ndarray]) -> MixedKernel:
    """Return the batch kernel of the same pairs; some of them overlap at any home, so that no robot could hold them."""
    marks: list[pb.Hull] = []
    for number, (body, corners) in enumerate(zip(geometry.geometryObjects, vertices, strict=True)):
        frame = model.frames[body.parentFrame]
        placement = frame.placement.inverse() * body.placement
        placed = corners @ placement.rotation.T + placement.translation
        marks.append(pb.Hull(f"body{number}", frame.name, tuple(map(tuple, placed.tolist()))))
    pairs = [
        Pair(relative_path(robot.tree, robot.coupling, marks[p.first], marks[p.second]), 0.0, ("", ""))
        for p in geometry.collisionPairs
    ]
    made = kernel_of(pairs, len(robot.coordinates), Reference(), _nothing)
    assert isinstance(made, MixedKernel)
    return made


def _nothing() -> None:
    return None


def main() -> None:
    """Print times and how far distances are from coal's."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=2_000)
    parser.add_argument("--repetitions", type=int, default=7)
    options = parser.parse_args()
    robot = pb.load(URDF)
    model, geometry, vertices = bodies()
    batch = kernel(robot, model, geometry, vertices)
    data, geometry_data = model.createData(), pin.GeometryData(geometry)
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (options.rows, len(robot.coordinates)))
    theta = robot.coupling.expand(Q)
    print(
        f"{len(vertices)} hulls, {sum(map(len, vertices))} vertices, {len(batch.pairs)} pairs, {len(Q)} configurations"
    )
    start = time.process_time()
    batch.prepare()
    print(f"machine code ready after {time.process_time() - start:.2f} s of processor time")

    def distances() -> np.ndarray:
        found = np.empty((len(Q), len(batch.pairs)))
        for row, angles in enumerate(theta):
            pin.computeDistances(model, data, geometry, geometry_data, angles)
            found[row] = [result.min_distance for result in geometry_data.distanceResults]
        return found

    def unread() -> None:
        for angles in theta:
            pin.computeDistances(model, data, geometry, geometry_data, angles)

    for request in geometry_data.distanceRequests:
        request.gjk_tolerance = 1e-9
    theirs, ours = distances(), batch.rows(Q, "norms", backend="compiled")
    apart = (theirs > 1e-6) | (ours > 0.0)
    print(f"largest difference to coal (asked for 1e-9 m): {np.abs(theirs - ours)[apart].max():.2e} m")
    least, index = batch.smallest(Q, backend="compiled")
    assert np.array_equal(least, ours.min(axis=1)) and np.array_equal(index, ours.argmin(axis=1))  # noqa: PT018
    for request in geometry_data.distanceRequests:
        request.gjk_tolerance = 1e-6
    jobs: dict[str, Callable[[], Any]] = {
        "pin.computeDistances": unread,
        "smallest clearance and its pair": lambda: batch.smallest(Q, backend="compiled"),
        "all distances": lambda: batch.rows(Q, "norms", backend="compiled"),
        "all gradients": lambda: batch.rows(Q, "gradients", backend="compiled"),
    }
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(options.repetitions + 1):
        for name, job in jobs.items():
            start = time.process_time()
            job()
            times[name].append((time.process_time() - start) / len(Q) * 1e6)
    peer = np.array(times["pin.computeDistances"][1:])
    for name, found in times.items():
        own = np.array(found[1:])
        print(f"  {name:32} {np.median(own):8.1f} us  {np.median(own / peer):6.3f} of coal's")


if __name__ == "__main__":
    main()
