"""Random loops that are nearly parallelograms, and the linkage as written: Newton on the loop, in mpmath."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import mpmath
import numpy as np

import pinbound as pb
from pinbound.boundaries.boundary_set import BoundarySet

mpmath.mp.dps = 50


@dataclass
class Joint:
    """A planar joint about z: where its origin is in the parent's frame [m], and its axis' sign."""

    name: str
    parent: str
    child: str
    at: complex
    sign: int
    lower: float = -20.0
    upper: float = 20.0


@dataclass
class Loop:
    """A planar tree whose links `link_a`, `link_b` are pinned together at `xyz_a`, `xyz_b`.

    Attributes:
        joints: All joints, parents first.
        pins: (link, point) of both ends of the pin.
        home: Joint values of the assembled pose.
        passive: Names of the joints that follow; empty: whatever is chosen.
        mimic: Joint: (primary, multiplier, offset).
    """

    joints: list[Joint]
    pins: tuple[tuple[str, complex], tuple[str, complex]]
    home: dict[str, float]
    passive: tuple[str, ...] = ()
    tolerance: float | None = None
    mimic: dict[str, tuple[str, float, float]] = field(default_factory=dict)

    def urdf(self, marks: str = "") -> str:
        """Return the URDF, with marks inside its annotations."""
        parts = ['<robot name="loop" xmlns:pinbound="urn:pinbound:1"><link name="base"/>']
        for joint in self.joints:
            mimic = ""
            if joint.name in self.mimic:
                primary, multiplier, offset = self.mimic[joint.name]
                mimic = f'<mimic joint="{primary}" multiplier="{multiplier!r}" offset="{offset!r}"/>'
            parts.append(
                f'<joint name="{joint.name}" type="revolute"><parent link="{joint.parent}"/>'
                f'<child link="{joint.child}"/><origin xyz="{joint.at.real!r} {joint.at.imag!r} 0"/>'
                f'<axis xyz="0 0 {joint.sign}"/><limit lower="{joint.lower!r}" upper="{joint.upper!r}" effort="1" '
                f'velocity="1"/>{mimic}</joint><link name="{joint.child}"/>'
            )
        (link_a, a), (link_b, b) = self.pins
        more = f' passive="{" ".join(self.passive)}"' if self.passive else ""
        more += f' tolerance="{self.tolerance!r}"' if self.tolerance is not None else ""
        home = " ".join(f'{name}="{value!r}"' for name, value in self.home.items() if name not in self.mimic)
        parts.append(
            f'<pinbound:annotations><pinbound:home {home}/><pinbound:closure name="loop" link_a="{link_a}" '
            f'xyz_a="{a.real!r} {a.imag!r} 0" link_b="{link_b}" xyz_b="{b.real!r} {b.imag!r} 0"{more}/>{marks}'
            "</pinbound:annotations></robot>"
        )
        return "".join(parts)

    def place(self, link: str, point: complex, theta: dict[str, mpmath.mpf]) -> mpmath.mpc:
        """Return where a point of a link is, every number of the file taken as it is."""
        above = {joint.child: joint for joint in self.joints}
        found = mpmath.mpc(point)
        while link != "base":
            joint = above[link]
            found = mpmath.mpc(joint.at) + mpmath.expj(joint.sign * theta[joint.name]) * found
            link = joint.parent
        return found

    def gap(self, theta: dict[str, mpmath.mpf]) -> mpmath.mpc:
        """Return the gap of the pin."""
        (link_a, a), (link_b, b) = self.pins
        return self.place(link_a, a, theta) - self.place(link_b, b, theta)

    def solved(self, theta: dict[str, float], passive: tuple[str, ...]) -> dict[str, mpmath.mpf]:
        """Return the joint values of the linkage as written, from near values: its passive joints by Newton."""
        values = {name: mpmath.mpf(value) for name, value in theta.items()}
        step = mpmath.mpf(10) ** -25
        for _ in range(60):
            gap = self.gap(values)
            if abs(gap) < mpmath.mpf(10) ** -45:
                return values
            columns = []
            for name in passive:
                moved = dict(values)
                moved[name] += step
                columns.append((self.gap(moved) - gap) / step)
            (p, q) = columns
            determinant = p.real * q.imag - p.imag * q.real
            values[passive[0]] -= (gap.real * q.imag - gap.imag * q.real) / determinant
            values[passive[1]] -= (p.real * gap.imag - p.imag * gap.real) / determinant
        raise ArithmeticError("Newton did not converge: the linkage as written does not close there")


def four_bar(rng: np.random.Generator, mismatch: float, mimic: bool = False) -> Loop:
    """Return base - crank - coupler and base - rocker, sides differing by up to `mismatch` in all."""
    ground, crank = (float(x) for x in rng.uniform(0.05, 0.5, 2))
    e_1, e_2 = (float(x) for x in rng.dirichlet([1.0, 1.0, 1.0])[:2] * mismatch * rng.choice([-1.0, 1.0], 2))
    turn = [complex(np.exp(1j * angle)) for angle in rng.uniform(-np.pi, np.pi, 4)]
    if mimic or rng.uniform() < 0.3:
        turn = [1.0 + 0.0j] * 4
    to_d, to_b, pin_a, pin_b = ground * turn[0], crank * turn[1], (ground + e_1) * turn[2], (crank + e_2) * turn[3]
    signs = [1, 1, 1] if mimic else [int(s) for s in rng.choice([-1, 1], 3)]
    phi = float(rng.uniform(0.2, np.pi - 0.2) * rng.choice([-1, 1]))  # from ground to crank, both as drawn
    a = phi + np.angle(turn[0]) - np.angle(turn[1])
    b = np.angle(turn[0]) - np.angle(turn[2]) - a
    d = phi + np.angle(turn[0]) - np.angle(turn[3])
    home = {"A": float(signs[0] * a), "B": float(signs[1] * b), "D": float(signs[2] * d)}
    joints = [
        Joint("A", "base", "crank", 0.0 + 0.0j, signs[0]),
        Joint("B", "crank", "coupler", to_b, signs[1]),
        Joint("D", "base", "rocker", to_d, signs[2]),
    ]
    low, high = (0.0, np.pi) if phi > 0 else (-np.pi, 0.0)
    ends = [low + (high - low) * f for f in (rng.uniform(0.002, 0.3), rng.uniform(0.7, 0.998))]
    ends = min(ends[0], phi - 0.05), max(ends[1], phi + 0.05)
    pick = [(), ("B", "D"), ("A", "D"), ("A", "B")][int(rng.integers(4))]
    active = next(joint for joint in joints if joint.name not in (pick or ("B", "D")))
    if active.name in ("A", "D"):
        span = sorted(signs[0 if active.name == "A" else 2] * (end - phi) for end in ends)
    else:
        span = sorted(-signs[1] * (end - phi) for end in ends)
    active.lower, active.upper = home[active.name] + span[0], home[active.name] + span[1]
    loop = Loop(joints, (("coupler", pin_a), ("rocker", pin_b)), home, pick)
    if mimic:
        loop.passive = ()
        loop.mimic = {"B": ("A", -1.0, 0.0), "D": ("A", 1.0, 0.0)}
        joints[0].lower, joints[0].upper = ends
    return loop


def palletizer(rng: np.random.Generator, mismatch: float) -> Loop:
    """Return an arm and a crank at one shoulder, or nearly, a forearm, and the rod between crank and forearm."""
    arm, tail = (float(x) for x in rng.uniform(0.05, 0.5, 2))
    share = rng.dirichlet([1.0, 1.0, 1.0, 1.0]) * mismatch
    shoulder = complex(share[2] * np.exp(1j * rng.uniform(-np.pi, np.pi))) if rng.uniform() < 0.6 else 0.0 + 0.0j
    joints = [
        Joint("arm", "base", "upper", 0.0 + 0.0j, 1),
        Joint("elbow", "upper", "fore", complex(arm), int(rng.choice([-1, 1]))),
        Joint("crank", "base", "short", shoulder, 1),
        Joint("rod", "short", "bar", complex(tail), int(rng.choice([-1, 1]))),
    ]
    middle = float(rng.uniform(0.4, np.pi - 0.4) * rng.choice([-1, 1]))  # from arm to crank
    at = float(rng.uniform(-1, 1))
    home = {"arm": at, "crank": at + middle, "elbow": joints[1].sign * middle, "rod": -joints[3].sign * middle}
    low, high = (0.0, np.pi) if middle > 0 else (-np.pi, 0.0)
    ends = [low + (high - low) * f for f in (rng.uniform(0.002, 0.12), rng.uniform(0.88, 0.998))]
    joints[0].lower, joints[0].upper = at - 1.0, at + 1.0
    joints[2].lower, joints[2].upper = at + middle - 1.5, at + middle + 1.5
    elbow = sorted(joints[1].sign * end for end in ends)
    joints[1].lower, joints[1].upper = elbow
    signs = rng.choice([-1.0, 1.0], 2)
    pins = ("bar", complex(arm + signs[0] * share[0])), ("fore", complex(tail + signs[1] * share[1]))
    return Loop(joints, pins, home)


def random_loop(rng: np.random.Generator, largest: float = 1e-4) -> Loop:
    """Return a four-bar, a palletizer's loop, or a four-bar coupled by mimics."""
    mismatch = float(10.0 ** rng.uniform(-9.5, np.log10(largest)))
    sort = rng.uniform()
    loop = palletizer(rng, mismatch) if sort < 0.35 else four_bar(rng, mismatch, mimic=sort > 0.85)
    loop.tolerance = 1.01 * mismatch if rng.uniform() < 0.5 or mismatch > 1e-6 else None
    return loop


