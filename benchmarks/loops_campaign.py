"""Loops that are not parallelograms, three campaigns: places against Newton at 50 digits, toggles, and proofs.

python -m benchmarks.loops_campaign [linkages] [motions] [seed of the motions]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import mpmath
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import linkages as zoo
import pinbound as pb
from pinbound.certificates.constraints import families
from pinbound.certificates.lifted import LiftedTrajectory
from pinbound.certificates.trajectory import as_trajectory
from pinbound.loops.solving import toggles
from pinbound.robot.loop_robot import LoopRobot

_FLAT = 0.999  # places are compared where the arms are 2.5 degrees or more from in line
_SAMPLES = 65


def loaded(kind: str, rng: np.random.Generator) -> tuple[zoo.Mechanism, LoopRobot]:
    """Return a random mechanism with random marks that closes at home, and its robot."""
    while True:
        mechanism = zoo.KINDS[kind](rng)
        mechanism.home = {part.name: float(rng.uniform(-1.5, 1.5)) for part in mechanism.parts}
        links = ["base", *(part.child for part in mechanism.parts)]
        marks: list[str] = []
        for k, link in enumerate(links):
            x, y, z = rng.uniform(-0.5, 0.5, 3)
            marks.append(
                f'<pinbound:point name="p{k}" link="{link}" xyz="{x} {y} {z}" radius="{rng.uniform(0.01, 0.2)}"/>'
            )
            x, y, z = rng.uniform(-0.5, 0.5, 3)
            ends = f'xyz_a="0 0 0.3" xyz_b="{x} {y} {z}" radius="{rng.uniform(0.01, 0.15)}"'
            marks.append(f'<pinbound:segment name="s{k}" link="{link}" {ends}/>')
        pairs = [(i, j) for i in range(len(links)) for j in range(i + 1, len(links))]
        for i, j in pairs:
            marks.append(f'<pinbound:boundary name="p{i}p{j}" a="p{i}" b="p{j}"/>')
            marks.append(f'<pinbound:boundary name="s{i}p{j}" a="s{i}" b="p{j}"/>')
        try:
            robot = pb.load(mechanism.urdf("".join(marks)))
        except pb.InputError:
            continue
        if isinstance(robot, LoopRobot):
            return mechanism, robot


def _spread(robot: LoopRobot, rng: np.random.Generator, count: int) -> np.ndarray:
    return robot.home + rng.uniform(-3.0, 3.0, (count, len(robot.coordinates)))


def places(count: int) -> None:
    """Compare the pins' places, and the toggles, of random linkages with Newton at 50 digits."""
    rng, worst, off, seen = np.random.default_rng(1), 0.0, 0.0, 0
    done, poses, began = 0, 0, time.perf_counter()
    while done < count:
        for kind in zoo.KINDS:
            mechanism = zoo.KINDS[kind](rng)
            mechanism.home = {part.name: float(rng.uniform(-1.5, 1.5)) for part in mechanism.parts}
            try:
                robot = pb.load(mechanism.urdf())
            except pb.InputError:
                continue
            if not isinstance(robot, LoopRobot):
                continue
            one, column = robot.lift.linkages[0], robot.lift.columns[0][2]
            Q = _spread(robot, rng, 40)
            w = robot.lift(Q)[:, column]
            low, high = one.transmission_range
            inside = np.abs(w) < _FLAT if np.isfinite(high) else w > low + 1e-3
            for q in Q[inside][:2]:
                theta = dict(zip(robot.coupling.joints, robot.coupling.expand(q).tolist(), strict=True))
                rough = {n: v if n in robot.coordinates else round(v, 4) for n, v in theta.items()}
                exact, ours = mechanism.solved(rough), {n: mpmath.mpf(v) for n, v in theta.items()}
                _, *ends = mechanism.pins[0]
                for link, point in zip(ends[::2], ends[1::2], strict=True):
                    gap = mechanism.place(link, point, ours) - mechanism.place(link, point, exact)
                    worst = max(worst, float(abs(gap)))
                poses += 1
            at = toggles(one)
            if at is not None:
                for x in at.angles:
                    off = max(off, _off_toggle(mechanism, robot, at.row, x))
                    seen += 1
            done += 1
            if done % 500 == 0 or done == count:
                took = time.perf_counter() - began
                print(
                    f"{done} linkages, {poses} poses: pins within {worst:.1e} m, {seen} toggles within {off:.1e} rad "
                    f"of 50 digits ({took:.0f} s)",
                    flush=True,
                )
    if not (worst < 1e-12 and off < 1e-9):
        raise SystemExit(1)


def _off_toggle(mechanism: zoo.Mechanism, robot: LoopRobot, row: np.ndarray, x: float) -> float:
    """Return how far a toggle is from the pose, found by Newton at 50 digits, in which the pin moves one way only."""
    (index,) = np.flatnonzero(row).tolist()
    w, (low, high) = robot.lift.columns[0][2], robot.lift.linkages[0].transmission_range
    for side in (1e-3, -1e-3, 1e-5, -1e-5):
        q = robot.home.copy()
        q[index] = (x + side) / row[index]
        if low <= robot.lift(q)[w] <= high:
            break
    theta = dict(zip(robot.coupling.joints, robot.coupling.expand(q).tolist(), strict=True))
    found = mechanism.toggled(theta, robot.coordinates[index])
    return float(abs(mpmath.mpf(float(row[index])) * found - mpmath.mpf(x)))


