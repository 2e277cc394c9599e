"""Loops that are nearly parallelograms against the linkage as written: no joint or link further off than stated.

    python benchmarks/closures_campaign.py --loops 10000 --seed 1 --out docs/closures-campaign.md

Random four-bars (drawn at any angle, any two joints passive, or coupled by mimics) and palletizers' loops (arm and
crank at one shoulder, or a hair apart), whose sides differ by 3e-10 to 1e-4 m in all, with limits down to 0.4 degrees
from the flat pose. The oracle solves the loop as written by Newton to 45 digits at the ends of the limits and between.
Each loop is also certified with an obstacle that the linkage as written touches or enters by up to 10 um. Exit code 1
if anything is further off than stated, or CERTIFIED or free where the linkage as written is in contact.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

import pinbound as pb

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from loops import judge, marked, random_loop

POSES = 2


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--loops", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    angles, places, wrong = [], [], []
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "loop.urdf"
        for number in range(options.loops):
            rng = np.random.default_rng([options.seed, number])
            loop = random_loop(rng)
            path.write_text(loop.urdf(marked(loop, rng)), encoding="utf-8")
            try:
                robot = pb.load(path)
            except pb.InputError as error:
                near = "flat pose" in str(error)
                counts[
                    "refused: too near the flat pose" if near else "home in contact, or within the error of a limit"
                ] += 1
                continue
            if not robot.closures[0].deviations:
                counts["equal to rounding"] += 1
                continue
            found = judge(loop, robot, rng, POSES)
            counts[f"answered; motion into contact: {found.verdict}"] += 1
            angles.append(found.angle)
            places.append(found.place)
            if number % 500 == 499:
                print(f"{number + 1} loops, {len(wrong)} wrong", file=sys.stderr, flush=True)
            if not found.holds:
                wrong.append((number, found))
                print(f"WRONG: seed {options.seed}, loop {number}: {found}", flush=True)
    rows = [f"| {what} | {count} |" for what, count in sorted(counts.items())]
    shares = [np.quantile(values, [0.0, 0.1, 0.5, 0.9, 1.0]) for values in (angles, places)]
    table = [
        f"| {name} | {' | '.join(f'{x:.3f}' for x in row)} |"
        for name, row in zip(("joint", "place"), shares, strict=True)
    ]
    text = "\n".join(
        [
            "# Loops whose sides differ, against the linkage as written",
            "",
            f"`python benchmarks/closures_campaign.py --loops {options.loops} --seed {options.seed}`: "
            f"{len(wrong)} wrong, {time.perf_counter() - started:.0f} s.",
            "",
            "| loops | count |",
            "| --- | --- |",
            *rows,
            "",
            "Largest error met as a share of the one stated (1: the bound is reached), over the loops:",
            "",
            "| | least | 10 % | median | 90 % | most |",
            "| --- | --- | --- | --- | --- | --- |",
            *table,
            "",
        ]
    )
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
