"""Certificates of generated motions against dense sampling: no false CERTIFIED, no VIOLATED without a witness.

    python benchmarks/certify_campaign.py --motions 100000 --seed 0 --out docs/certificates-campaign.md

Random mechanisms (planar, spatial, with a slide, with a follower on a branch) with random marked spheres; random
motions from 0.01 to 2 rad a segment; the spheres of half of the boundaries are resized so that the motion just touches,
or just misses, by 1e-3 to 1e-9 m. The oracle samples the *unreduced* vector of each boundary, densely all along and
again around its smallest sample. Exit code 1 if a single certificate is wrong.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

import pinbound as pb
from pinbound.boundaries.boundary_set import BoundarySet

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from mechanisms import random_robot

SAMPLES = 600
MOTIONS_A_ROBOT = 100


def positions(waypoints: np.ndarray, u: np.ndarray) -> np.ndarray:
    index = np.minimum(u.astype(int), len(waypoints) - 2)
    fraction = (u - index)[:, None]
    return waypoints[index] + fraction * (waypoints[index + 1] - waypoints[index])


def oracle(robot: pb.Robot, waypoints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the smallest sampled norm of each boundary, and where: dense, then twice finer around the smallest."""
    least, where = np.full(len(robot.boundaries), np.inf), np.zeros(len(robot.boundaries))
    last = len(waypoints) - 1
    for column, boundary in enumerate(robot.boundaries):
        u, width = np.linspace(0.0, last, SAMPLES), last / SAMPLES
        for _ in range(3):
            norms = np.linalg.norm(boundary.vector(positions(waypoints, u)), axis=1)
            row = int(np.argmin(norms))
            if norms[row] < least[column]:
                least[column], where[column] = norms[row], u[row]
            u = np.clip(np.linspace(where[column] - width, where[column] + width, 61), 0.0, last)
            width /= 30.0
    return least, where


def resized(robot: pb.Robot, thresholds: dict[str, float]) -> pb.Robot:
    """Return the robot with other distances; home may be in contact, which does not matter here."""
    changed = [dataclasses.replace(b, min_distance=thresholds.get(b.name, b.min_distance)) for b in robot.boundaries]
    return dataclasses.replace(robot, boundaries=BoundarySet(changed, robot.coordinates, robot.linear_limits))


def main() -> int:  # noqa: PLR0915
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    folder = Path(tempfile.mkdtemp())
    verdicts: Counter[tuple[str, str]] = Counter()
    wrong: Counter[str] = Counter()
    seconds = boxes = done = robots = 0
    widths: list[float] = []
    gaps: list[float] = []
    open_clearance = 0.0

    def report() -> str:
        rows = sorted({label for label, _ in verdicts})
        lines = ["| mechanisms | certified | violated | undecided |", "| --- | ---: | ---: | ---: |"]
        lines += [
            f"| {row} | " + " | ".join(f"{verdicts[row, v]:,}" for v in ("certified", "violated", "undecided")) + " |"
            for row in rows
        ]
        lines += [
            "",
            f"{done:,} motions of {robots:,} mechanisms, seed {options.seed}; "
            f"{1e3 * seconds / done:.2f} ms and {boxes / done:.0f} boxes a motion on average.",
            "",
            "| wrong certificates | count |",
            "| --- | ---: |",
            *(f"| {name} | {count:,} |" for name, count in sorted(wrong.items())),
            "",
            f"First contacts bracketed to 1e-9 of the duration: {np.mean(np.array(widths) <= 1e-9):.4%} of "
            f"{len(widths):,} (worst {max(widths):.1e}, at a grazing contact, where rounding decides). Width of the "
            f"bounds of the smallest clearance: at most {1e9 * max(gaps):.0f} nm. Largest |clearance| left undecided: "
            f"{open_clearance:.1e} m.",
        ]
        return "\n".join(lines) + "\n"

    while done < options.motions:
        if options.out and done and done % 5000 == 0:
            options.out.write_text(report(), encoding="utf-8")  # what is done so far
        sort, slides = ["planar", "spatial"][robots % 2], robots % 5 == 4
        robots += 1
        robot = random_robot(rng, folder, sort, slides)
        if robot is None:
            continue
        label = f"{sort}{', with a slide' if slides else ''}"
        n = len(robot.coordinates)
        for _ in range(min(MOTIONS_A_ROBOT, options.motions - done)):
            done += 1
            steps = rng.normal(0.0, 10.0 ** rng.uniform(-2.0, 0.3), (int(rng.integers(2, 5)), n))
            waypoints = robot.home + rng.normal(0.0, 0.3, n) + np.cumsum(steps, axis=0)
            least, _ = oracle(robot, waypoints)
            chosen = rng.random(len(least)) < 0.5
            signs = rng.choice([-1.0, 1.0], len(least))
            depth = signs * 10.0 ** rng.uniform(-9.0, -3.0, len(least))
            sizes = {b.name: float(max(least[i] + depth[i], 1e-4)) for i, b in enumerate(robot.boundaries) if chosen[i]}
            tried = resized(robot, sizes)
            started = time.process_time()
            found = pb.certify(tried, waypoints, each=True)
            seconds += time.process_time() - started
            boxes += found.boxes
            verdicts[label, found.verdict.value] += 1
            for boundary, finding, sampled in zip(tried.boundaries, found.boundaries, least, strict=True):
                clearance = sampled - boundary.threshold
                wrong["false CERTIFIED"] += finding.verdict is pb.Verdict.CERTIFIED and clearance <= 0.0
                wrong["lower bound above a sample"] += finding.lower > clearance + 1e-15
                wrong["upper bound not met at its q"] += boundary.clearance(finding.q) > finding.upper + 1e-15
                if finding.verdict is pb.Verdict.UNDECIDED:
                    open_clearance = max(open_clearance, abs(clearance))
                else:
                    gaps.append(finding.upper - finding.lower)
                if finding.contact is not None:
                    wrong["VIOLATED, witness not negative"] += not boundary.clearance(finding.contact.q) < 0.0
                    widths.append((finding.contact.after - finding.contact.before) / (found.end - found.start))
                elif finding.verdict is pb.Verdict.VIOLATED:
                    wrong["VIOLATED without a witness"] += 1
            wrong["CERTIFIED with an open boundary"] += found.verdict is pb.Verdict.CERTIFIED and any(
                finding.verdict is not pb.Verdict.CERTIFIED for finding in (*found.boundaries, *found.limits)
            )
    text = report()
    sys.stdout.write(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return int(any(wrong.values()))


if __name__ == "__main__":
    sys.exit(main())
