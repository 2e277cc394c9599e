"""Attack what is said of free space: polytopes, covers, volumes, projections, plans, proofs that there is no motion.

    python benchmarks/freespace_campaign.py --count 100000 --seed 0 --log campaign.log
    python benchmarks/freespace_campaign.py --only atlas --count 10000 --seed 0 --log atlas.log

Random arms of two to four joints, turning and sliding, with spheres of radii from 1e-6 to 0.2 m; a third of those of
two joints has a wall with a passage 1e-7 to 1e-2 m wide, or none. Seeds are in contact, outside limits, and 1e-14 to
1e-3 of the way from contact. The oracle shares nothing with pinbound: it places the spheres by its own products of
rotations, which Pinocchio's placements are compared with on every arm. What is said to be free is sampled, on faces, on
corners, and where a random descent finds the smallest clearance. What is said to be apart is flooded on a grid, the
cells of which are joined only where their clearances prove it.

A case is one claim that was attacked: a polytope, a cover, a volume, a projection, a plan, or a pair of an atlas.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy import ndimage

import pinbound as pb

BOXES = (400, 6000)
"""Boxes that a claim may cost: most are made with few, one in eight with many. Most claims cost 5 to 50 ms."""
POLYTOPES, VOLUMES, PLANS = 4, 14, 60
"""Claims a robot, beside one projection, one cover, and those of the pairs of one atlas."""
ATLASES = 3
"""Atlases a robot, where they alone are attacked."""
TOLERANCE = 2.1e-5
"""Metres: up to here there may be contact: the contact tolerance, and a little more."""
NEAR = 1e-11
"""Metres: how much deeper than zero the oracle has to be before it contradicts; its own rounding is 1e-15."""


@dataclass
class Arm:
    """Joints one after the other, and spheres on links; all that the oracle knows."""

    places: np.ndarray
    turns: np.ndarray
    kinds: list[str]
    limits: np.ndarray
    links: np.ndarray
    xyz: np.ndarray
    radii: np.ndarray
    pairs: np.ndarray

    def xml(self) -> str:
        """Return it as URDF."""
        parts = ['<robot name="arm" xmlns:pinbound="urn:pinbound:1"><link name="l0"/>']
        for j, kind in enumerate(self.kinds):
            place = " ".join(map(repr, (self.places[j] + 0.0).tolist()))
            turn = " ".join(map(repr, (self.turns[j] + 0.0).tolist()))
            low, high = self.limits[:, j].tolist()
            parts.append(
                f'<link name="l{j + 1}"/><joint name="q{j + 1}" type="{kind}"><parent link="l{j}"/>'
                f'<child link="l{j + 1}"/><origin xyz="{place}" rpy="{turn}"/><axis xyz="0 1 0"/>'
                f'<limit lower="{low!r}" upper="{high!r}" effort="1" velocity="1"/></joint>'
            )
        parts.append("<pinbound:annotations>")
        for k, (link, xyz, radius) in enumerate(zip(self.links, self.xyz, self.radii, strict=True)):
            place = " ".join(map(repr, xyz.tolist()))
            parts.append(f'<pinbound:point name="p{k}" link="l{link}" xyz="{place}" radius="{float(radius)!r}"/>')
        parts += [f'<pinbound:boundary name="b{a}{b}" a="p{a}" b="p{b}"/>' for a, b in self.pairs]
        return "".join([*parts, "</pinbound:annotations></robot>"])

    def spheres(self, Q: np.ndarray) -> np.ndarray:
        """Return the centres (N, s, 3) in the root's frame."""
        count, at = len(Q), np.zeros((len(Q), 3))
        frame = np.tile(np.eye(3), (count, 1, 1))
        frames, places = [frame], [at]
        for j, kind in enumerate(self.kinds):
            at = at + frame @ self.places[j]
            frame = frame @ pin.rpy.rpyToMatrix(self.turns[j])
            if kind == "prismatic":
                at = at + Q[:, j, None] * frame[:, :, 1]
            else:
                c, s, o, one = np.cos(Q[:, j]), np.sin(Q[:, j]), np.zeros(count), np.ones(count)
                turn = np.stack([c, o, s, o, one, o, -s, o, c], axis=1).reshape(count, 3, 3)
                frame = frame @ turn
            frames.append(frame)
            places.append(at)
        each = [places[link] + frames[link] @ xyz for link, xyz in zip(self.links, self.xyz, strict=True)]
        return np.stack(each, axis=1)

    def clearances(self, Q: np.ndarray) -> np.ndarray:
        """Return the clearances (N, p) of all pairs [m]."""
        centres = self.spheres(Q)
        a, b = self.pairs.T
        return np.linalg.norm(centres[:, a] - centres[:, b], axis=2) - self.radii[a] - self.radii[b]

    def clearance(self, Q: np.ndarray) -> np.ndarray:
        """Return the smallest clearance (N,) [m]; -1 where a limit is passed by more than 1e-9."""
        found = self.clearances(Q)
        beyond = np.any((Q < self.limits[0] - 1e-9) | (Q > self.limits[1] + 1e-9), axis=1)
        return np.where(beyond, -1.0, found.min(axis=1))


