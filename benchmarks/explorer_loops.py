"""The explorer's page against Python on random robots with loops that are not parallelograms, in Chromium.

python -m benchmarks.explorer_loops [ROBOTS_OF_EACH_KIND SEED]

Compared in 1,500 poses of each: which poses can be closed, which are free, passive joints and clearances. In ten free
poses: whether each live limit is free in Python, in 201 places up to it. Needs Chromium and Playwright.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import linkages as zoo
import pages
import pinbound as pb
from pinbound.explorer.planes import windows

ASK = """(Q) => { const { robot, data } = pinbound; return JSON.stringify({
  clearances: Q.map((q) => [...robot.evaluate(q)]), z: Q.map((q) => [...robot.loops.at(q)]),
  open: Q.map((q) => robot.open(q).length),
  free: Q.map((q) => robot.contact(q, data.boundaries.map((_, k) => k)) < 0 && robot.broken(q).length === 0),
}); }"""
LIMITS = """(Q) => Q.map((q) => { const s = pinbound.robot.evaluate(q); return q.map((_, j) => {
  const { lower, upper } = pinbound.reach.of(Float64Array.from(q), j, s);
  return [lower, upper].map(({ value, how }) => [String(value), how]); }); })"""


def main(count: int, seed: int) -> int:
    """Compare and print; the exit code is 1 if something differs."""
    started = pages.launched()
    browser, worst, bad, hows, number = next(started), 0.0, 0, Counter[str](), 0
    with tempfile.TemporaryDirectory() as folder:
        for which in range(seed, seed + count):
            for kind in zoo.KINDS:
                robot = zoo.scene(kind, np.random.default_rng(which), pb.load)
                page = pages.opened(browser, pb.explorer_page(robot, []).save(Path(folder) / "page.html"))
                low, high = np.array(windows(robot, robot.home, {})).T
                Q = np.random.default_rng(which).uniform(low, high, (1500, len(low)))
                found, Z = json.loads(page.evaluate(ASK, Q.tolist())), robot.lift(Q)
                closed, free = robot.boundaries.closed(Z), np.asarray(robot.boundaries.free(Q))
                bad += int(np.sum((np.array(found["open"]) == 0) != closed) + np.sum(np.array(found["free"]) != free))
                signed = robot.boundaries.signed_clearances(Q)
                off = [np.abs(np.array(found["clearances"]) - signed)[closed], np.abs(np.array(found["z"]) - Z)[closed]]
                worst, number = max(worst, *(float(one.max()) for one in off)), number + int(closed.sum())
                for q, rows in zip(Q[free][:10], page.evaluate(LIMITS, Q[free][:10].tolist()), strict=True):
                    for j, ends in enumerate(rows):
                        for text, how in ends:
                            hows[how] += 1
                            moved = np.repeat(q[None], 201, axis=0)
                            moved[:, j] = np.linspace(q[j], float(text) + 1e-9 * (q[j] - float(text)), 201)
                            bad += int(np.isfinite(float(text)) and not np.all(robot.boundaries.free(moved)))
                page.close()
    started.close()
    print(f"{4 * count} robots, {number:,} poses that close: at most {worst:.1e} m or rad; {bad} differ")
    print(f"live limits: {', '.join(f'{how}: {times}' for how, times in hows.most_common())}")
    return int(bad > 0 or worst > 1e-12)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3] or ("8", "20"))))
