"""Coverage of ten robots of example-robot-data, and coal on their raw bodies, meshes included.

    python benchmarks/coverage_robots.py --samples 300 --seed 0 --out docs/coverage-robots.md

Each robot gets the marks that `pinbound mark` proposes. At random configurations within the limits, where every
boundary is clear (some of them certified as well), coal looks for contact between the bodies as the URDF has them. Of
pairs of links that coverage counts as watched there must be none; what it finds between others is what the coverage
line warns of. Exit code 1 if a watched pair is in contact.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio

import pinbound as pb
from pinbound.coverage import PairCoverage

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = SHARE / "example-robot-data" / "robots"
NAMES = (
    "a1_description/urdf/a1.urdf",
    "anymal_b_simple_description/robots/anymal.urdf",
    "b1_description/urdf/b1.urdf",
    "icub_description/robots/icub.urdf",
    "panda_description/urdf/panda.urdf",
    "pr2_description/urdf/pr2.urdf",
    "talos_data/robots/talos_full_v2.urdf",
    "tiago_description/robots/tiago.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "z1_description/urdf/z1.urdf",
)
CERTIFIED = 20
MESHES = 30


@dataclass(frozen=True)
class Row:
    """One robot: what coverage says, and what coal found."""

    name: str
    links: int
    seconds: float
    line: str
    record: pb.CoverageRecord
    free: int
    certified: int
    watched_contacts: int
    unseen: str


class Raw:
    """Coal's yes or no on the bodies of a URDF: collision bodies, else visual ones, of chosen pairs of links."""

    def __init__(self, robot: pb.Robot, path: Path, pairs: tuple[PairCoverage, ...]) -> None:
        self.robot, self.model = robot, robot.model
        self.data = self.model.createData()
        kinds = (pinocchio.COLLISION, pinocchio.VISUAL)
        read = [pinocchio.buildGeomFromUrdf(self.model, str(path), kind, package_dirs=[str(SHARE)]) for kind in kinds]
        self.geometry = pinocchio.GeometryModel()
        of_link: dict[str, list[int]] = {}
        for model in read:
            known = set(of_link)
            for body in model.geometryObjects:
                link = self.model.frames[body.parentFrame].name
                if link not in known:
                    body.name = f"{link}.{len(of_link.get(link, []))}"
                    of_link.setdefault(link, []).append(self.geometry.addGeometryObject(body))
        for pair in pairs:
            for a in of_link.get(pair.links[0], []):
                for b in of_link.get(pair.links[1], []):
                    self.geometry.addCollisionPair(pinocchio.CollisionPair(a, b))
        self.geometry_data = pinocchio.GeometryData(self.geometry)

    def contact(self, q: np.ndarray) -> bool:
        theta = self.robot.coupling.expand(q)
        return bool(pinocchio.computeCollisions(self.model, self.data, self.geometry, self.geometry_data, theta, True))


def measured(path: Path, samples: int, seed: int) -> Row:
    """Mark a robot, ask for its coverage, and compare with coal."""
    proposal = pb.propose_marks(pb.load(path))
    with tempfile.TemporaryDirectory() as folder:
        sidecar = Path(folder) / "marks.yaml"
        proposal.annotations.save(sidecar)
        robot = pb.load(path, annotations=sidecar)
    start = time.process_time()
    coverage, record = robot.coverage, robot.coverage.record
    seconds = time.process_time() - start
    rng = np.random.default_rng(seed)
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    Q = rng.uniform(lower, upper, (samples, len(robot.coordinates)))
    Q[::2] = robot.home + rng.uniform(0.0, 0.3, (len(Q[::2]), 1)) * (Q[::2] - robot.home)
    free = Q[np.all(robot.boundaries.clearances(Q) > 0.0, axis=1)]
    certified = [q for q in free[:CERTIFIED] if pb.certify(robot, [q], limits=False).verdict is pb.Verdict.CERTIFIED]
    watched = Raw(robot, path, coverage.watched)
    contacts = sum(watched.contact(q) for q in free)
    others = Raw(robot, path, coverage.open)
    looked = free[:MESHES]
    unseen = sum(others.contact(q) for q in looked)
    return Row(
        path.stem,
        len(robot.tree.links),
        seconds,
        record.summary,
        record,
        len(free),
        len(certified),
        contacts,
        f"{unseen} of {len(looked)}",
    )


def table(rows: list[Row]) -> str:
    """Return the rows as Markdown."""
    heads = ("robot", "links", "bodies", "pairs", "watched", "in part", "neighbours", "cannot touch", "said")
    heads += (
        "not watched",
        "bodies held by no mark",
        "CPU [s]",
        "free",
        "certified",
        "contact, watched",
        "contact, others",
    )
    lines = ["| " + " | ".join(heads) + " |", "| --- |" + " ---: |" * (len(heads) - 1)]
    for row in rows:
        r = row.record
        counts = (r.bodies, r.pairs, r.watched, r.in_part, r.neighbours, r.proven, r.said, r.unwatched, r.unheld)
        cells = (row.name, row.links, *counts, f"{row.seconds:.2f}")
        cells += (row.free, row.certified, row.watched_contacts, row.unseen)
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    lines += ["", "The line that is said with every verdict:", ""]
    return "\n".join([*lines, *(f"- {row.name}: {row.line}." for row in rows)]) + "\n"


def main() -> int:
    """Run, print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows: list[Row] = []
    for name in NAMES:
        if options.only in name:
            rows.append(measured(ROBOTS / name, options.samples, options.seed))
            print(rows[-1].name, rows[-1].line, f"contact: {rows[-1].watched_contacts}", flush=True)
    text = table(rows)
    print(text)
    if options.out is not None:
        said = f"{options.samples} random configurations each, seed {options.seed}."
        options.out.write_text(f"# Coverage of ten robots\n\n`python {' '.join(sys.argv)}`\n\n{text}\n{said}\n")
    return int(any(row.watched_contacts for row in rows))


if __name__ == "__main__":
    sys.exit(main())