def arm_of(rng: np.random.Generator) -> Arm:
    """Return a random arm."""
    n = int(rng.choice([2, 2, 2, 3, 3, 4]))
    if n == 2 and rng.random() < 0.35:
        return walled(rng)
    planar = rng.random() < 0.4
    places = np.column_stack([rng.uniform(-0.05, 0.05, (n, 2)), rng.uniform(0.1, 0.4, n)])
    turns = np.zeros((n, 3)) if planar else rng.uniform(-1.5, 1.5, (n, 3))
    places[:, 1] *= not planar
    kinds = ["prismatic" if rng.random() < 0.1 else "revolute" for _ in range(n)]
    limits = np.array([(0.0, 0.3) if kind == "prismatic" else (-2.5, 2.5) for kind in kinds]).T
    links = np.array([0, 0, 1, n, n, max(1, n - 1)])
    xyz = rng.uniform(-0.4, 0.4, (6, 3)) * ([1, 0, 1] if planar else [1, 1, 1])
    xyz[2:] *= 0.5
    tiny = np.exp(rng.uniform(np.log(1e-6), np.log(0.2), 6))
    radii = np.where(rng.random(6) < 0.5, tiny, rng.uniform(0.02, 0.15, 6))
    pairs = np.array([(0, 3), (1, 4), (0, 4), (2, 3), (1, 5)])
    return Arm(places, turns, kinds, limits, links, xyz, radii, pairs)


def walled(rng: np.random.Generator) -> Arm:
    """Return two joints in a plane, and a sphere that leaves the tip a passage of given width beyond it, or none."""
    one, two = rng.uniform(0.3, 0.5), rng.uniform(0.15, 0.28)
    width = 10.0 ** rng.uniform(-7.0, -2.0) * (1.0 if rng.random() < 0.6 else -1.0)
    far, tip = one + two, rng.uniform(0.01, 0.05)
    inner = one - two
    middle = 0.5 * (inner + far)
    radius = 0.5 * (far - inner) - width - tip if rng.random() < 0.5 else 0.5 * (far - inner) + 0.01 - tip
    middle = middle if radius + tip < 0.5 * (far - inner) else middle - 0.01 - width
    places = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, one]])
    xyz = np.array([[middle, 0.0, 0.1], [0.0, 0.0, two]])
    limits = np.array([[-2.5, -3.1], [2.9, 3.1]])
    radii = np.array([max(radius, 1e-3), tip])
    return Arm(places, np.zeros((2, 3)), ["revolute"] * 2, limits, np.array([0, 2]), xyz, radii, np.array([(0, 1)]))


def load(arm: Arm, folder: Path) -> pb.Robot | None:
    """Return pinbound's robot; None if home is not free."""
    path = folder / "arm.urdf"
    path.write_text(arm.xml())
    try:
        return pb.load(path)
    except pb.InputError:
        return None


def compare(arm: Arm, robot: pb.Robot, rng: np.random.Generator) -> bool:
    """Return whether Pinocchio places the spheres where the oracle does."""
    model = robot.model
    data = model.createData()
    q = rng.uniform(*arm.limits)
    pin.framesForwardKinematics(model, data, robot.to_pinocchio(model, q))
    mine = arm.spheres(q[None])[0]
    theirs = [data.oMf[model.getFrameId(f"l{link}")].act(xyz) for link, xyz in zip(arm.links, arm.xyz, strict=True)]
    return bool(np.abs(mine - np.array(theirs)).max() < 1e-12)


