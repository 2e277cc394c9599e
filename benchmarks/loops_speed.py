"""Batches through a four-bar against the same boundaries without a loop.

python -m benchmarks.loops_speed [configurations]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import pinbound as pb
from pinbound.robot.loop_robot import LoopRobot
from test_lifted import linkage


def measured(ask: object, Q: np.ndarray) -> float:
    """Return the least of seven times [ns per configuration]."""
    found: list[float] = []
    for _ in range(7):
        begun = time.perf_counter()
        ask(Q)  # type: ignore[operator]
        found.append(time.perf_counter() - begun)
    return 1e9 * min(found) / len(Q)


def main(count: int) -> None:
    """Print both times, and their ratio."""
    robot = pb.load(linkage())
    assert isinstance(robot, LoopRobot)
    Q = robot.home + np.random.default_rng(0).uniform(-0.2, 0.2, (count, 2))
    Z = robot.lift(Q)
    for name in ("norms", "signed_clearances", "free", "gradients"):
        through, without = (getattr(one, name) for one in (robot.boundaries, robot.opened.boundaries))
        for ask, rows in ((through, Q), (without, Z)):
            ask(rows)
        a, b = measured(through, Q), measured(without, Z)
        print(f"{name}: through the loop {a:.0f} ns, without {b:.0f} ns, {a / b:.1f} times")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
