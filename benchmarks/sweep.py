"""Every URDF of example-robot-data, and those of a folder: vectors, gradients, Hessians, ancestors against Pinocchio.

python benchmarks/sweep.py [--pairs 200] [--configurations 100] [--folder ../shared/robots] [--out docs/sweep.md]
"""

from __future__ import annotations

import argparse
import importlib.metadata
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import pinbound as pb

STEP = 1e-5
REMEDIES = {
    # A follower of a missing joint and limits the wrong way round cannot be right; the user says what is meant.
    "alex_psyonic_hands.urdf": lambda joints: {
        "followers": tuple(
            pb.FollowerMark(name, f"{name.split('_')[0]}_{primary}", multiplier, offset)
            for name, primary, multiplier, offset in joints
        )
    },
    "dobot_magician.urdf": lambda _: {"limits": (pb.LimitMark("magician_joint_prismatic_r", -0.0135, 0.0),)},
}

HEAD = """# Every URDF of example-robot-data

Random pairs of points on random links, random configurations in [-pi, pi]. Vectors and norms against Pinocchio's frame
placements, relative to |r|; gradients [m/rad] and Hessians [m/rad^2] against central differences with a step of 1e-5,
where the norm is above 20 mm (the differences themselves are good to about 1e-9 there); ancestors against
`pin.findCommonAncestor` (where the lowest common link is a helper, pinbound's is above it by design). Made by

```sh
{command} --out docs/sweep.md
```

"""
REMEDIES_TEXT = """
alex_psyonic_hands.urdf lets followers follow joints that do not exist, and dobot_magician.urdf has a lower limit above
its upper one: pinbound refuses both as they are; here the annotations say what is meant (`followers`, `limits`).
"""


@dataclass(frozen=True)
class Row:
    """What was seen on one robot."""

    name: str
    coordinates: int
    joints: int
    pairs: int
    vector: float
    gradient: float
    hessian: float
    ancestors: int


def files(folder: Path | None) -> list[Path]:
    """Return the URDFs to go through."""
    data = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    found = sorted((data / "example-robot-data" / "robots").rglob("*.urdf"))
    return found + (sorted(folder.rglob("*.urdf")) if folder is not None and folder.is_dir() else [])


def remedy(path: Path) -> dict[str, Any]:
    """Return annotations that say what a URDF that cannot be right means."""
    from lxml import etree

    if path.name not in REMEDIES:
        return {}
    joints = []
    for element in etree.parse(str(path)).getroot().iterfind("joint"):
        mimic = element.find("mimic")
        if mimic is not None and not str(mimic.get("joint")).startswith(("Left", "Right")):
            multiplier, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
            joints.append((str(element.get("name")), str(mimic.get("joint")), multiplier, offset))
    return REMEDIES[path.name](joints)


def marked(path: Path, pairs: int, rng: np.random.Generator) -> pb.Robot:
    """Return a robot with random boundaries between links that no floating or planar joint separates."""
    extra = remedy(path)
    bare = pb.load(path, annotations=pb.Annotations(**extra))
    groups = rigid_groups(bare)
    links = [name for group in groups if len(group) > 1 for name in group]
    if len(links) < 2:
        return bare
    group_of = {name: group for group in groups for name in group}
    points, boundaries = [], []
    for index in range(pairs):
        first = str(rng.choice(links))
        second = str(rng.choice([name for name in group_of[first] if name != first]))
        ends = [pb.Point(f"{end}{index}", link, tuple(rng.uniform(-0.3, 0.3, 3).tolist()))
                for end, link in (("a", first), ("b", second))]  # fmt: skip
        points += ends
        boundaries.append(pb.BoundaryMark(f"beta_{index}", ends[0].name, ends[1].name))
    return pb.load(path, annotations=pb.Annotations.of(points, boundaries, contact_tolerance=0.0, **extra))


def rigid_groups(robot: pb.Robot) -> list[list[str]]:
    """Return the links in groups that only joints of one coordinate, and fixed ones, connect."""
    group: dict[str, list[str]] = {}
    for link, joint, _ in robot.tree.walk():
        start = joint is None or joint.type in ("floating", "planar")
        group[link.name] = [] if start else group[joint.parent]
        group[link.name].append(link.name)
    return list({id(members): members for members in group.values()}.values())


