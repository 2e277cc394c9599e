"""Bounds over cells near the cut of a loop's turn, against samples on both sides of it.

python -m benchmarks.loops_cuts [robots] [seed]
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import pinbound as pb
from linkages import KINDS, scene
from pinbound.loops.through_loops import LoopBounds, LoopContact, LoopLimit
from pinbound.region.slice import slice_of

_SAMPLES = 60


def compared(robot: pb.Robot, rng: np.random.Generator) -> tuple[int, int, int]:
    """Return how many values were compared, how many of their cells lay across a cut, and how many were outside."""
    names = tuple(rng.choice(robot.coordinates, 2, replace=False).tolist())
    try:
        plane = slice_of(robot, names, robot.home, dict.fromkeys(names, (-math.pi, math.pi)))
    except pb.PinboundError:  # home is outside the window
        return 0, 0, 0
    lifted = plane.lifted
    curves = [one for one in plane.curves if isinstance(one, LoopContact | LoopLimit)]
    turns = [columns[3] for columns in lifted.lift.columns if len(columns) > 3] if lifted is not None else []
    if lifted is None or not turns or not curves:
        return 0, 0, 0
    X = rng.uniform(*plane.window, (3000, 2))
    X = X[(np.abs(lifted.lifted(X)[:, turns]) > math.pi - 0.4).any(axis=1)][:40]
    if not len(X):
        return 0, 0, 0
    half = 10.0 ** rng.uniform(-3.0, -0.3, len(X))[:, None] * rng.uniform(0.2, 1.0, X.shape)
    m = len(curves)
    bounds = LoopBounds(curves, *plane.window)
    found = bounds.bounds(np.tile(np.arange(m), len(X)), np.repeat(X, m, axis=0), np.repeat(half, m, axis=0))
    lower, upper = (one.reshape(-1, m) for one in found)
    turned = lifted.lifted(X)[:, turns]
    values, jumps, wrong = 0, 0, 0
    for _ in range(_SAMPLES):
        Y = np.clip(X + half * rng.uniform(-1.0, 1.0, half.shape), *plane.window)
        Z = lifted.lifted(Y)
        kept = np.ones(len(Y), dtype=np.bool_)  # beyond a toggle there is no robot
        for one, columns in zip(lifted.lift.linkages, lifted.lift.columns, strict=True):
            low, high = one.transmission_range
            kept &= (Z[:, columns[2]] >= low) & (Z[:, columns[2]] <= high)
        V = np.stack([one.value(Y) for one in curves], axis=1)
        wrong += int(np.sum(((V < lower - 1e-12) | (V > upper + 1e-12)) & kept[:, None]))
        values += int(kept.sum()) * m
        jumps += int((np.abs(Z[:, turns] - turned) > math.pi).any(axis=1).sum())
    return values, jumps, wrong


def main(count: int, seed: int) -> None:
    """Print what was compared, and end with 1 if a value was outside its bounds."""
    rng, total = np.random.default_rng(seed), np.zeros(3, dtype=np.int64)
    for number in range(count):
        robot = scene(list(KINDS)[number % len(KINDS)], rng, pb.load)
        if len(robot.coordinates) > 1:
            total += compared(robot, rng)
    values, jumps, wrong = total.tolist()
    print(
        f"{count} robots: {values} values of cells near a cut, {jumps} samples across it; {wrong} outside their bounds"
    )
    if wrong:
        raise SystemExit(1)


if __name__ == "__main__":
    main(*(int(x) for x in (*sys.argv[1:], "370", "1")[:2]))
