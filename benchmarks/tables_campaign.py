"""What readers of limit tables accept is free: ten million samples a format, most of them at the very limits.

    python -m benchmarks.tables_campaign --samples 1e7
    python -m benchmarks.tables_campaign --accepted pairs.npy

Readers are those of `tests/test_limit_tables.py`, which share no code with the writers. With `--write FOLDER` the
tables are written, for the readers of others; `--accepted` counts what such a reader accepted, an array (N, 2) of the
two angles [rad].
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

import pinbound as pb
from pinbound.robot.table_formats import GRIDS

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from test_limit_tables import READERS

BLOCK = 1_000_000


def contacts(robot: pb.Robot, pairs: Any) -> int:
    """Count pairs (N, 2) of q2 and q3 [rad] that are not free."""
    Q = np.column_stack((np.zeros(len(pairs)), pairs))
    return int(np.count_nonzero(~robot.boundaries.free(Q)))


def accepted(read: tuple[Any, Any, Any], count: int, rng: np.random.Generator) -> Any:
    """Return pairs that a reader accepts who interpolates: at a limit, a billionth inside, or anywhere between."""
    angles, lower, upper = read
    q2 = rng.uniform(angles[0], angles[-1], count)
    low, high = np.interp(q2, angles, lower), np.interp(q2, angles, upper)
    share = rng.choice([0.0, 1.0, 1e-9, 1.0 - 1e-9, -1.0], count)
    share = np.where(share < 0.0, rng.uniform(size=count), share)
    return np.radians(np.column_stack((q2, np.clip(low + share * (high - low), low, high))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=float, default=1e6)
    parser.add_argument("--write", type=Path)
    parser.add_argument("--accepted", type=Path)
    options = parser.parse_args()
    robot = pb.load("minervabot_v3")
    if options.accepted:
        pairs = np.load(options.accepted)
        found = sum(contacts(robot, pairs[start : start + BLOCK]) for start in range(0, len(pairs), BLOCK))
        print(f"{options.accepted.name}: {len(pairs)} accepted, {found} in contact")
        return
    for form, grid in GRIDS.items():
        table = pb.limit_table(robot, "q2", "q3", grid=grid, whole=form == "jskeus")
        text, rng, found, done = table.text(form), np.random.default_rng(0), 0, 0
        if options.write:
            (options.write / f"table.{form}").write_text(text)
        while done < options.samples:
            count = min(BLOCK, int(options.samples) - done)
            found += contacts(robot, accepted(READERS[form](text), count, rng))
            done += count
        loss = np.degrees(table.loss)
        print(
            f"{form}: {len(table.angles)} entries, {done} accepted, {found} in contact, loss {loss:.4f} deg", flush=True
        )


if __name__ == "__main__":
    main()
