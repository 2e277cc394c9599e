"""How long a region takes: the hexagon of MinervaBotV3, exact; and curves at several accuracies.

python benchmarks/region_time.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import pinbound as pb
from pinbound.path.chain import Chain
from pinbound.region.contours import ContactFunction, trace


def best(run: Callable[[], object], repeats: int) -> float:
    """Return the least CPU time of several runs [ms]."""
    times = []
    for _ in range(repeats):
        started = time.process_time()
        run()
        times.append(time.process_time() - started)
    return 1e3 * min(times)


def main() -> None:
    """Print the table."""
    robot = pb.load("minervabot_v3")
    rng = np.random.default_rng(0)
    Q = rng.uniform(-1.0, 1.0, (10_000, 3))
    print(f"hexagon of MinervaBotV3:                     {best(lambda: pb.feasible_region(robot), 20):8.2f} ms")
    margin = best(lambda: pb.feasible_region(robot, margin=0.005), 20)
    print(f"  with every threshold raised by 5 mm:       {margin:8.2f} ms")
    region = pb.feasible_region(robot).scale(0.9)
    print(f"  smallest clearance over 0.9 of it:         {best(region.clearance, 20):8.2f} ms")
    table = best(lambda: robot.boundaries.limits_table("q3", Q), 5)
    print(f"limits of q3 for 10,000 configurations:      {table:8.2f} ms")
    offsets = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.1], [0.0, 0.0, 0.9]])
    arm = Chain(offsets, np.zeros((3, 3, 2)), np.array([[0.0, 1.0, 0.0]] * 2), np.eye(2), 3.0)
    window = np.array([[-3.1, -3.1], [3.2, 3.2]])
    for threshold in (1e-4, 1e-2, 0.5, 1.5):
        for accuracy in (1e-3, 1e-5, 1e-7):
            function = ContactFunction.over(arm, threshold, window)
            found = trace(function, window, accuracy)
            points = sum(map(len, found.lines))
            spent = best(lambda f=function, a=accuracy: trace(f, window, a), 3)
            print(f"one curve, T = {threshold:6g}, accuracy {accuracy:.0e}: {spent:8.2f} ms, {points} points")


if __name__ == "__main__":
    main()
