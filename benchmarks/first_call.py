"""The first call of a process from nothing and from the cache: `python -m benchmarks.first_call ROBOT.urdf --pairs P`.

Spheres as in `benchmarks.certify_many`. Each row is a process: the first and the second call of `free` on 100,000 rows
by the default backend [s of the processor], then the most that the process has held before and after `free` and
`smallest` of 1,000,000 rows, the rows themselves included [MB]. Python's own bytecode is there, as in a package that
was installed: a process before the first row writes it.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np


def held() -> float:
    """The most that this process has held [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def one(urdf: Path, pairs: Path) -> dict[str, float]:
    """Measure in this process."""
    from benchmarks.certify_many import load

    robot = load(urdf, pairs, [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    found: dict[str, float] = {}
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (100_000, len(robot.coordinates)))
    for call in ("first", "second"):
        start = time.process_time()
        robot.boundaries.free(Q)
        found[call] = time.process_time() - start
    Q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (1_000_000, len(robot.coordinates)))
    found["rows"], found["before"] = Q.nbytes / 1e6, held()
    robot.boundaries.free(Q)
    robot.boundaries.smallest(Q)
    return found | {"after": held()}


def away(folder: str, name: str) -> dict[str, str]:
    """Return what makes a process keep its code in a folder."""
    return {"PINBOUND_CACHE_DIR": str(Path(folder) / name)}


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("urdf", type=Path)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--one", action="store_true", help="measure in this process")
    options = parser.parse_args()
    if options.one:
        print(json.dumps(one(options.urdf, options.pairs)))
        return
    print("| cache | first call [s] | second [s] | before 10^6 rows [MB] | after [MB] |\n|" + " --- |" + " ---: |" * 4)
    command = [sys.executable, "-m", "benchmarks.first_call", str(options.urdf), "--pairs", str(options.pairs), "--one"]
    with tempfile.TemporaryDirectory() as folder:
        bytecode = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(Path(folder) / "bytecode")}
        other = {**os.environ, **bytecode, **away(folder, "other")}
        subprocess.run(command, check=True, capture_output=True, env=other)
        for cache in ("empty", "filled"):
            environment = {**os.environ, **bytecode, **away(folder, "code")}
            said = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
            found = json.loads(said)
            row = (f"{found['first']:.2f}", f"{found['second']:.2f}", f"{found['before']:.0f}", f"{found['after']:.0f}")
            print(f"| {cache} | {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