def judge(loop: Loop, robot: pb.Robot, rng: np.random.Generator, poses: int) -> Judged:
    """Compare a robot of a loop with the linkage as written, at both ends of its limits and between.

    The worst pose is also tried with an obstacle that the linkage as written touches, or enters by up to 10 um, there.
    """
    passive = tuple(one.joint for one in robot.closures[0].deviations)
    bounds = {one.joint: one.bound for one in robot.closures[0].deviations}
    boundary = robot.boundaries[0]
    a, b = boundary.point_a, boundary.point_b
    Q = [q for q in _poses(robot, rng, poses) if _kept(robot, q)]
    found = Judged()
    worst, deepest = robot.home, mpmath.mpf(0)
    for q in Q:
        theta = dict(zip(robot.coupling.joints, robot.coupling.expand(q).tolist(), strict=True))
        true = loop.solved(theta, passive)
        for joint, bound in bounds.items():
            found.angle = max(found.angle, float(abs(true[joint] - theta[joint]) / bound)) if bound else found.angle
        ends = [loop.place(mark.link, complex(mark.xyz[0], mark.xyz[1]), true) for mark in (a, b)]
        apart = abs(ends[0] - ends[1])
        off = abs(apart - mpmath.mpf(float(boundary.norm(q))))
        found.place = max(found.place, float(off / (boundary.place_error + 1e-12)))
        if off >= deepest:
            worst, deepest, found.norm = q, off, float(apart)
    depth = float(10.0 ** rng.uniform(-9, -5)) * float(rng.uniform() < 0.8)
    touching = replace(boundary, min_distance=found.norm + depth - boundary.threshold)
    whole = replace(robot, boundaries=BoundarySet([touching], robot.coordinates, robot.linear_limits, robot.home))
    found.verdict = pb.certify(whole, [robot.home, worst]).verdict.value
    enters = depth > 0.0 or boundary.place_error > 1e-12  # else it touches to the last digit
    found.free = enters and bool(whole.boundaries.free(worst))
    found.box = pb.certify_box(whole, worst, worst).verdict.value
    return found


