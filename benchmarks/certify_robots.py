"""Certificates of UR5, Panda and Talos' arms against coal, on the same spheres.

    python benchmarks/certify_robots.py --motions 100 --seed 0 --out docs/certificates-robots.md

Each collision body is covered: the box around it is cut across its longest side into nearly cubic cells, and each cell
gets the sphere through its corners. Pairs of spheres of links at least two joints apart become boundaries, except
those that overlap at home (the cover is generous). Random straight motions are certified and, with Pinocchio placing
the spheres and coal measuring them, sampled. Exit code 1 on any disagreement.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import math
import sys
import tempfile
import time
from collections import Counter
from importlib.metadata import distribution
from pathlib import Path

import coal
import numpy as np
import pinocchio
import yaml

import pinbound as pb

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = SHARE / "example-robot-data" / "robots"
SAMPLES = 400


@dataclasses.dataclass(frozen=True)
class Case:
    name: str
    urdf: Path
    moving: tuple[str, ...]
    links: tuple[str, ...]
    spread: float


CASES = (
    Case("UR5", ROBOTS / "ur_description/urdf/ur5_robot.urdf", ("",), ("",), 1.2),
    Case("Panda", ROBOTS / "panda_description/urdf/panda.urdf", ("panda_joint",), ("",), 0.8),
    Case(
        "Talos, torso and both arms",
        ROBOTS / "talos_data/robots/talos_reduced.urdf",
        ("torso_", "arm_"),
        ("torso_", "arm_", "base_link", "wrist_"),
        0.5,
    ),
)


def cover(model: pinocchio.Model, case: Case) -> list[tuple[str, np.ndarray, float]]:
    """Return spheres (link, centre in the link's frame, radius) around every collision body of the case's links."""
    geometry = pinocchio.buildGeomFromUrdf(model, str(case.urdf), pinocchio.COLLISION, package_dirs=[str(SHARE)])
    spheres = []
    for body in geometry.geometryObjects:
        frame = model.frames[body.parentFrame]
        if not any(frame.name.startswith(prefix) for prefix in case.links):
            continue
        body.geometry.computeLocalAABB()
        low, high = (np.array(end) for end in (body.geometry.aabb_local.min_, body.geometry.aabb_local.max_))
        size = high - low
        axis = int(np.argmax(size))
        cells = max(1, min(4, round(size[axis] / max(np.sort(size)[1], 1e-3))))
        step = size / np.where(np.arange(3) == axis, cells, 1)
        for cell in range(cells):
            centre = low + 0.5 * step + np.where(np.arange(3) == axis, cell, 0) * step
            placed = (frame.placement.inverse() * body.placement).act(centre)
            spheres.append((frame.name, placed, 0.5 * float(np.linalg.norm(step))))
    return spheres


def annotate(robot: pb.Robot, case: Case, spheres: list, folder: Path) -> Path:
    """Write a sidecar with all pairs that are two joints apart and free at home."""
    home = robot.coupling.expand(robot.home)
    data = robot.model.createData()
    pinocchio.framesForwardKinematics(robot.model, data, home)
    frames = {frame.name: index for index, frame in enumerate(robot.model.frames)}
    places = [data.oMf[frames[link]].act(xyz) for link, xyz, _ in spheres]
    pairs = []
    for (i, a), (j, b) in itertools.combinations(enumerate(spheres), 2):
        top = robot.tree.common_ancestor(a[0], b[0])
        joints = [*robot.tree.descent(top, a[0]), *robot.tree.descent(top, b[0])]
        apart = sum(joint.moves and joint.mimic is None for joint in joints)
        if apart >= 2 and np.linalg.norm(places[i] - places[j]) > a[2] + b[2] + 1e-3:
            pairs.append((i, j))
    document = {
        "points": [
            {"name": f"s{i}", "link": link, "xyz": [float(x) for x in xyz], "radius": radius}
            for i, (link, xyz, radius) in enumerate(spheres)
        ],
        "boundaries": [{"name": f"s{i}_s{j}", "a": f"s{i}", "b": f"s{j}"} for i, j in pairs],
    }
    path = folder / f"{case.urdf.stem}.yaml"
    path.write_text(yaml.safe_dump(document, default_flow_style=None), encoding="utf-8")
    return path


class Coal:
    """Distances of the same spheres by coal, placed by Pinocchio."""

    def __init__(self, robot: pb.Robot) -> None:
        self.robot, self.data = robot, robot.model.createData()
        self.geometry = pinocchio.GeometryModel()
        frames = {frame.name: index for index, frame in enumerate(robot.model.frames)}
        ids = {}
        for point in robot.annotations.points.values():
            frame = robot.model.frames[frames[point.link]]
            placement = frame.placement * pinocchio.SE3(np.eye(3), np.array(point.xyz))
            body = pinocchio.GeometryObject(point.name, frame.parentJoint, placement, coal.Sphere(point.radius))
            ids[point.name] = self.geometry.addGeometryObject(body)
        for boundary in robot.boundaries:
            pair = pinocchio.CollisionPair(ids[boundary.point_a.name], ids[boundary.point_b.name])
            self.geometry.addCollisionPair(pair)
        self.results = pinocchio.GeometryData(self.geometry)

    def distances(self, Q: np.ndarray) -> np.ndarray:
        found = np.empty((len(Q), len(self.robot.boundaries)))
        for row, theta in enumerate(self.robot.coupling.expand(Q)):
            pinocchio.computeDistances(self.robot.model, self.data, self.geometry, self.results, theta)
            found[row] = [result.min_distance for result in self.results.distanceResults]
        return found


def run(case: Case, motions: int, seed: int, folder: Path) -> tuple[str, Counter]:
    rng = np.random.default_rng(seed)
    bare = pb.load(case.urdf)
    robot = pb.load(case.urdf, annotations=annotate(bare, case, cover(bare.model, case), folder))
    coal_side = Coal(robot)
    moving = np.array([any(name.startswith(prefix) for prefix in case.moving) for name in robot.coordinates])
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    verdicts, wrong = Counter(), Counter()
    times, boxes, least_open, worst = [], 0, math.inf, 0.0
    for _ in range(motions):
        ends = robot.home + rng.normal(0.0, case.spread * rng.uniform(0.1, 1.0), (2, len(moving))) * moving
        ends = np.where(moving, np.clip(ends, lower, upper), robot.home)
        started = time.process_time()
        found = pb.certify(robot, ends, each=False)
        times.append(time.process_time() - started)
        boxes += found.boxes
        verdicts[found.verdict.value] += 1
        u = np.append(np.linspace(0.0, 1.0, SAMPLES), [finding.time for finding in found.boundaries[:1]])
        sampled = coal_side.distances(ends[0] + u[:, None] * (ends[1] - ends[0])).min(axis=0)
        proven = np.array([finding.lower for finding in found.boundaries])
        is_clear = np.array([finding.verdict is pb.Verdict.CERTIFIED for finding in found.boundaries])
        wrong["CERTIFIED, but coal finds contact"] += int(np.sum(is_clear & (sampled <= 0.0)))
        wrong["lower bound above coal's distance"] += int(np.sum(proven > sampled + 1e-12))
        is_open = np.array([finding.verdict is pb.Verdict.UNDECIDED for finding in found.boundaries])
        least_open = min(least_open, float(np.abs(sampled[is_open]).min(initial=math.inf)))
        for row, finding in enumerate(found.boundaries):
            if finding.contact is not None:
                measured = coal_side.distances(finding.contact.q[None])[0, row]
                wrong["VIOLATED, but coal finds no contact there"] += measured >= 1e-12
                worst = max(worst, abs(measured - finding.contact.clearance))
        tightest = found.tightest
        if tightest is not None:
            gap = abs(coal_side.distances(tightest.q[None]).min() - tightest.upper)
            worst = max(worst, float(gap))
    milliseconds = 1e3 * np.array(times)
    row = (
        f"| {case.name} | {len(robot.annotations.points)} | {len(robot.boundaries)} | {verdicts['certified']} | "
        f"{verdicts['violated']} | {verdicts['undecided']} | {sum(wrong.values())} | {worst:.1e} | "
        f"{np.median(milliseconds):.0f} | {np.percentile(milliseconds, 95):.0f} | {boxes / motions:,.0f} |"
    )
    return row, wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp())
    lines = [
        "| robot | spheres | pairs | certified | violated | undecided | disagreements | "
        "largest difference to coal [m] | median CPU [ms] | 95 % [ms] | boxes |",
        "| --- |" + " ---: |" * 10,
    ]
    total: Counter = Counter()
    for case in CASES:
        row, wrong = run(case, options.motions, options.seed, folder)
        lines.append(row)
        total += wrong
        sys.stdout.write(row + "\n")
        sys.stdout.flush()
    lines += [
        "",
        f"{options.motions} random motions each, seed {options.seed}; disagreements: {dict(total) or 'none'}.",
    ]
    text = "\n".join(lines) + "\n"
    sys.stdout.write(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return int(any(total.values()))


if __name__ == "__main__":
    sys.exit(main())
