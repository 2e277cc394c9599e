"""Certify many motions in several processes: a robot can be sent to them. `python examples/09_processes.py`.

Prints:
    400 motions in 2 processes: 265 CERTIFIED, 135 VIOLATED
    the same as in one process
"""

from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np

import pinbound as pb


def main() -> None:
    """Compare two processes with one."""
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot, ("q2", "q3"))
    rng = np.random.default_rng(0)
    Q = rng.uniform(region.vertices.min(axis=0), region.vertices.max(axis=0), (4000, 2))
    Q = Q[region.contains(np.insert(Q, 0, 0.0, axis=1))][:200]
    starts = np.insert(np.concatenate((Q, Q)), 0, 0.0, axis=1)
    ends = np.roll(starts, 1, axis=0)
    ends[200:, 2] += 0.8  # half of them lead out of the region
    # "spawn" works on all systems; on Linux "fork" starts faster
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        parts = pool.map(partial(pb.certify_many, robot), np.array_split(starts, 8), np.array_split(ends, 8))
        found = [verdict for part in parts for verdict in part]
    counts = Counter(verdict.name for verdict in found)
    print(f"{len(found)} motions in 2 processes: " + ", ".join(f"{counts[name]} {name}" for name in sorted(counts)))
    alone = list(pb.certify_many(robot, starts, ends))
    print("the same as in one process" if alone == found else "other verdicts than in one process")


if __name__ == "__main__":
    main()
