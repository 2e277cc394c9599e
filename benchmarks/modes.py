"""What each answer of ten boundaries costs beside the others: `python -m benchmarks.modes`.

MinervaBotV3, 90,000 configurations, `backend="compiled"` unless said. All jobs run in turn; processor time, medians of
the quotients of single repetitions.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import pinbound as pb

ROWS = 90_000
CALLS = 4  # in one reading of the clock


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=12)
    options = parser.parse_args()
    B = pb.load("minervabot_v3").boundaries
    Q = np.random.default_rng(0).uniform(-3, 3, (ROWS, 3))
    jobs = {
        "ten norms": lambda: B.norms(Q, backend="compiled"),
        "ten norms, float32": lambda: B.norms(Q, backend="compiled", dtype=np.float32),
        "ten norms, NumPy alone": lambda: B.norms(Q, backend="numpy"),
        "ten clearances": lambda: B.clearances(Q, backend="compiled"),
        "ten gradients": lambda: B.gradients(Q, backend="compiled"),
        "smallest clearance and its boundary": lambda: B.smallest(Q, backend="compiled"),
        "`free`, joint limits too": lambda: B.free(Q, backend="compiled"),
    }
    for job in jobs.values():
        job()
    seconds = np.zeros((options.repetitions, len(jobs)))
    for row in seconds:
        for i, job in enumerate(jobs.values()):
            start = time.process_time()
            for _ in range(CALLS):
                job()
            row[i] = (time.process_time() - start) / CALLS
    print("| what | median [ns a configuration] | least [ns] | / ten norms |\n| --- | ---: | ---: | ---: |")
    for i, name in enumerate(jobs):
        each = 1e9 * seconds[:, i] / ROWS
        print(f"| {name} | {np.median(each):.1f} | {each.min():.1f} | {np.median(seconds[:, i] / seconds[:, 0]):.2f} |")


if __name__ == "__main__":
    main()
