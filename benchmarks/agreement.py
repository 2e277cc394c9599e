"""Five questions about one configuration, which must not contradict each other, on random robots.

    python benchmarks/agreement.py --pairs 1000000 --seed 0

Asked of every (robot, q), q random, exactly on a limit, exactly on a contact, or next to one: `free`, the signed
clearances, `certify` of the single q (by the code that certifies boxes, for all q of a robot at once; `pb.certify`
itself for some), `limits` of each coordinate, and `feasible_region(...).contains` for the q that lie in its plane.

- free(q, limits=False) is: all signed clearances are positive. free(q) is that, and all limits are kept.
- a certified q is free, a violated one is not.
- a coordinate's own value is allowed by `limits` if and only if q is free.
- what a region contains is free. Both may round differently within `ROUNDING` of contact: those rows are counted apart.

Exit code 1 if one pair disagrees.
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
from pinbound.certificates.constraints import families

ROUNDING = 1e-12  # m or rad: a region's own evaluation of a clearance may differ from the kernel's by less
AXES = ("0 1 0", "0 0 1", "1 0 0", "0.6 0 0.8")
ROWS = 5_000
SLOW_ROWS = 40  # of a coordinate whose contacts have no closed form: each takes milliseconds
SINGLES = 4


def robot_of(rng: np.random.Generator, folder: Path) -> pb.Robot | None:
    """Return a random robot with stops, spheres, points, a floor and mimic joints; None if home is in contact."""
    planar, joints = bool(rng.random() < 0.5), int(rng.integers(2, 5))
    rows, links, moving = ['<robot name="random"><link name="base"/>'], ["base"], list[str]()
    for index in range(joints):
        kind = "prismatic" if rng.random() < 0.2 else "revolute"
        mimic = ""
        if moving and rng.random() < 0.3:
            m, o = rng.choice([-1.0, 0.5, 3.0, -0.1]), rng.choice([0.0, 0.3])
            mimic = f'<mimic joint="{rng.choice(moving)}" multiplier="{m}" offset="{o}"/>'
        else:
            moving.append(f"j{index}")
        reach = 0.3 if kind == "prismatic" else 3.0
        low, high = np.round(rng.uniform(-reach, -0.1 * reach), 2), np.round(rng.uniform(0.1 * reach, reach), 2)
        x, y, z = (
            rng.choice([0.0, 1.0], p=[0.3, 0.7]) * rng.uniform(-0.3, 0.3, 3) * ([1, 0, 1] if planar else [1, 1, 1])
        )
        axis = AXES[0] if planar and kind == "revolute" else rng.choice(AXES)
        parent = links[-1] if rng.random() < 0.8 else str(rng.choice(links))
        rows.append(
            f'<joint name="j{index}" type="{kind}"><parent link="{parent}"/><child link="l{index}"/>'
            f'<origin xyz="{x:.3f} {y:.3f} {z:.3f}"/><axis xyz="{axis}"/>'
            f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/>{mimic}</joint><link name="l{index}"/>'
        )
        links.append(f"l{index}")
    path = folder / "robot.urdf"
    path.write_text("".join([*rows, "</robot>"]))
    try:
        bare = pb.load(path)
    except pb.InputError:  # no configuration keeps all its limits
        return None
    marks: list[pb.Point | pb.Plane] = []
    pairs: list[pb.BoundaryMark] = []
    for index in range(int(rng.integers(2, 5))):
        a, b = rng.choice(len(links), 2, replace=False)
        ends = [f"a{index}", f"b{index}"]
        xyz = rng.uniform(-0.25, 0.25, 3) * ([1, 0, 1] if planar else [1, 1, 1])
        sort = rng.choice(["stop", "sphere", "point", "floor"], p=[0.35, 0.35, 0.2, 0.1])
        radius = float(rng.choice([0.01, 0.05, 1e-6])) if sort == "sphere" else 0.0
        first = pb.Point(ends[0], links[a], tuple(xyz.tolist()), radius)
        second: pb.Point | pb.Plane = pb.Point(ends[1], links[b], tuple(rng.uniform(-0.25, 0.25, 3).tolist()))
        if sort == "floor":
            second = pb.Plane(ends[1], links[b], (0.0, 0.0, -0.4), (0.0, 0.0, 1.0))
        elif sort == "stop":  # met at some pose, where the arms are of one length but for a miss
            q = rng.uniform(-1.0, 1.0, len(bare.coordinates))
            miss = float(rng.choice([0.0, 1e-5, 1e-3]))
            place = _in_link(bare, links[a], links[b], q, xyz)
            second = pb.Point(
                ends[1], links[b], tuple((place * (1.0 + miss / max(np.linalg.norm(place), 1e-3))).tolist())
            )
        for declared in (True, False) if sort == "stop" and rng.random() < 0.7 else (False,):
            mark = pb.BoundaryMark(f"beta_{index}", *ends, stop=declared)
            try:
                pb.load(path, annotations=pb.Annotations.of([*marks, first, second], [*pairs, mark]))
            except pb.InputError:
                continue
            marks, pairs = [*marks, first, second], [*pairs, mark]
            break
    return pb.load(path, annotations=pb.Annotations.of(marks, pairs)) if pairs else None


def _in_link(robot: pb.Robot, a: str, b: str, q: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """Return a point of link a in the frame of link b at q."""
    origin, *ends = (robot.positions(b, q, tuple(point)) for point in np.vstack((np.zeros(3), np.eye(3))))
    return np.stack([end - origin for end in ends]) @ (robot.positions(a, q, tuple(xyz.tolist())) - origin)


def configurations(robot: pb.Robot, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return q in and around the limits, on them, in the plane of two coordinates, on and next to contacts."""
    n = len(robot.coordinates)
    low, high = np.maximum(robot.lower, -9.0), np.minimum(robot.upper, 9.0)
    Q = rng.uniform(low - 0.2 * (high - low), high + 0.2 * (high - low), (count, n))
    Q[::2] = rng.uniform(low, high, Q[::2].shape)
    if n > 2:
        Q[: count // 3, 2:] = robot.home[2:]
    for row in range(0, count, 5):  # on a limit, of a mimic joint, too, as float64 gives it
        limit = robot.linear_limits[int(rng.integers(len(robot.linear_limits)))]
        j = int(np.argmax(np.abs(limit.coefficients)))
        c = float(limit.coefficients[j])
        if c:
            Q[row, j] = (float(rng.choice([limit.lower, limit.upper])) - limit.offset) / c
    for row in range(2, count, 5):  # on a stop, or a rounding from it
        stops = [b.rule.stop for b in robot.boundaries if b.rule.stop]
        if stops:
            stop = stops[int(rng.integers(len(stops)))]
            j = int(np.flatnonzero(stop.coefficients)[0])
            rest = float(stop.coefficients @ Q[row]) - float(stop.coefficients[j]) * Q[row, j]
            end = stop.gap[int(rng.integers(2))]
            Q[row, j] = (end - rest) / float(stop.coefficients[j]) + float(
                rng.choice([0.0, 0.0, 1e-15, -1e-15, 1e-9, -1e-9])
            )
    for row in range(3, min(count, 200), 5):  # on another contact, as `limits` gives its place
        boundary, j = robot.boundaries[int(rng.integers(len(robot.boundaries)))], int(rng.integers(n))
        if boundary.is_stop or not _is_closed(boundary, j):
            continue
        ends = boundary.limits(robot.coordinates[j], Q[row], (-9.0, 9.0)).intervals
        ends = ends[np.isfinite(ends)]
        if ends.size:
            Q[row, j] = float(rng.choice(ends))
    return Q


def _is_closed(boundary: pb.Boundary, index: int) -> bool:
    """Say whether a coordinate's limits have a closed form: it turns one rotation, or slides only."""
    chain = boundary.path.minimal
    turned, slides = np.count_nonzero(chain.coefficients[:, index]), bool(np.any(chain.slides[:, :, index]))
    return turned + slides <= 1 and not boundary.path.difference.directions


def check(robot: pb.Robot, Q: np.ndarray, rng: np.random.Generator) -> tuple[Counter[str], Counter[str]]:
    """Return what was asked, and what disagreed."""
    B, asked, wrong = robot.boundaries, Counter[str](), Counter[str]()
    signed, free, clear = B.signed_clearances(Q), B.free(Q), B.free(Q, limits=False)
    within = np.all([limit.holds(Q) for limit in robot.linear_limits], axis=0)
    each = np.stack([boundary.signed_clearance(Q) for boundary in B], axis=1)
    near = np.abs(each).min(axis=1) < ROUNDING
    asked["free and signed clearances"] += len(Q)
    wrong["free, signed clearances"] += int(np.sum(clear != np.all(signed > 0.0, axis=1)))
    wrong["free, limits"] += int(np.sum(free != clear & within))
    stops = [k for k, boundary in enumerate(B) if boundary.is_stop]
    wrong["side of a stop, batch and one"] += int(np.sum((signed > 0.0)[:, stops] != (each > 0.0)[:, stops]))
    some = rng.choice(len(Q), SINGLES * 10)
    wrong["free, one and many"] += sum(B.free(Q[row]) != free[row] for row in some.tolist() if not near[row])
    certified, violated = np.ones(len(Q), bool), np.zeros(len(Q), bool)
    for family in families(robot, tuple(B), Q.min(axis=0), Q.max(axis=0)):
        for k in range(len(family.names)):
            found = family.enclose_box(np.full(len(Q), k), Q, np.zeros_like(Q))
            certified, violated = certified & found.clear, violated | found.violated
    asked["certify, single q"] += len(Q)
    wrong["certified and not free"] += int(np.sum(certified & ~free))
    wrong["violated and free"] += int(np.sum(violated & free))
    for row in rng.choice(len(Q), SINGLES).tolist():
        verdict = pb.certify(robot, [Q[row]]).verdict
        asked["pb.certify"] += 1
        wrong["pb.certify and free"] += verdict is (pb.Verdict.VIOLATED if free[row] else pb.Verdict.CERTIFIED)
    for j, name in enumerate(robot.coordinates):
        rows = np.arange(len(Q)) if all(_is_closed(b, j) for b in B) else rng.choice(len(Q), SLOW_ROWS)
        ends, _ = B.limits_table(name, Q[rows])
        asked["limits, coordinate and q"] += len(rows)
        wrong["limits and free"] += int(np.sum(np.isnan(ends[:, 0]) != ~free[rows]))
        allowed = (ends[:, 0] <= Q[rows, j]) & (Q[rows, j] <= ends[:, 1])
        wrong["limits do not hold the value"] += int(np.sum(free[rows] & ~allowed))
        for row in rng.choice(rows, SINGLES).tolist():
            one = B.limits(name, Q[row])
            wrong["limits of one q and free"] += bool(one.blocked_by) == bool(free[row]) and not near[row]
    n = len(robot.coordinates)
    if n >= 2:
        rows = np.flatnonzero(np.all(Q[:, 2:] == robot.home[2:], axis=1))
        try:
            region = pb.feasible_region(robot, robot.coordinates[:2], accuracy=1e-3)
            inside = region.contains(Q[rows])
        except (pb.DimensionError, pb.UnsupportedError):
            asked["regions refused"] += 1
            return asked, wrong
        asked["region"] += len(rows)
        asked["region, within rounding of contact"] += int(np.sum(inside & ~free[rows] & near[rows]))
        wrong["in the region and not free"] += int(np.sum(inside & ~free[rows] & ~near[rows]))
    return asked, wrong


def campaign(pairs: int, seed: int, rows: int = ROWS) -> tuple[Counter[str], Counter[str]]:
    """Return what was asked and what disagreed, over random robots of `rows` configurations each."""
    rng, folder = np.random.default_rng(seed), Path(tempfile.mkdtemp())
    asked, wrong = Counter[str](), Counter[str]()
    while asked["free and signed clearances"] < pairs:
        robot = robot_of(rng, folder)
        if robot is None or not len(robot.boundaries):
            continue
        state = rng.bit_generator.state["state"]["state"]
        one, faults = check(robot, configurations(robot, rows, rng), rng)
        asked, wrong = asked + one, wrong + faults
        asked["robots"] += 1
        asked["stops"] += sum(boundary.is_stop for boundary in robot.boundaries)
        asked["boundaries"] += len(robot.boundaries)
        if sum(faults.values()):
            print(f"state {state}: {dict(faults)}", (folder / "robot.urdf").read_text(), robot.annotations.to_yaml())
    return asked, wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rows", type=int, default=ROWS, help="configurations a robot")
    options = parser.parse_args()
    started = time.perf_counter()
    asked, wrong = campaign(options.pairs, options.seed, options.rows)
    for name, count in asked.items():
        print(f"{name:40} {count:12,}")
    print(f"disagreements: {sum(wrong.values())} {dict(wrong)}; {time.perf_counter() - started:.0f} s")
    return int(sum(wrong.values()) > 0)


if __name__ == "__main__":
    sys.exit(main())