def descended(arm: Arm, inside, Q: np.ndarray, rng: np.random.Generator, steps: int = 12, measured=None) -> np.ndarray:
    """Return the smallest clearances that random descents within a set find from Q (N, n)."""
    measured = measured or arm.clearance
    best, size = measured(Q), np.full(len(Q), 0.2)
    for _ in range(steps):
        trial = Q + size[:, None] * rng.normal(size=Q.shape)
        value = np.where(inside(trial), measured(trial), np.inf)
        better = value < best
        Q, best = np.where(better[:, None], trial, Q), np.where(better, value, best)
        size *= np.where(better, 1.0, 0.75)
    return best


def budget_of(rng: np.random.Generator, times: int = 1) -> pb.Budget:
    """Return a budget: small as a rule, so that what is left open is attacked, too."""
    is_small = rng.random() < 0.875
    return pb.Budget(times * BOXES[0], 0.5) if is_small else pb.Budget(times * BOXES[1], 20.0)


def seed_of(arm: Arm, robot: pb.Robot, rng: np.random.Generator) -> np.ndarray:
    """Return a seed: anywhere, outside limits, or as close to contact as doubles can tell, or a little further."""
    q = rng.uniform(*arm.limits)
    style = rng.integers(0, 4)
    if style == 1:
        return q + 10.0 ** rng.uniform(-13, 0) * rng.normal(size=len(q))
    other = rng.uniform(*arm.limits, (200, len(q)))
    bad = other[arm.clearance(other) <= 0.0]
    if style != 0 or not len(bad):
        return q
    q, far = robot.home.copy(), bad[0]
    for _ in range(60):
        middle = 0.5 * (q + far)
        q, far = (middle, far) if arm.clearance(middle[None])[0] > 0.0 else (q, middle)
    return q + 10.0 ** rng.uniform(-14, -3) * (robot.home - q)


def attack_polytope(arm: Arm, robot: pb.Robot, rng: np.random.Generator, found: Counter[str]) -> None:
    """Look for contact inside a polytope, and for a verdict that is wrong about its seed."""
    q, n = seed_of(arm, robot, rng), len(arm.kinds)
    polytope = pb.certified_polytope(robot, q, budget=budget_of(rng), seed=int(rng.integers(1000)))
    found[f"polytope {polytope.verdict.value}"] += 1
    if polytope.verdict is pb.Verdict.VIOLATED and arm.clearance(q[None])[0] > 2.1e-5:  # the contact tolerance
        found["WRONG violated"] += 1
    if polytope.verdict is not pb.Verdict.CERTIFIED:
        return
    ways = rng.normal(size=(100, n))
    along = ways @ polytope.A.T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(along > 0.0, (polytope.b - polytope.A @ q) / along, np.inf).min(axis=1)
    tried = np.concatenate([q + t * reach[:, None] * ways for t in (0.3, 0.9, 1.0 - 1e-12)] + [q[None]])
    tried = tried[polytope.contains(tried)]
    found["places"] += len(tried)
    if np.any(arm.clearance(tried) <= -NEAR):
        found["WRONG polytope"] += 1
    if len(tried) and np.any(descended(arm, polytope.contains, tried[-8:], rng) <= -NEAR):
        found["WRONG polytope (descent)"] += 1


def attack_volume(arm: Arm, robot: pb.Robot, rng: np.random.Generator, found: Counter[str]) -> None:
    """Look for contact in boxes proven free, on their corners, too, and for a share outside the interval."""
    n = len(arm.kinds)
    names = tuple(rng.permutation(robot.coordinates)[: int(rng.integers(2, min(n, 3) + 1))])
    at = rng.uniform(*arm.limits)
    volume = pb.free_volume(robot, names, at=at, budget=budget_of(rng, 4), decided=0.97)
    found["paving complete" if volume.reason is None else "paving in part"] += 1
    axes = [robot.coordinates.index(name) for name in names]
    if len(volume.free):
        Q = inside_boxes(volume.free, np.tile(at, (120, 1)), axes, rng)
        found["places"] += len(Q)
        if np.any(arm.clearance(Q) <= -NEAR):
            found["WRONG free box"] += 1
    Q = np.tile(at, (400, 1))
    Q[:, axes] = rng.uniform(volume.box[0], volume.box[1], (400, len(axes)))
    share = np.mean(arm.clearance(Q) > 0.0)
    if not volume.lower / volume.volume - 0.15 <= share <= volume.upper / volume.volume + 0.15:
        found["WRONG volume"] += 1


