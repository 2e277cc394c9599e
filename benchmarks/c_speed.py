"""Exported C: microseconds a call of the Panda's capsules and spheres, values and Jacobian, and how well it agrees.

    python -m benchmarks.c_speed

The marks are those that `propose_marks` makes of panda_collision; boundaries with boxes, whose nearest points are
searched for, are left out. gcc compiles strictly, without -ffast-math.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import pinbound as pb
from benchmarks.robots import PANDA, SHARE
from pinbound.export import is_closed

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
DRIVER = """#include <time.h>
#include "panda.h"
double best(int with_jacobian, int calls)
{
    double q[PANDA_COORDINATES] = {0}, h[PANDA_BOUNDARIES], J[PANDA_BOUNDARIES * PANDA_COORDINATES];
    double least = 1e9, took;
    int round, k;
    clock_t start;
    for (round = 0; round < 100; ++round) {
        start = clock();
        for (k = 0; k < calls; ++k) {
            q[k % PANDA_COORDINATES] += 1e-4;
            if (with_jacobian) panda_clearances_and_jacobian(q, h, J);
            else panda_clearances(q, h);
        }
        took = (double)(clock() - start) / CLOCKS_PER_SEC / calls;
        if (took < least) least = took;
    }
    return 1e6 * least;
}
"""


def pointer(array: Any) -> Any:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--level", default="-O2")
    options = parser.parse_args()
    bare = pb.load(PANDA, package_dirs=[str(SHARE)])
    robot = pb.load(PANDA, annotations=pb.propose_marks(bare).annotations, package_dirs=[str(SHARE)])
    chosen = robot.boundaries.select([b.name for b in robot.boundaries if is_closed(b.rule)])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        robot.export("c", folder / "panda.c", chosen.names)
        (folder / "driver.c").write_text(DRIVER)
        words = ["gcc", *STRICT, options.level, "driver.c", "panda.c", "-lm", "-o", "panda.so"]
        subprocess.run(words, cwd=folder, check=True)
        library = ctypes.CDLL(str(folder / "panda.so"))
    library.best.restype = ctypes.c_double
    m, n = len(chosen), len(robot.coordinates)
    print(f"{m} boundaries, {n} coordinates, {options.level}")
    for said, with_jacobian in (("values", 0), ("values and Jacobian", 1)):
        print(f"  {said}: {library.best(with_jacobian, 2000):.2f} us a call (best of 100 rounds of 2,000)")
    off, slope = 0.0, 0.0
    for q in np.random.default_rng(0).uniform(robot.lower, robot.upper, (2000, n)):
        h, J = np.empty(m), np.empty((m, n))
        library.panda_clearances_and_jacobian(pointer(q), pointer(h), pointer(J))
        off = max(off, float(np.abs(h - chosen.signed_clearances(q)).max()))
        apart = chosen.norms(q) > 1e-3
        slope = max(slope, float(np.abs(J - chosen.signed_gradients(q))[apart].max()))
    print(f"  largest difference from pinbound: {off:.2g} m, of the Jacobian {slope:.2g} m/rad")


if __name__ == "__main__":
    main()
