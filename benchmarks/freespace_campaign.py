"""Attack free polytopes, free volumes and plans: thin obstacles, seeds in contact, outside limits, or close to contact.

    python benchmarks/freespace_campaign.py --count 200 --seed 0

Random arms of two to four joints, turning and sliding, with spheres of radii from 1e-6 to 0.2 m. The oracle shares
nothing with pinbound: Pinocchio places the frames, and the distance of two centres is compared with the radii. What is
said to be free is sampled, on faces, at places that a local search finds nearest to contact, and all over.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pinocchio as pin

import pinbound as pb

ORIGIN = '<origin xyz="{0:.4f} {1:.4f} {2:.4f}" rpy="{3:.4f} {4:.4f} {5:.4f}"/>'


def robot_of(rng: np.random.Generator, folder: Path) -> pb.Robot | None:
    """Return a random arm; None if home is not free."""
    n = int(rng.integers(2, 5))
    planar = rng.random() < 0.4
    parts = ['<robot name="arm" xmlns:pinbound="urn:pinbound:1"><link name="l0"/>']
    for j in range(n):
        rpy = np.zeros(3) if planar else rng.uniform(-1.5, 1.5, 3)
        place = np.array([*rng.uniform(-0.05, 0.05, 2), rng.uniform(0.1, 0.4)]) * ([1, 0, 1] if planar else [1, 1, 1])
        kind, limit = ("prismatic", (0.0, 0.3)) if rng.random() < 0.1 else ("revolute", (-2.5, 2.5))
        parts.append(
            f'<link name="l{j + 1}"/><joint name="q{j + 1}" type="{kind}"><parent link="l{j}"/><child link="l{j + 1}"/>'
            f'{ORIGIN.format(*place, *rpy)}<axis xyz="0 1 0"/>'
            f'<limit lower="{limit[0]}" upper="{limit[1]}" effort="1" velocity="1"/></joint>'
        )
    parts.append("<pinbound:annotations>")
    for k in range(6):
        link = [0, 0, 1, n, n, max(1, n - 1)][k]
        xyz = rng.uniform(-0.4, 0.4, 3) * ([1, 0, 1] if planar else [1, 1, 1]) * (1.0 if k < 2 else 0.5)
        radius = (
            float(np.exp(rng.uniform(np.log(1e-6), np.log(0.2)))) if rng.random() < 0.5 else rng.uniform(0.02, 0.15)
        )
        parts.append(f'<pinbound:point name="p{k}" link="l{link}" xyz="{xyz[0]} {xyz[1]} {xyz[2]}" radius="{radius}"/>')
    for a, b in ((0, 3), (1, 4), (0, 4), (2, 3), (1, 5)):
        parts.append(f'<pinbound:boundary name="b{a}{b}" a="p{a}" b="p{b}"/>')
    path = folder / "arm.urdf"
    path.write_text("".join([*parts, "</pinbound:annotations></robot>"]))
    try:
        return pb.load(path)
    except pb.InputError:
        return None


class Oracle:
    """Clearances by Pinocchio's placements."""

    def __init__(self, robot: pb.Robot) -> None:
        self.robot, self.model = robot, robot.model
        self.data = self.model.createData()
        self.points = robot.annotations.points
        self.frames = {name: self.model.getFrameId(point.link) for name, point in self.points.items()}

    def clearance(self, q: np.ndarray) -> float:
        """Return the smallest clearance at q [m], limits counted as -1 where one is passed by more than 1e-9."""
        robot = self.robot
        if np.any(q < robot.lower - 1e-9) or np.any(q > robot.upper + 1e-9):
            return -1.0
        pin.framesForwardKinematics(self.model, self.data, robot.to_pinocchio(self.model, q))
        place = {name: self.data.oMf[self.frames[name]].act(np.array(point.xyz)) for name, point in self.points.items()}
        least = np.inf
        for one in robot.boundaries:
            a, b = one.point_a, one.point_b
            least = min(least, float(np.linalg.norm(place[a.name] - place[b.name])) - a.radius - b.radius)
        return least


def worst(oracle: Oracle, inside, q: np.ndarray, rng: np.random.Generator, steps: int = 40) -> float:
    """Return the smallest clearance that a random descent within a set finds from q."""
    best, size = oracle.clearance(q), 0.2
    for _ in range(steps):
        trial = q + size * rng.normal(size=len(q))
        if not inside(trial):
            size *= 0.7
            continue
        value = oracle.clearance(trial)
        if value < best:
            q, best = trial, value
        else:
            size *= 0.8
    return best


def seed_of(robot: pb.Robot, rng: np.random.Generator) -> np.ndarray:
    """Return a seed: anywhere, outside limits, or as close to contact as doubles can tell, or a little further."""
    n = len(robot.coordinates)
    q = rng.uniform(robot.lower, robot.upper)
    style = rng.integers(0, 4)
    if style == 1:
        return q + 10.0 ** rng.uniform(-13, 0) * rng.normal(size=n)
    other = rng.uniform(robot.lower, robot.upper, (200, n))
    bad = other[~robot.boundaries.free(other)]
    if style != 0 or not len(bad):
        return q
    q, far = robot.home.copy(), bad[0]
    for _ in range(60):
        middle = 0.5 * (q + far)
        q, far = (middle, far) if robot.boundaries.free(middle) else (q, middle)
    return q + 10.0 ** rng.uniform(-14, -3) * (robot.home - q)