def motions(count: int, seed: int = 2) -> None:
    """Hold what is proven clear of short and long motions against dense samples of them, by Pinocchio's kinematics."""
    rng, false, clear, total, violated, wrong = np.random.default_rng(seed), 0, 0, 0, 0, 0
    began, robots = time.perf_counter(), 0
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
    while total < count:
        for kind in zoo.KINDS:
            _, robot = loaded(kind, rng)
            robots += 1
            start = _spread(robot, rng, 200)
            start = start[robot.intervals.hold(start)][:80]
            if not len(start):
                continue
            length = 10.0 ** rng.uniform(-3.0, 0.5, len(start))
            end = start + length[:, None] * rng.uniform(-1.0, 1.0, start.shape)
            waypoints = np.stack((start, end), axis=1).reshape(-1, start.shape[1])
            motion = LiftedTrajectory.of(robot, as_trajectory(waypoints, robot.coordinates))
            piece = 2 * np.arange(len(start))
            part = motion.expand(piece, np.zeros(len(start)), np.ones(len(start)))
            samples = (start + share * (end - start)).reshape(-1, start.shape[1])
            Z = robot.lift(samples)
            signed = robot.opened.boundaries.signed_clearances(Z).reshape(_SAMPLES, len(start), -1)
            kept = robot.opened.intervals.hold(Z).reshape(_SAMPLES, len(start))
            wrong += _disagreement(robot, samples[:: max(1, len(samples) // 20)])
            limits, *others = families(robot.opened, tuple(robot.opened.boundaries), *motion.extent, motion.degree)
            rows, names = np.arange(len(start)), robot.boundaries.names
            m = len(limits.names)
            found = limits.enclose(np.tile(np.arange(m), len(rows)), part, np.repeat(rows, m))
            inside = found.clear.reshape(len(rows), m).all(axis=1)
            false += int(np.sum(inside & ~kept.all(axis=0)))
            for family in others:
                m = len(family.names)
                if not m:
                    continue
                found = family.enclose(np.tile(np.arange(m), len(rows)), part, np.repeat(rows, m))
                columns = [names.index(name) for name in family.names]
                least = signed[:, :, columns].min(axis=0)
                proven = found.clear.reshape(len(rows), m) & inside[:, None]
                low = found.lower.reshape(len(rows), m)
                false += int(np.sum(proven & (least <= 0.0)) + np.sum(inside[:, None] & (low > least + 1e-12)))
                clear, violated = clear + int(proven.sum()), violated + int((least <= 0.0).sum())
                total += m * len(rows)
    took = time.perf_counter() - began
    print(
        f"{total} motions of {robots} robots: {clear} proven clear in one piece, {violated} in contact by {_SAMPLES} "
        f"samples, {false} false; {wrong} samples differ from Pinocchio by more than 1e-9 m ({took:.0f} s)"
    )
    if false or wrong:
        raise SystemExit(1)


def _disagreement(robot: LoopRobot, Q: np.ndarray) -> int:
    """Return how many q give another distance of two points than Pinocchio's placements, where the loop closes."""
    import pinocchio as pin

    Q = Q[robot.intervals.hold(Q)]
    data, found = robot.model.createData(), 0
    model = robot.model
    points = [b for b in robot.boundaries if b.name.startswith("p")]
    norms = robot.boundaries.select([b.name for b in points]).norms(Q)
    for row, q in zip(norms, robot.to_pinocchio(model, Q), strict=True):
        pin.framesForwardKinematics(model, data, q)
        places = [
            [data.oMf[model.getFrameId(mark.link)].act(mark.shape.origin) for mark in (b.point_a, b.point_b)]
            for b in points
        ]
        exact = np.array([np.linalg.norm(a - b) for a, b in places])
        found += int(np.abs(exact - row).max(initial=0.0) > 1e-9)
    return found


def certificates(count: int) -> None:
    """Certify whole motions, and hold the verdicts against 4,001 samples each."""
    rng, began, false, seen = np.random.default_rng(3), time.perf_counter(), 0, dict.fromkeys(pb.Verdict, 0)
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    while sum(seen.values()) < count:
        for kind in zoo.KINDS:
            _, robot = loaded(kind, rng)
            Q = _spread(robot, rng, 100)
            Q = Q[robot.intervals.hold(Q)][:6]
            for start, way in zip(Q, 10.0 ** rng.uniform(-2, 0.3, len(Q)), strict=True):
                end = start + way * rng.uniform(-1.0, 1.0, len(start))
                found = pb.certify(robot, [start, end], budget=pb.Budget(boxes=20_000, seconds=5.0))
                free = robot.boundaries.free((1.0 - share) * start + share * end)
                false += int(found.verdict is pb.Verdict.CERTIFIED and not free.all())
                false += int(found.verdict is pb.Verdict.VIOLATED and robot.boundaries.free(found.first_contact.q))
                seen[found.verdict] += 1
    took = time.perf_counter() - began
    said = ", ".join(f"{n} {verdict.value}" for verdict, n in seen.items() if n)
    print(f"{sum(seen.values())} certificates: {said}; {false} false ({took:.0f} s)")
    if false:
        raise SystemExit(1)


if __name__ == "__main__":
    linkages_, motions_ = (int(x) for x in (*sys.argv[1:], "10000", "100000")[:2])
    motions(motions_, int(sys.argv[3]) if len(sys.argv) > 3 else 2)
    certificates(max(20, motions_ // 500))
    places(linkages_)
