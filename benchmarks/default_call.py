"""What a user gets who asks for nothing: `python -m benchmarks.default_call --repetitions 7`.

Each repetition is a fresh process. Cold: the cache folder is empty, and the first call of the process by the default
backend is compared with the first call of the next process by `backend="numpy"`. Warm: the folder holds the code, and
the third call on of the default backend is compared with `backend="compiled"`, in turn, in one process. Processor time;
a ratio is the median of the quotients.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np

ROWS = (1_000, 90_000)
MODES = ("norms", "clearances", "gradients", "smallest", "free")


def clock(call: Any) -> float:
    start = time.process_time()
    call()
    return time.process_time() - start


def one_process(rows: int, mode: str, backend: str) -> float:
    """Return the seconds of the first call; of `"warm"` the quotient of later ones."""
    import pinbound as pb

    chosen, other = (pb.load("minervabot_v3").boundaries for _ in range(2))
    Q = np.random.default_rng(0).uniform(-3, 3, (rows, 3))
    if backend != "warm":
        return clock(lambda: getattr(chosen, mode)(Q, backend=backend))
    for _ in range(2):
        getattr(chosen, mode)(Q)
        getattr(other, mode)(Q, backend="compiled")
    times = [
        (clock(lambda: getattr(chosen, mode)(Q)), clock(lambda: getattr(other, mode)(Q, backend="compiled")))
        for _ in range(40)
    ]
    return float(np.median([a / b for a, b in times]))


def ask(folder: str, *words: str) -> float:
    environment = {**os.environ, "PINBOUND_CACHE_DIR": folder, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "benchmarks.default_call", "--inner", *words]
    return float(json.loads(subprocess.run(command, env=environment, check=True, capture_output=True).stdout))


def main() -> None:
    """Print a table of quotients."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--inner", nargs=3, metavar=("ROWS", "MODE", "BACKEND"))
    options = parser.parse_args()
    if options.inner:
        rows, mode, backend = options.inner
        print(json.dumps(one_process(int(rows), mode, backend)))
        return
    print("| rows | what | first call, cold / NumPy | third call on, warm / compiled |")
    print("| ---: | --- | ---: | ---: |")
    with tempfile.TemporaryDirectory() as warm:
        for rows in ROWS:
            for mode in MODES:
                ask(warm, str(rows), mode, "warm")  # fills the cache
                warmed = [ask(warm, str(rows), mode, "warm") for _ in range(options.repetitions)]
                colds: list[float] = []
                for _ in range(options.repetitions):
                    with tempfile.TemporaryDirectory() as empty:
                        first, numpys = (ask(empty, str(rows), mode, backend) for backend in ("auto", "numpy"))
                        colds.append(first / numpys)
                print(f"| {rows:,} | `{mode}` | {np.median(colds):.2f} | {np.median(warmed):.2f} |", flush=True)


if __name__ == "__main__":
    main()