def attack_polytope(robot: pb.Robot, q: np.ndarray, rng: np.random.Generator, found: Counter[str]) -> None:
    """Look for contact inside a polytope, and for a verdict that is wrong about its seed."""
    oracle, n = Oracle(robot), len(robot.coordinates)
    polytope = pb.certified_polytope(robot, q, budget=pb.Budget(10**9, 4.0), seed=int(rng.integers(1000)))
    found[f"polytope {polytope.verdict.value}"] += 1
    if polytope.verdict is pb.Verdict.VIOLATED and oracle.clearance(q) > 2.1e-5:  # the contact tolerance, and rounding
        found["WRONG violated"] += 1
    if polytope.verdict is not pb.Verdict.CERTIFIED:
        return
    Q = rng.uniform(np.maximum(robot.lower, -3), np.minimum(robot.upper, 3), (300, n))
    ways = rng.normal(size=(100, n))
    along = ways @ polytope.A.T
    reach = (polytope.b - polytope.A @ q) / np.where(along > 0.0, along, 1.0)
    reach = np.where(along > 0.0, reach, np.inf).min(axis=1)
    faces = q + (1.0 - 1e-12) * reach[:, None] * ways
    tried = np.concatenate([Q[polytope.contains(Q)], faces[polytope.contains(faces)], q[None]])
    found["samples"] += len(tried)
    if any(oracle.clearance(one) <= -1e-12 for one in tried):
        found["WRONG polytope"] += 1
    if any(worst(oracle, polytope.contains, one, rng) <= -1e-12 for one in tried[-6:]):
        found["WRONG polytope (descent)"] += 1


def attack_volume(robot: pb.Robot, rng: np.random.Generator, found: Counter[str]) -> None:
    """Look for contact in boxes proven free, and for a share of free samples outside the interval."""
    oracle, n = Oracle(robot), len(robot.coordinates)
    names = tuple(rng.permutation(robot.coordinates)[: int(rng.integers(2, min(n, 3) + 1))])
    at = rng.uniform(robot.lower, robot.upper)
    volume = pb.free_volume(robot, names, at=at, budget=pb.Budget(10**9, 2.0), decided=0.97)
    found["paving complete" if volume.reason is None else "paving in part"] += 1
    axes = [robot.coordinates.index(name) for name in names]
    if len(volume.free):
        boxes = volume.free[rng.integers(0, len(volume.free), 60)]
        Q = np.tile(at, (60, 1))
        Q[:, axes] = boxes[:, 0] + rng.uniform(size=(60, len(axes))) * (boxes[:, 1] - boxes[:, 0])
        found["samples"] += 60
        if any(oracle.clearance(one) <= -1e-12 for one in Q):
            found["WRONG free box"] += 1
    Q = np.tile(at, (400, 1))
    Q[:, axes] = rng.uniform(volume.box[0], volume.box[1], (400, len(axes)))
    share = np.mean([oracle.clearance(one) > 0.0 for one in Q])
    if not volume.lower / volume.volume - 0.15 <= share <= volume.upper / volume.volume + 0.15:
        found["WRONG volume"] += 1


def attack_plan(robot: pb.Robot, q: np.ndarray, rng: np.random.Generator, found: Counter[str]) -> None:
    """Look for contact along a plan that is certified."""
    oracle = Oracle(robot)
    way = pb.plan(robot, q, rng.uniform(robot.lower, robot.upper), budget=pb.Budget(10**9, 1.0))
    found[f"plan {way.verdict.value}"] += 1
    for a, b in zip(way.waypoints, way.waypoints[1:], strict=False):
        if any(oracle.clearance(a + t * (b - a)) <= -1e-12 for t in np.linspace(0, 1, 40)):
            found["WRONG plan"] += 1


def attack(robot: pb.Robot, rng: np.random.Generator, found: Counter[str]) -> None:
    """Attack one robot in all three ways."""
    q = seed_of(robot, rng)
    attack_polytope(robot, q, rng, found)
    attack_volume(robot, rng, found)
    attack_plan(robot, q, rng, found)


def main() -> int:
    """Run the campaign and say what was found; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found, started = Counter[str](), time.perf_counter()
    for number in range(options.count):
        rng = np.random.default_rng([options.seed, number])
        with tempfile.TemporaryDirectory() as folder:
            robot = robot_of(rng, Path(folder))
            if robot is None:
                found["home not free"] += 1
                continue
            before = sum(count for name, count in found.items() if name.startswith("WRONG"))
            attack(robot, rng, found)
            if sum(count for name, count in found.items() if name.startswith("WRONG")) > before:
                print(f"case {number} of seed {options.seed}", flush=True)
    for name in sorted(found):
        print(f"{name}: {found[name]}")
    print(f"{time.perf_counter() - started:.0f} s")
    return int(any(name.startswith("WRONG") for name in found))


if __name__ == "__main__":
    sys.exit(main())