def inside_boxes(boxes: np.ndarray, Q: np.ndarray, axes: list[int], rng: np.random.Generator) -> np.ndarray:
    """Return Q (N, n) with places of boxes in some coordinates, half of them corners."""
    some = boxes[rng.integers(0, len(boxes), len(Q))]
    part = rng.uniform(size=(len(Q), len(axes)))
    part = np.where(rng.random((len(Q), 1)) < 0.5, np.round(part), part)
    Q = Q.copy()
    Q[:, axes] = np.where(part == 1.0, some[:, 1], some[:, 0] + part * (some[:, 1] - some[:, 0]))
    return Q


def attack_projection(arm: Arm, robot: pb.Robot, rng: np.random.Generator, found: Counter[str]) -> None:
    """Look for contact of cells with their witnesses, and for what is free over cells proven out."""
    n = len(arm.kinds)
    names = tuple(rng.permutation(robot.coordinates)[:2])
    budget = budget_of(rng, 4)
    seen = pb.free_projection(robot, names, budget=budget, decided=0.9, seed=int(rng.integers(1000)))
    found["projection complete" if seen.reason is None else "projection in part"] += 1
    axes = [robot.coordinates.index(name) for name in names]
    if len(seen.inside):
        rows = rng.integers(0, len(seen.inside), 100)
        Q = seen.witnesses[rows].copy()
        Q[:, axes] = np.where(rng.random((100, 2)) < 0.5, seen.inside[rows, 0], seen.inside[rows, 1])
        if np.any(arm.clearance(Q) <= -NEAR):
            found["WRONG projection in"] += 1
    if len(seen.outside):
        Q = inside_boxes(seen.outside, rng.uniform(*arm.limits, (400, n)), axes, rng)
        if np.any(arm.clearance(Q) > 2.1e-5):
            found["WRONG projection out"] += 1


def attack_cover(arm: Arm, robot: pb.Robot, rng: np.random.Generator, found: Counter[str]) -> None:
    """Look for contact in the sets of a cover, along plans through them, and for motions that it says do not exist."""
    n = len(arm.kinds)
    cover = pb.certified_cover(robot, share=float(rng.uniform(0.5, 0.95)), budget=budget_of(rng, 4))
    found["cover reached" if cover.reason is None else "cover in part"] += 1
    axes = list(cover.axes)
    if len(cover.boxes):
        Q = inside_boxes(cover.boxes, np.zeros((200, n)), axes, rng)
        if np.any(arm.clearance(Q) <= -NEAR):
            found["WRONG cover"] += 1
    grid = Grid(arm) if n == 2 else None
    for _ in range(PLANS):
        start, goal = rng.uniform(*arm.limits, (2, n))
        speed = 1.0 if rng.random() < 0.2 else None
        budget = pb.Budget(BOXES[0], 0.1) if rng.random() < 0.9 else pb.Budget(BOXES[1], 3.0)
        way = pb.plan(robot, start, goal, budget=budget, cover=cover, velocity=speed, seed=int(rng.integers(1000)))
        found[f"plan {way.verdict.value} {way.found_by}".rstrip()] += 1
        if way.verdict is pb.Verdict.CERTIFIED:
            t = np.linspace(0.0, 1.0, 60)[:, None]
            pieces = [a + t * (b - a) for a, b in zip(way.waypoints, way.waypoints[1:], strict=False)]
            if way.motion is not None:
                pieces.append(way.motion(np.linspace(way.motion.x[0], way.motion.x[-1], 400)))
            if np.any(arm.clearance(np.concatenate(pieces)) <= -NEAR):
                found["WRONG plan"] += 1
        if way.verdict is pb.Verdict.VIOLATED and grid is not None:
            found["no motion, flooded"] += 1
            if grid.joins(start, goal):
                found["WRONG no motion"] += 1


