"""Each peer as a function of nothing, prepared for one robot and one set of configurations, and its nanoseconds."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.robots import geometry_of
from pinbound.kernel.program import _basis

Call = Callable[[], object]

SOURCE = Path(__file__).with_name("hand_written.c")


def interleaved(calls: dict[str, tuple[Call, int]], repetitions: int, wall: bool = False) -> dict[str, np.ndarray]:
    """Time all calls in turn, again and again; return ns a configuration, one entry a repetition.

    Processor time, which a busy machine distorts least and which equals wall time for one thread on an idle one; or
    wall time, for several threads.
    """
    clock = time.perf_counter if wall else time.process_time
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call, _ in calls.values():
        call()
    for _ in range(repetitions):
        for name, (call, rows) in calls.items():
            start = clock()
            call()
            times[name].append(1e9 * (clock() - start) / rows)
    return {name: np.array(values) for name, values in times.items()}


def kernel(
    robot: Any, Q: Any, mode: str = "norms", backend: str = "compiled", threads: int = 1, dtype: Any = None
) -> Call:
    B, real = robot.boundaries, dtype or np.float64
    if mode in ("norms", "clearances"):
        out = np.empty((len(Q), len(B)), order="F", dtype=real)
        return lambda: getattr(B, mode)(Q, out, backend=backend, threads=threads, dtype=real)
    if mode == "gradients":
        slopes = np.empty((len(Q), len(B), len(robot.coordinates)), dtype=real)
        return lambda: B.gradients(Q, slopes, backend=backend, threads=threads, dtype=real)
    least = np.empty(len(Q), dtype=real)
    with_index = mode == "smallest"
    return lambda: B.kernel.smallest(Q, with_index, least, threads, backend, real)


def pair_by_pair(robot: Any, Q: Any) -> Call:
    return lambda: np.stack([boundary.norm(Q) for boundary in robot.boundaries], axis=1)


def placements_loop(robot: Any, Q: Any) -> Call:
    """What a user writes today: forward kinematics, two placements a pair, a norm, in Python."""
    model, data = robot.model, robot.model.createData()
    theta = robot.coupling.expand(Q)
    pairs = [
        (
            model.getFrameId(b.point_a.link),
            np.array(b.point_a.xyz),
            model.getFrameId(b.point_b.link),
            np.array(b.point_b.xyz),
        )
        for b in robot.boundaries
    ]

    def run() -> Any:
        out = np.empty((len(Q), len(pairs)))
        for i, q in enumerate(theta):
            pin.framesForwardKinematics(model, data, q)
            for k, (a, x, b, y) in enumerate(pairs):
                out[i, k] = np.linalg.norm(data.oMf[a].act(x) - data.oMf[b].act(y))
        return out

    return run


def collisions_in_parallel(robot: Any, Q: Any, threads: int = 1) -> Call:
    """Pinocchio's C++ batch: yes or no for each configuration."""
    model, geometry = geometry_of(robot, None if any(b.threshold for b in robot.boundaries) else 1e-6)
    pool = pin.GeometryPool(model, geometry, threads)
    theta = np.asfortranarray(robot.coupling.expand(Q).T)
    return lambda: pin.computeCollisionsInParallel(threads, pool, theta, True)


def compute_distances(robot: Any, Q: Any) -> Call:
    model, geometry = geometry_of(robot, 1e-6)
    data, geometry_data = model.createData(), geometry.createData()
    theta = robot.coupling.expand(Q)

    def run() -> Any:
        out = np.empty((len(theta), len(robot.boundaries)))
        for i, q in enumerate(theta):
            pin.computeDistances(model, data, geometry, geometry_data, q)
            out[i] = [result.min_distance for result in geometry_data.distanceResults]
        return out

    return run


def coal_pair_by_pair(robot: Any, Q: Any) -> Call:
    import coal

    model, geometry = geometry_of(robot, 1e-6)
    data, geometry_data = model.createData(), geometry.createData()
    theta = robot.coupling.expand(Q)
    pairs = [(p.first, p.second) for p in geometry.collisionPairs]
    shapes = [item.geometry for item in geometry.geometryObjects]

    def run() -> Any:
        out = np.empty((len(theta), len(pairs)))
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        for i, q in enumerate(theta):
            pin.updateGeometryPlacements(model, data, geometry, geometry_data, q)
            places = [coal.Transform3s(m.rotation, m.translation) for m in geometry_data.oMg]
            for k, (a, b) in enumerate(pairs):
                result.clear()
                out[i, k] = coal.distance(shapes[a], places[a], shapes[b], places[b], request, result)
        return out

    return run


def compiler() -> str | None:
    return shutil.which("gcc") or shutil.which("clang")


def hand_written(robot: Any, Q: Any) -> dict[str, Call]:
    """The C kernel, where a compiler is found; checked against pinbound before it is timed."""
    found = compiler()
    if found is None:
        return {}
    folder = Path(tempfile.mkdtemp())
    library = folder / "hand_written.so"
    flags = ["-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC"]
    wide = ["-mprefer-vector-width=512"]
    subprocess.run([found, *flags, *wide, "-o", str(library), str(SOURCE), "-lm"], check=True)
    code = ctypes.CDLL(str(library))
    angles = {(0.0, 0.0, 1.0): 0, (0.0, 1.0, 0.0): 1, (0.0, -1.0, 1.0): 2}
    which = np.zeros(10, np.int32)
    px, py, length = np.zeros(10), np.zeros(10), np.zeros(10)
    for k, boundary in enumerate(robot.boundaries):
        chain = boundary.path.minimal
        key, sign = tuple(chain.coefficients[0]), 1.0
        if key not in angles:
            key, sign = tuple(-c + 0.0 for c in key), -1.0
        basis = _basis(chain.axes[0], -chain.offsets[1])
        p, s = basis.T @ chain.offsets[0], basis.T @ chain.offsets[1]
        which[k], px[k], py[k], length[k] = angles[key], p[0], sign * p[1], -s[0]
    rows, least = np.empty((10, len(Q))), np.empty(len(Q))
    tail = [ctypes.c_void_p(array.ctypes.data) for array in (which, px, py, length)]

    def call(function: Any, out: Any) -> Call:
        head = (ctypes.c_void_p(Q.ctypes.data), ctypes.c_void_p(out.ctypes.data), ctypes.c_size_t(len(Q)))
        keep = (which, px, py, length, out, Q)
        return lambda: (function(*head, *tail), keep)

    calls = {"norms": call(code.ten_norms, rows), "least": call(code.least_norm, least)}
    for run in calls.values():
        run()
    expected = robot.boundaries.norms(Q, backend="numpy")
    if not np.allclose(rows.T, expected, rtol=0, atol=1e-15) or not np.allclose(
        least, expected.min(axis=1), atol=1e-15
    ):
        raise RuntimeError("the hand-written kernel computes something else")
    return calls
