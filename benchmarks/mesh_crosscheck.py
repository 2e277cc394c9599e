"""Marks over meshes against the raw meshes: does a configuration that is clear for the marks of two links ever touch?

    python benchmarks/mesh_crosscheck.py --samples 1000000 --seconds 300 --accuracy 0.002 --most 8

Each robot gets the marks that `pinbound mark` proposes, proven covers of its meshes among them. Half of the
configurations are random within all limits, the other half lie near contact: on the way between a free configuration
and one in contact the marks' contact is bisected, and 20 configurations are drawn about it. Coal says yes or no on the
raw meshes, read by its own loader. Where it says yes for a watched pair of links, a boundary between the two has to say
contact as well: else it is a miss. Needless refusals are coal's distances where the marks of two links have just met.
Exit code 1 if there is a miss.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path

import numpy as np

import pinbound as pb
from pinbound.coverage.covers import MOST_PARTS
from pinbound.crosscheck.raw import RawBodies
from pinbound.marking.candidates import draw

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = SHARE / "example-robot-data" / "robots"
NAMES = {
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "allegro": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "talos": "talos_data/robots/talos_full_v2.urdf",
}
AROUND = 20  # configurations about one contact
BLOCK = 2_000
GAPS = 400  # needless refusals measured, at most


@dataclass
class Row:
    """What was seen of one robot."""

    name: str
    watched: int
    pairs: int
    marks: int
    boundaries: int
    excess: float
    samples: int = 0
    near: int = 0
    contacts: int = 0
    misses: int = 0
    refusals: tuple[float, ...] = ()
    seconds: float = 0.0


def marked(path: Path, accuracy: float, most: int) -> tuple[pb.Robot, list[tuple[str, str]], float]:
    """Return a robot with proposed marks, its pairs of links that are watched, and the largest excess [m]."""
    robot = pb.load(path, package_dirs=[SHARE])
    proposal = pb.propose_marks(robot, accuracy=accuracy, most=most)
    robot = robot.with_annotations(proposal.annotations)
    return robot, [pair.links for pair in robot.coverage.pairs if pair.status.value == "watched"], proposal.excess


def near(robot: pb.Robot, Q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return configurations about places where the smallest clearance changes its sign, within all limits."""
    free = robot.boundaries.free(Q)
    if not free.any() or free.all():
        return Q[:0]
    starts = Q[free][rng.integers(0, free.sum(), (~free).sum())]
    ends = Q[~free]
    low, high = np.zeros(len(ends)), np.ones(len(ends))
    for _ in range(12):
        middle = 0.5 * (low + high)
        clear = robot.boundaries.free(starts + middle[:, None] * (ends - starts))
        low, high = np.where(clear, middle, low), np.where(clear, high, middle)
    places = starts + low[:, None] * (ends - starts)
    size = 10.0 ** rng.uniform(-5, -1.5, (len(places), AROUND, 1))
    tries = (places[:, None] + size * rng.normal(size=(len(places), AROUND, Q.shape[1]))).reshape(-1, Q.shape[1])
    return tries[robot.intervals.hold(tries)]


def measured(name: str, samples: int, seconds: float, accuracy: float, most: int, seed: int) -> Row:
    """Compare one robot until it has its samples or its time is up."""
    robot, links, excess = marked(ROBOTS / NAMES[name], accuracy, most)
    row = Row(name, len(links), len(robot.coverage.pairs), len(robot.annotations.marks), len(robot.boundaries), excess)
    of: dict[frozenset[str], list[pb.Boundary]] = {}
    for one in robot.boundaries:
        of.setdefault(frozenset((one.point_a.link, one.point_b.link)), []).append(one)
    between = [of.get(frozenset(pair), []) for pair in links]
    raw, rng, start = RawBodies(robot, links), np.random.default_rng(seed), time.process_time()
    gaps: list[float] = []
    while row.samples < samples and time.process_time() - start < seconds:
        Q = draw(robot, BLOCK // 2, rng)
        close = near(robot, draw(robot, max(BLOCK // AROUND, 400), rng), rng)[: BLOCK // 2]
        row.near += len(close)
        Q = np.concatenate((Q, close))
        row.samples += len(Q)
        touching = np.flatnonzero([not raw.engine.is_free(q) for q in Q])
        row.contacts += len(touching)
        if len(touching):
            for index, hits in zip(touching, raw.collisions(Q[touching]), strict=True):
                for place in np.flatnonzero(hits).tolist():
                    if min((float(one.signed_clearance(Q[index])) for one in between[place]), default=np.inf) > 0.0:
                        row.misses += 1
                        print(f"MISS {links[place]} at {Q[index].tolist()}", flush=True)
        gaps += refusals(robot, raw, between, close, 10) if len(gaps) < GAPS else []
    row.refusals, row.seconds = tuple(gaps), time.process_time() - start
    return row


def refusals(
    robot: pb.Robot, raw: RawBodies, between: list[list[pb.Boundary]], Q: np.ndarray, most: int
) -> list[float]:
    """Return coal's distances of the two links' meshes [m] where their marks are in contact by less than 0.1 mm."""
    found: list[float] = []
    columns = list(raw.places.values())
    signed = robot.boundaries.signed_clearances(Q)
    index = {one.name: place for place, one in enumerate(robot.boundaries)}
    for place, boundaries in enumerate(between):
        if not boundaries:
            continue
        least = np.min(signed[:, [index[one.name] for one in boundaries]], axis=1)
        rows = np.flatnonzero(np.abs(least) <= 1e-4)[: max(1, most // 5)]
        found += [min(raw.engine.distance(Q[i], column) for column in columns[place]) for i in rows if columns[place]]
        if len(found) >= most:
            break
    return found


def table(rows: list[Row]) -> str:
    """Return the rows as Markdown."""
    heads = ("robot", "pairs of links", "watched", "marks", "boundaries", "largest excess [mm]")
    heads += (
        "configurations",
        "of them near contact",
        "in contact on raw meshes",
        "missed",
        "needless refusal, median [mm]",
        "largest [mm]",
        "measured",
        "CPU [s]",
    )
    lines = ["| " + " | ".join(heads) + " |", "| --- |" + " ---: |" * (len(heads) - 1)]
    for row in rows:
        some = 1e3 * np.array(row.refusals or (np.nan,))
        cells = (row.name, row.pairs, row.watched, row.marks, row.boundaries, f"{1e3 * row.excess:.2f}")
        cells += (
            f"{row.samples:,}",
            f"{row.near:,}",
            f"{row.contacts:,}",
            row.misses,
            f"{np.median(some):.2f}",
            f"{some.max():.2f}",
            len(row.refusals),
        )
        lines.append("| " + " | ".join(map(str, (*cells, f"{row.seconds:.0f}"))) + " |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run, print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=float, default=300.0, help="CPU seconds a robot")
    parser.add_argument("--accuracy", type=float, default=0.002)
    parser.add_argument("--most", type=int, default=MOST_PARTS, help="marks of a link that hold its meshes")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows: list[Row] = []
    for name in NAMES:
        if options.only in name:
            rows.append(measured(name, options.samples, options.seconds, options.accuracy, options.most, options.seed))
            print(table(rows[-1:]), flush=True)
    if options.out is not None:
        options.out.write_text(f"# Marks against raw meshes\n\n`python {' '.join(sys.argv)}`\n\n{table(rows)}")
    return int(any(row.misses for row in rows))


if __name__ == "__main__":
    sys.exit(main())
