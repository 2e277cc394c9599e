"""Capsules and boxes in batches, against Pinocchio and coal on the same shapes, interleaved in one run.

python benchmarks/segments_speed.py [--rows 50000] [--repetitions 7]
"""

from __future__ import annotations

import argparse
import importlib.metadata
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import pinbound as pb
from pinbound.crosscheck.engine import point_engine

SHARE = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = {
    "panda_collision": "panda_description/urdf/panda_collision.urdf",
    "a1": "a1_description/urdf/a1.urdf",
}


def marked(path: Path, keep: Callable[[Any], bool]) -> pb.Robot:
    """Return a robot with the proposed marks that are kept."""
    found = pb.propose_marks(pb.load(path), 0.001).annotations
    marks = {name: mark for name, mark in found.marks.items() if keep(mark)}
    pairs = [boundary for boundary in found.boundaries if boundary.a in marks and boundary.b in marks]
    return pb.load(path, annotations=pb.Annotations.of(marks.values(), pairs, home=found.home))


def measure(robot: pb.Robot, rows: int, repetitions: int, backend: Any) -> dict[str, float]:
    """Return medians of interleaved processor times [ns a configuration]."""
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (rows, len(robot.coordinates)))
    engine, few = point_engine(robot), Q[: max(50, rows // 500)]
    model, data, geometry, geometry_data = engine._model, engine._data, engine._geometry, engine._geometry_data
    theta = robot.coupling.expand(few)
    jobs: dict[str, tuple[Callable[[], Any], int]] = {
        "all clearances": (lambda: robot.boundaries.clearances(Q, backend=backend), rows),
        "smallest clearance": (lambda: robot.boundaries.kernel.smallest(Q, False, None, 1, backend), rows),
        "pin.computeDistances": (
            lambda: [pin.computeDistances(model, data, geometry, geometry_data, t) for t in theta],
            len(few),
        ),
        "pin.computeCollisions": (
            lambda: [pin.computeCollisions(model, data, geometry, geometry_data, t, True) for t in theta],
            len(few),
        ),
    }
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(repetitions + 1):
        for name, (job, count) in jobs.items():
            start = time.process_time()
            job()
            times[name].append((time.process_time() - start) / count * 1e9)
    return {name: float(np.median(found[1:])) for name, found in times.items()}


def main() -> None:
    """Print both robots."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=50_000)
    parser.add_argument("--repetitions", type=int, default=7)
    options = parser.parse_args()
    public = SHARE / "example-robot-data/robots"
    capsules = marked(public / ROBOTS["panda_collision"], lambda mark: not isinstance(mark, pb.Sweep))
    boxes = marked(public / ROBOTS["a1"], lambda _: True)
    for name, robot, rows, backend in (
        ("panda_collision, capsules and spheres, compiled", capsules, options.rows, "compiled"),
        ("a1, boxes, prisms and spheres, searched", boxes, max(200, options.rows // 200), "auto"),
    ):
        found = measure(robot, rows, options.repetitions, backend)
        print(f"{name}: {len(robot.boundaries)} pairs, {rows} configurations")
        for job, value in found.items():
            print(f"  {job:24} {value:12,.0f} ns  {value / found['smallest clearance']:8.1f}")


if __name__ == "__main__":
    main()