@dataclass
class Judged:
    """What the linkage as written does: largest share of the stated errors, and what is said where it touches."""

    angle: float = 0.0
    place: float = 0.0
    norm: float = 0.0
    verdict: str = ""
    box: str = ""
    free: bool = False

    @property
    def holds(self) -> bool:
        """Whether nothing wrong is said."""
        said = "certified" in (self.verdict, self.box) or self.free
        return self.angle <= 1.0 and self.place <= 1.0 and not said


def marked(loop: Loop, rng: np.random.Generator) -> str:
    """Return marks of a boundary between the base and a link that the loop moves."""
    link = loop.joints[-1].child if rng.uniform() < 0.5 else loop.joints[1].child
    x, y, u, v = (float(value) for value in rng.uniform(-0.6, 0.6, 4))
    return (
        f'<pinbound:point name="p" link="{link}" xyz="{x!r} {y!r} 0"/><pinbound:point name="wall" link="base" '
        f'xyz="{u!r} {v!r} 0" radius="1e-3"/><pinbound:boundary name="beta" a="p" b="wall"/>'
    )


def _poses(robot: pb.Robot, rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Return corners of the limits, brought within them, and poses between."""
    n = len(robot.coordinates)
    corners = [np.where([(index >> i) & 1 for i in range(n)], robot.upper, robot.lower) for index in range(2**n)]
    inside = [rng.uniform(robot.lower, robot.upper) for _ in range(count)]
    return [*(_pulled(robot, q) for q in corners), *(_pulled(robot, q) for q in inside)]


def _pulled(robot: pb.Robot, q: np.ndarray) -> np.ndarray:
    """Return the pose between home and q that is as far as all limits allow."""
    share = 1.0
    for limit in robot.linear_limits:
        start = float(limit.coefficients @ robot.home) + limit.offset
        step = float(limit.coefficients @ (q - robot.home))
        room = limit.upper - start if step > 0 else limit.lower - start
        if step and room / step < share:
            share = room / step
    return robot.home + share * (q - robot.home)


def _kept(robot: pb.Robot, q: np.ndarray) -> bool:
    theta = [float(limit.coefficients @ q) + limit.offset for limit in robot.linear_limits]
    return all(
        limit.lower - 1e-12 <= value <= limit.upper + 1e-12
        for limit, value in zip(robot.linear_limits, theta, strict=True)
    )