def check(robot: pb.Robot, path: Path, count: int, rng: np.random.Generator) -> Row:
    """Compare every law on random configurations beyond the limits; raise if an ancestor is wrong."""
    model, B = robot.model, robot.boundaries
    data = model.createData()
    Q = rng.uniform(-np.pi, np.pi, (count, len(robot.coordinates)))
    expected = np.empty((count, len(B), 3))
    frames = [[model.getFrameId(name, pin.BODY) for name in (b.ancestor, b.point_a.link, b.point_b.link)] for b in B]
    for row, theta in enumerate(robot.coupling.expand(Q)):
        pin.framesForwardKinematics(model, data, theta)
        for column, (boundary, (ancestor, a, b)) in enumerate(zip(B, frames, strict=True)):
            r = data.oMf[a] * np.array(boundary.point_a.xyz) - data.oMf[b] * np.array(boundary.point_b.xyz)
            expected[row, column] = data.oMf[ancestor].rotation.T @ r
    vectors = B.vectors(Q)
    lengths = np.linalg.norm(expected, axis=2)
    vector = float(np.max(np.linalg.norm(vectors - expected, axis=2) / lengths, initial=0.0))
    vector = max(vector, float(np.max(np.abs(B.norms(Q) - lengths) / lengths, initial=0.0)))
    few = Q[:10]
    gradient = hessian = 0.0
    if len(B):
        away = B.norms(few)[:, :, None] > 0.02
        gradients, hessians = B.gradients(few), B.hessians(few)
        for index in range(len(robot.coordinates)):
            h = STEP * np.eye(len(robot.coordinates))[index]
            first = (B.norms(few + h) - B.norms(few - h)) / (2 * STEP)
            gradient = max(gradient, float(np.max(np.abs(gradients[:, :, index] - first)[away[:, :, 0]], initial=0.0)))
            second = (B.gradients(few + h) - B.gradients(few - h)) / (2 * STEP)
            error = np.where(away, np.abs(hessians[:, :, :, index] - second), 0.0)
            hessian = max(hessian, float(np.max(error, initial=0.0)))
    return Row(
        path.name,
        len(robot.coordinates),
        len(robot.coupling.joints),
        len(B),
        vector,
        gradient,
        hessian,
        sum(same_ancestor(robot, boundary) for boundary in B),
    )


def same_ancestor(robot: pb.Robot, boundary: pb.Boundary) -> bool:
    """Return whether Pinocchio finds the same common ancestor joint, and the kind agrees with it."""
    model = robot.model

    def joint(link: str) -> int:
        return int(model.frames[model.getFrameId(link, pin.BODY)].parentJoint)

    a, b = joint(boundary.point_a.link), joint(boundary.point_b.link)
    common = int(pin.findCommonAncestor(model, a, b)[0])
    serial = boundary.kind in (pb.Kind.CONSECUTIVE, pb.Kind.NON_CONSECUTIVE)
    if serial and common not in (a, b):
        raise AssertionError(f"{boundary} is called serial, but Pinocchio finds a branch")
    found = joint(boundary.ancestor)
    if found == common:
        return True
    lca = next(n for n in robot.tree.lineage(boundary.point_a.link) if n in robot.tree.lineage(boundary.point_b.link))
    if lca not in robot.tree.helpers or joint(lca) != common:
        raise AssertionError(f"{boundary}: ancestor {boundary.ancestor}, but Pinocchio finds joint {common}")
    return False


def main() -> int:
    """Go through all robots, print the table, and fail if a law does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--configurations", type=int, default=100)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parents[2] / "shared" / "robots")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    lines = [
        "| robot | coordinates | moving joints | pairs | vectors, worst relative error | gradients, worst | "
        "Hessians, worst | ancestors equal |",
        "| --- | --: | --: | --: | --: | --: | --: | --: |",
    ]
    worst, refused, derivatives = 0.0, 0, True
    print("\n".join(lines))
    for path in files(options.folder):
        rng = np.random.default_rng(2026)
        try:
            row = check(marked(path, options.pairs, rng), path, options.configurations, rng)
        except pb.InputError as error:
            refused += 1
            lines.append(f"| {path.name} | refused: {error.problems[0].message!s} | | | | | | |")
            print(lines[-1])
            continue
        worst = max(worst, row.vector)
        derivatives &= row.gradient < 1e-7 and row.hessian < 1e-5
        lines.append(
            f"| {row.name} | {row.coordinates} | {row.joints} | {row.pairs} | {row.vector:.1e} | {row.gradient:.1e} | "
            f"{row.hessian:.1e} | {row.ancestors} of {row.pairs} |"
        )
        print(lines[-1], flush=True)
    summary = f"{len(lines) - 2 - refused} robots, {refused} refused, worst relative error {worst:.1e}"
    print(summary)
    if options.out is not None:
        command = f"python benchmarks/sweep.py --pairs {options.pairs} --configurations {options.configurations}"
        text = HEAD.format(command=command)
        options.out.write_text(text + "\n".join(lines) + f"\n\n{summary}.\n{REMEDIES_TEXT}", encoding="utf-8")
    return int(worst >= 1e-12)


if __name__ == "__main__":
    sys.exit(main())