@dataclass
class Said:
    """What an atlas says of one pair: where, and its clearance there, with its sign changed where it is in contact."""

    arm: Arm
    atlas: pb.PairAtlas
    column: int
    pair: int
    where: pb.Where
    sign: float

    def inside(self, Q: np.ndarray) -> np.ndarray:
        """Return where it is said."""
        return self.atlas.pairs_where(Q)[:, self.column] == self.where

    def measured(self, Q: np.ndarray) -> np.ndarray:
        """Return what must not be negative there."""
        return self.sign * self.arm.clearances(Q)[:, self.pair]


def places_of(arm: Arm, atlas: pb.PairAtlas, rng: np.random.Generator) -> np.ndarray:
    """Return places to ask about, 400 anywhere first: at limits, in boxes, on their corners, at ends of intervals."""
    Q = rng.uniform(*arm.limits, (400, len(arm.kinds)))
    parts = [Q, np.where(rng.random(Q.shape) < 0.2, arm.limits[1], Q), np.where(rng.random(Q.shape) < 0.2, Q, Q[0])]
    for group in atlas.groups:
        for where in pb.Where:
            boxes = group.boxes(where)
            if len(boxes) and boxes.shape[2] == len(group.columns) and group.kind != "exact":
                parts.append(inside_boxes(boxes, Q[:60], group.columns.tolist(), rng))
            elif len(boxes) and len(group.columns) == 1:  # ends of intervals, and a little to each side of them
                ends = rng.choice(boxes.ravel(), 60) + np.where(
                    rng.random(60) < 0.5, 0.0, 10.0 ** rng.uniform(-16, -8, 60)
                )
                parts.append(Q[:60].copy())
                parts[-1][:, group.columns[0]] = ends
    return np.concatenate(parts)


def attack_atlas(arm: Arm, robot: pb.Robot, rng: np.random.Generator, found: Counter[str]) -> int:
    """Look for contact where a pair is said to be free, and the other way round; return how many pairs that were."""
    count = len(arm.pairs)
    chosen = np.sort(rng.choice(count, int(rng.integers(1, count + 1)), replace=False))
    names = [f"b{a}{b}" for a, b in arm.pairs[chosen]]
    atlas = pb.pair_atlas(robot, names, budget_of(rng, 4), decided=0.97, each=bool(rng.random() < 0.3))
    found["atlas complete" if atlas.reason is None else "atlas in part"] += 1
    for group in atlas.groups:
        found[f"group {group.kind} over {len(group.columns)}"] += 1
    order = [names.index(name) for name in atlas.boundaries]
    if rng.random() < 0.2:
        with tempfile.TemporaryDirectory() as folder:
            atlas = pb.load_atlas(robot, atlas.save(Path(folder) / "atlas.npz"), names)
    Q = places_of(arm, atlas, rng)
    said, true = atlas.pairs_where(Q), arm.clearances(Q)[:, chosen][:, order]
    found["places"] += said.size
    if np.any(true[said == pb.Where.FREE] <= -NEAR):
        found["WRONG atlas, free"] += 1
    if np.any(true[said == pb.Where.CONTACT] > TOLERANCE):
        found["WRONG atlas, in contact"] += 1
    whole, kept = atlas.where(Q), np.all((Q >= arm.limits[0] - 1e-12) & (Q <= arm.limits[1] + 1e-12), axis=1)
    if np.any((whole == pb.Where.FREE) != (kept & np.all(said == pb.Where.FREE, axis=1))):
        found["WRONG atlas, the whole"] += 1
    for column, pair in enumerate(atlas.pairs):
        for where, sign, depth in ((pb.Where.FREE, 1.0, -NEAR), (pb.Where.CONTACT, -1.0, -TOLERANCE)):
            some = Q[said[:, column] == where][-8:]
            one = Said(arm, atlas, column, int(chosen[order[column]]), where, sign)
            if len(some) and np.any(descended(arm, one.inside, some, rng, 6, one.measured) < depth):
                found[f"WRONG atlas, {where.name.lower()} (descent)"] += 1
        if not pair.free[0] + pair.contact[0] <= pair.volume * (1.0 + 1e-9):
            found["WRONG atlas, volumes"] += 1
        if pair.kind != "exact":
            share = np.mean(true[:400, column] > 0.0)
            if not pair.free[0] / pair.volume - 0.15 <= share <= pair.free[1] / pair.volume + 0.15:
                found["WRONG atlas, volume"] += 1
    return len(names)


