"""Robots as plain data, and their kinematics straight from their joints, in mpmath and NumPy; not a test itself.

Nothing here is pinbound's: no reduction, no coupling matrix, no closed form. Every joint is a 4x4 matrix, and followers
are followed one by one. Numbers are written to the URDF by `repr`, so that both sides read the same float64.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mpmath as mp
import numpy as np

DIGITS = 50


@dataclass(frozen=True)
class JointData:
    """One joint; its child is link `index + 1` of the machine, `parent` a link's number."""

    kind: str
    parent: int
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    limits: tuple[float, float] = (-1e14, 1e14)
    mimic: tuple[int, float, float] | None = None

    @property
    def moves(self) -> bool:
        return self.kind != "fixed"


@dataclass
class Machine:
    """Joints, and marks by name: (link, kind, numbers), kind point, segment, sweep, plane or line."""

    joints: list[JointData]
    marks: dict[str, tuple[int, str, dict]] = field(default_factory=dict)
    boundaries: list[tuple[str, str, float]] = field(default_factory=list)
    home: dict[int, float] = field(default_factory=dict)
    tolerance: float = 2e-5
    order: list[int] | None = None

    @property
    def active(self) -> list[int]:
        """Indices of the joints that q commands, in q's order: that of the robot, once it has been loaded."""
        if self.order is not None:
            return self.order
        return [i for i, joint in enumerate(self.joints) if joint.moves and joint.mimic is None]

    def urdf(self) -> str:
        rows = ['<robot name="m" xmlns:pinbound="urn:pinbound:1">']
        rows += [f'<link name="l{i}"/>' for i in range(len(self.joints) + 1)]
        for i, joint in enumerate(self.joints):
            limit = f'<limit lower="{joint.limits[0]!r}" upper="{joint.limits[1]!r}" effort="1" velocity="1"/>'
            mimic = ""
            if joint.mimic is not None:
                primary, multiplier, offset = joint.mimic
                mimic = f'<mimic joint="j{primary}" multiplier="{multiplier!r}" offset="{offset!r}"/>'
            rows.append(
                f'<joint name="j{i}" type="{joint.kind}"><parent link="l{joint.parent}"/><child link="l{i + 1}"/>'
                f'<origin xyz="{_text(joint.xyz)}" rpy="{_text(joint.rpy)}"/><axis xyz="{_text(joint.axis)}"/>'
                f"{limit if joint.kind in ('revolute', 'prismatic') else ''}{mimic}</joint>"
            )
        rows.append(f'<pinbound:annotations contact_tolerance="{self.tolerance!r}">')
        if self.home:
            values = " ".join(f'j{i}="{value!r}"' for i, value in self.home.items())
            rows.append(f"<pinbound:home {values}/>")
        for name, (link, kind, numbers) in self.marks.items():
            texts = " ".join(f'{key}="{_text(value)}"' for key, value in numbers.items())
            rows.append(f'<pinbound:{kind} name="{name}" link="l{link}" {texts}/>')
        for i, (a, b, distance) in enumerate(self.boundaries):
            rows.append(f'<pinbound:boundary name="b{i}" a="{a}" b="{b}" min_distance="{distance!r}"/>')
        return "\n".join([*rows, "</pinbound:annotations></robot>"])

    def load(self, folder: Path):
        """Write and load the robot, and keep the order of its coordinates."""
        import pinbound as pb

        path = folder / "m.urdf"
        path.write_text(self.urdf(), encoding="utf-8")
        robot = pb.load(path)
        self.order = [int(name[1:]) for name in robot.coordinates]
        return robot

    def angles(self, q: Sequence) -> list:
        """Return the value of every joint for active values, numbers of any exact kind."""
        values: list = [None] * len(self.joints)
        for value, index in zip(q, self.active, strict=True):
            values[index] = value

        def of(index: int):
            if values[index] is None:
                mimic = self.joints[index].mimic
                values[index] = 0 if mimic is None else mp.mpf(mimic[1]) * of(mimic[0]) + mp.mpf(mimic[2])
            return values[index]

        return [of(index) for index in range(len(self.joints))]

    def exact_point(self, q: Sequence, link: int, xyz: Sequence[float]) -> mp.matrix:
        """Return a point in the root's frame to 50 digits."""
        with mp.workdps(DIGITS):
            theta, x = self.angles([mp.mpf(value) for value in q]), mp.matrix([mp.mpf(v) for v in xyz])
            while link:
                joint = self.joints[link - 1]
                x = _exact_motion(joint, theta[link - 1], x)
                x = _exact_rpy(joint.rpy) * x + mp.matrix([mp.mpf(v) for v in joint.xyz])
                link = joint.parent
            return x

    def exact_distance(self, q: Sequence, a: str, b: str) -> mp.mpf:
        """Return the distance of two points, less their radii."""
        with mp.workdps(DIGITS):
            ends = [self.exact_point(q, self.marks[name][0], self.marks[name][2]["xyz"]) for name in (a, b)]
            radii = [mp.mpf(self.marks[name][2].get("radius", 0.0)) for name in (a, b)]
            return mp.norm(ends[0] - ends[1]) - radii[0] - radii[1]

    def poses(self, Q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rotations (N, L, 3, 3) and positions (N, L, 3) of all links for Q (N, n), in plain NumPy."""
        theta = np.zeros((len(Q), len(self.joints)))
        done = set()
        for column, index in enumerate(self.active):
            theta[:, index] = Q[:, column]
            done.add(index)

        def fill(index: int) -> None:
            joint = self.joints[index]
            if index in done or joint.mimic is None:
                return
            fill(joint.mimic[0])
            theta[:, index] = joint.mimic[1] * theta[:, joint.mimic[0]] + joint.mimic[2]
            done.add(index)

        R, p = np.zeros((len(Q), len(self.joints) + 1, 3, 3)), np.zeros((len(Q), len(self.joints) + 1, 3))
        R[:, 0] = np.eye(3)
        for i, joint in enumerate(self.joints):
            fill(i)
            base = R[:, joint.parent] @ _rpy(joint.rpy)
            p[:, i + 1] = p[:, joint.parent] + R[:, joint.parent] @ np.array(joint.xyz)
            axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
            if joint.kind == "prismatic":
                p[:, i + 1] += (base @ axis) * theta[:, i, None]
                R[:, i + 1] = base
            elif joint.moves:
                R[:, i + 1] = base @ _turns(axis, theta[:, i])
            else:
                R[:, i + 1] = base
        return R, p


def _text(value) -> str:
    if isinstance(value, (int, float)):
        return repr(float(value))
    return " ".join(repr(float(v)) for v in value)


def _exact_rpy(rpy: Sequence[float]) -> mp.matrix:
    (sr, sp, sy), (cr, cp, cy) = ([f(mp.mpf(v)) for v in rpy] for f in (mp.sin, mp.cos))
    return mp.matrix(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _exact_motion(joint: JointData, theta, x: mp.matrix) -> mp.matrix:
    if not joint.moves:
        return x
    axis = mp.matrix([mp.mpf(v) for v in joint.axis])
    axis = axis / mp.norm(axis)
    if joint.kind == "prismatic":
        return x + axis * theta
    u, v, w = axis
    crossed = mp.matrix([v * x[2] - w * x[1], w * x[0] - u * x[2], u * x[1] - v * x[0]])
    along = axis * (axis.T * x)[0]
    return along + (x - along) * mp.cos(theta) + crossed * mp.sin(theta)


def _rpy(rpy: Sequence[float]) -> np.ndarray:
    r, p, y = rpy
    X = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    Y = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    Z = np.array([[np.cos(y), -np.sin(y), 0], [np.sin(y), np.cos(y), 0], [0, 0, 1]])
    return Z @ Y @ X


def _turns(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)


_MILD = {"offset": 1.0, "multiplier": (-2.0, -1.0, 0.1, 0.5, 1.0, 2.0), "length": 0.3}
_WILD = {"offset": 1e8, "multiplier": (-1e6, -1.0, -1e-14, 3e-15, 0.1, 1.0, 1e6), "length": 1e3}


def random_machine(rng: np.random.Generator, joints: int, wild: bool = False, planar: bool = False) -> Machine:
    """Return a tree of joints: branches, followers of followers, slides, fixed joints, parallel and skew axes."""
    size = _WILD if wild else _MILD
    length = size["length"] * (10.0 ** rng.uniform(-6, 0) if wild else 1.0)
    axes = [(0.0, 1.0, 0.0)] if planar else [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.6, -0.3, 0.8)]
    turns = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    if not planar:
        turns += [(1.5707963267948966, 0.0, 0.0), (0.3, -1.2, 2.9)]
    found: list[JointData] = []
    moving: list[int] = []
    for index in range(joints):
        kind = str(rng.choice(["revolute", "continuous", "prismatic", "fixed"], p=[0.4, 0.3, 0.15, 0.15]))
        mimic = None
        if kind != "fixed" and moving and rng.random() < 0.45:
            offset = float(
                rng.choice([0.0, rng.normal(0, 1), rng.choice([-1, 1]) * size["offset"] ** rng.uniform(0, 1)])
            )
            mimic = (int(rng.choice(moving)), float(rng.choice(size["multiplier"])), offset)
        xyz = rng.normal(0, length, 3) * (rng.random(3) < 0.6) * ((1, 0, 1) if planar else (1, 1, 1))
        parent = index if rng.random() < 0.75 else int(rng.integers(0, index + 1))
        axis = tuple(float(rng.choice([-1.0, 1.0])) * v for v in axes[int(rng.integers(len(axes)))])
        found.append(
            JointData(kind, parent, tuple(map(float, xyz)), turns[int(rng.integers(len(turns)))], axis, mimic=mimic)
        )
        if kind != "fixed":
            moving.append(index)
    return Machine(found)


def nonnegative_least_squares(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return `min |A x - b|` over x >= 0 (Lawson and Hanson). SciPy 1.15's own ends before the least, now and then."""
    x, held = np.zeros(A.shape[1]), np.ones(A.shape[1], dtype=bool)
    for _ in range(10 * A.shape[1]):
        slope = A.T @ (b - A @ x)
        if not held.any() or slope[held].max() <= 1e-14:
            break
        held[np.flatnonzero(held)[int(np.argmax(slope[held]))]] = False
        while True:
            z = np.zeros_like(x)
            z[~held] = np.linalg.lstsq(A[:, ~held], b, rcond=None)[0]
            low = ~held & (z <= 0.0)
            if not low.any():
                break
            x += np.min(x[low] / (x[low] - z[low])) * (z - x)
            held |= ~held & (x <= 1e-15)
            x[held] = 0.0
        x = z
    return x