class Grid:
    """Places of a grid over two joints; neighbours are joined where both clearances exceed what they move between."""

    def __init__(self, arm: Arm, count: int = 240) -> None:
        """Flood it."""
        self.arm = arm
        self.steps = [np.linspace(*arm.limits[:, j], count) for j in range(2)]
        Q = np.stack(np.meshgrid(*self.steps, indexing="ij"), axis=-1).reshape(-1, 2)
        reach = np.abs(arm.places).sum() + np.abs(arm.xyz).sum(axis=1).max() + 1.0
        self.moved = reach * sum(float(one[1] - one[0]) for one in self.steps)
        self.label, _ = ndimage.label((arm.clearance(Q) > self.moved).reshape(count, count))

    def joins(self, start: np.ndarray, goal: np.ndarray) -> bool:
        """Return whether it proves that a motion joins two configurations."""
        found = []
        for q in (start, goal):
            if self.arm.clearance(q[None])[0] <= self.moved:
                return False
            near = tuple(int(np.argmin(np.abs(one - x))) for one, x in zip(self.steps, q, strict=True))
            found.append(self.label[near])
        return found[0] == found[1] != 0


def attack(arm: Arm, robot: pb.Robot, rng: np.random.Generator, found: Counter[str], only: str | None = None) -> int:
    """Attack one robot in all ways, or by its atlas alone; return how many claims that were."""
    if only == "atlas":
        return sum(attack_atlas(arm, robot, rng, found) for _ in range(ATLASES))
    for _ in range(POLYTOPES):
        attack_polytope(arm, robot, rng, found)
    for _ in range(VOLUMES):
        attack_volume(arm, robot, rng, found)
    attack_projection(arm, robot, rng, found)
    attack_cover(arm, robot, rng, found)
    return POLYTOPES + VOLUMES + 2 + PLANS + attack_atlas(arm, robot, rng, found)


def report(found: Counter[str], cases: int, started: float) -> str:
    """Return what was found so far."""
    lines = [f"{cases} cases, {time.perf_counter() - started:.0f} s, {time.process_time():.0f} s of processor time"]
    return "\n".join(lines + [f"  {name}: {found[name]}" for name in sorted(found)]) + "\n"


def main() -> int:
    """Run the campaign and say what was found; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="cases: claims that are attacked")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=["atlas"], help="one sort of claim alone")
    parser.add_argument("--log", type=Path, help="a file that is written anew after every robot")
    options = parser.parse_args()
    found, started, cases, number = Counter[str](), time.perf_counter(), 0, 0
    while cases < options.count:
        rng = np.random.default_rng([options.seed, number])
        with tempfile.TemporaryDirectory() as folder:
            arm = arm_of(rng)
            if options.only:  # ends in either order, so that chains turn from either end
                turned = np.random.default_rng([options.seed, number, 1]).random(len(arm.pairs)) < 0.5
                arm.pairs = np.where(turned[:, None], arm.pairs[:, ::-1], arm.pairs)
            robot = load(arm, Path(folder))
            if robot is None:
                found["home not free"] += 1
            else:
                before = sum(count for name, count in found.items() if name.startswith("WRONG"))
                found["WRONG oracle"] += not compare(arm, robot, rng)
                cases += attack(arm, robot, rng, found, options.only)
                if sum(count for name, count in found.items() if name.startswith("WRONG")) > before:
                    print(f"robot {number} of seed {options.seed}", flush=True)
                    found[f"robot {number} of seed {options.seed}"] += 1
        number += 1
        if options.log:
            options.log.write_text(report(found, cases, started))
    print(report(found, cases, started), end="")
    return int(any(name.startswith("WRONG") and count for name, count in found.items()))


if __name__ == "__main__":
    sys.exit(main())
