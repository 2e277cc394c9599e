"""Planar linkages from their lengths, as URDF text; and the joint values that close them, by Newton at 50 digits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mpmath
import numpy as np
from scipy import sparse

from pinbound import InputError

mpmath.mp.dps = 50


@dataclass
class Part:
    """A joint in the plane of x and y: where it is in the parent's frame [m], and how it moves its child link.

    `way` is the direction of a slide in the parent's frame (a unit number); None: it turns about z times `sign`.
    """

    name: str
    parent: str
    child: str
    at: complex
    way: complex | None = None
    sign: int = 1
    lower: float = -60.0
    upper: float = 60.0


@dataclass
class Mechanism:
    """A planar tree with pins (name, link, point, link, point), each with its two passive joints."""

    parts: list[Part]
    pins: list[tuple[str, str, complex, str, complex]]
    passive: dict[str, tuple[str, str]]
    home: dict[str, float] = field(default_factory=dict)

    @property
    def active(self) -> list[str]:
        """Names of the joints that no pin settles."""
        taken = {name for pair in self.passive.values() for name in pair}
        return [part.name for part in self.parts if part.name not in taken]

    def urdf(self, marks: str = "", links: str = "") -> str:
        """Return the URDF, with marks inside its annotations, and more links and joints."""
        text = ['<robot name="linkage" xmlns:pinbound="urn:pinbound:1"><link name="base"/>']
        for part in self.parts:
            kind = "revolute" if part.way is None else "prismatic"
            x, y = (0.0, 0.0) if part.way is None else (part.way.real, part.way.imag)
            z = part.sign if part.way is None else 0
            text.append(
                f'<joint name="{part.name}" type="{kind}"><parent link="{part.parent}"/><child link="{part.child}"/>'
                f'<origin xyz="{part.at.real!r} {part.at.imag!r} 0"/><axis xyz="{x!r} {y!r} {z}"/>'
                f'<limit lower="{part.lower!r}" upper="{part.upper!r}" effort="1" velocity="1"/></joint>'
                f'<link name="{part.child}"/>'
            )
        home = " ".join(f'{name}="{value!r}"' for name, value in self.home.items())
        text.append(f"{links}<pinbound:annotations><pinbound:home {home}/>")
        for name, link_a, a, link_b, b in self.pins:
            pair = " ".join(self.passive[name])
            text.append(
                f'<pinbound:closure name="{name}" link_a="{link_a}" xyz_a="{a.real!r} {a.imag!r} 0" '
                f'link_b="{link_b}" xyz_b="{b.real!r} {b.imag!r} 0" passive="{pair}"/>'
            )
        return "".join([*text, marks, "</pinbound:annotations></robot>"])

    def place(self, link: str, point: complex, theta: dict[str, mpmath.mpf]) -> mpmath.mpc:
        """Return where a point of a link is, at 50 digits."""
        above = {part.child: part for part in self.parts}
        found = mpmath.mpc(point)
        while link != "base":
            part = above[link]
            value = theta[part.name]
            if part.way is None:
                found = mpmath.mpc(part.at) + mpmath.expj(part.sign * value) * found
            else:
                way = mpmath.mpc(part.way)
                found = mpmath.mpc(part.at) + value * way / abs(way) + found
            link = part.parent
        return found

    def gap(self, pin: tuple[str, str, complex, str, complex], theta: dict[str, mpmath.mpf]) -> mpmath.mpc:
        """Return the gap of a pin."""
        _, link_a, a, link_b, b = pin
        return self.place(link_a, a, theta) - self.place(link_b, b, theta)

    def solved(self, theta: dict[str, float]) -> dict[str, mpmath.mpf]:
        """Return all joint values from near ones, the passive joints of each pin by Newton, pin after pin."""
        values = {name: mpmath.mpf(value) for name, value in theta.items()}
        step = mpmath.mpf(10) ** -28
        for pin in self.pins:
            pair = self.passive[pin[0]]
            for _ in range(60):
                gap = self.gap(pin, values)
                if abs(gap) < mpmath.mpf(10) ** -44:
                    break
                columns = [(self.gap(pin, {**values, name: values[name] + step}) - gap) / step for name in pair]
                p, q = columns
                determinant = p.real * q.imag - p.imag * q.real
                values[pair[0]] -= (gap.real * q.imag - gap.imag * q.real) / determinant
                values[pair[1]] -= (p.real * gap.imag - p.imag * gap.real) / determinant
            else:
                raise ArithmeticError("Newton did not converge")
        return values

    def toggled(self, theta: dict[str, float], active: str) -> mpmath.mpf:
        """Return the value of a joint, near `theta`, at which the first pin moves one way only, whatever turns.

        Newton on three equations at 50 digits: the pin closes, and its derivatives by both passive joints are parallel.
        Only the given joint and the two passive ones move.
        """
        (pin, *_), step = self.pins, mpmath.mpf(10) ** -16
        names = [active, *self.passive[pin[0]]]
        values = {name: mpmath.mpf(value) for name, value in theta.items()}

        def asked(values: dict[str, mpmath.mpf]) -> mpmath.matrix:
            gap, tiny = self.gap(pin, values), mpmath.mpf(10) ** -25
            p, q = ((self.gap(pin, {**values, n: values[n] + tiny}) - gap) / tiny for n in names[1:])
            return mpmath.matrix([gap.real, gap.imag, p.real * q.imag - p.imag * q.real])

        for _ in range(80):
            at = asked(values)
            if mpmath.norm(at) < mpmath.mpf(10) ** -22:
                return values[active]
            columns = [(asked({**values, name: values[name] + step}) - at) / step for name in names]
            moved = mpmath.lu_solve(mpmath.matrix([[c[i] for c in columns] for i in range(3)]), at)
            for name, by in zip(names, moved, strict=True):
                values[name] -= by
        raise ArithmeticError("Newton did not converge")


def _turn(rng: np.random.Generator) -> complex:
    return complex(np.exp(1j * rng.uniform(-np.pi, np.pi)))


def _signs(rng: np.random.Generator, count: int) -> list[int]:
    return [int(s) for s in rng.choice([-1, 1], count)]


def four_bar(rng: np.random.Generator) -> Mechanism:
    """Return crank, coupler and rocker of random lengths, frames and signs; any joint may be the active one."""
    ground, crank, coupler, rocker = (float(x) for x in rng.uniform(0.1, 1.0, 4))
    s = _signs(rng, 3)
    parts = [
        Part("A", "base", "crank", 0j, None, s[0]),
        Part("B", "crank", "coupler", crank * _turn(rng), None, s[1]),
        Part("D", "base", "rocker", ground * _turn(rng), None, s[2]),
    ]
    pin = ("loop", "coupler", coupler * _turn(rng), "rocker", rocker * _turn(rng))
    pairs = [("B", "D"), ("A", "D"), ("A", "B")]
    return Mechanism(parts, [pin], {"loop": pairs[int(rng.integers(3))]})


def five_bar(rng: np.random.Generator) -> Mechanism:
    """Return two cranks on the ground and the two arms that join them."""
    lengths = [float(x) for x in rng.uniform(0.2, 1.0, 5)]
    s = _signs(rng, 4)
    parts = [
        Part("A", "base", "left", 0j, None, s[0]),
        Part("B", "left", "near", lengths[0] * _turn(rng), None, s[1]),
        Part("D", "base", "right", lengths[4] * _turn(rng), None, s[2]),
        Part("E", "right", "far", lengths[1] * _turn(rng), None, s[3]),
    ]
    pin = ("loop", "near", lengths[2] * _turn(rng), "far", lengths[3] * _turn(rng))
    pairs = [("B", "E"), ("A", "D"), ("B", "D")]
    return Mechanism(parts, [pin], {"loop": pairs[int(rng.integers(3))]})


def slider_crank(rng: np.random.Generator) -> Mechanism:
    """Return a crank, a coupler and a slide on the ground; crank or slide leads."""
    s = _signs(rng, 2)
    parts = [
        Part("A", "base", "crank", 0j, None, s[0]),
        Part("B", "crank", "coupler", float(rng.uniform(0.1, 0.6)) * _turn(rng), None, s[1]),
        Part("S", "base", "slide", complex(*rng.uniform(-0.5, 0.5, 2)), _turn(rng)),
    ]
    pin = ("loop", "coupler", float(rng.uniform(0.3, 1.0)) * _turn(rng), "slide", complex(*rng.uniform(-0.1, 0.1, 2)))
    return Mechanism(parts, [pin], {"loop": [("B", "S"), ("A", "B"), ("A", "S")][int(rng.integers(3))]})


def cylinder(rng: np.random.Generator) -> Mechanism:
    """Return a boom that a cylinder lifts: the cylinder turns on the ground, its rod is pinned to the boom."""
    s = _signs(rng, 2)
    parts = [
        Part("A", "base", "boom", 0j, None, s[0]),
        Part("C", "base", "barrel", complex(*rng.uniform(-0.6, 0.6, 2)), None, s[1]),
        Part("R", "barrel", "rod", complex(*rng.uniform(-0.1, 0.1, 2)), _turn(rng)),
    ]
    pin = ("loop", "rod", complex(*rng.uniform(-0.1, 0.1, 2)), "boom", float(rng.uniform(0.2, 1.0)) * _turn(rng))
    return Mechanism(parts, [pin], {"loop": [("C", "R"), ("A", "C")][int(rng.integers(2))]})


KINDS = {"four-bar": four_bar, "five-bar": five_bar, "slider-crank": slider_crank, "cylinder": cylinder}


def scene(kind: str, rng: np.random.Generator, load: Callable[[str], Any]) -> Any:
    """Return a random robot of two coordinates or more: a linkage, a tool that turns on it, marks, joint limits.

    Limits of passive joints lie around the values that they have at home, some so near that they bind before the loop
    toggles.
    """
    while True:
        mechanism = KINDS[kind](rng)
        mechanism.home = {part.name: float(rng.uniform(-1.5, 1.5)) for part in mechanism.parts}
        link = str(rng.choice([part.child for part in mechanism.parts]))
        mechanism.parts.append(Part("T", link, "tool", complex(*rng.uniform(-0.3, 0.3, 2)), None, 1))
        try:
            at_home = load(mechanism.urdf())
        except InputError:
            continue
        for part in mechanism.parts:
            (value,) = at_home.coupling.expand(at_home.home)[[at_home.coupling.joints.index(part.name)]]
            near = 0.15 if part.way is not None else 0.5
            part.lower = float(value - rng.uniform(near, 5.0 * near))
            part.upper = float(value + rng.uniform(near, 5.0 * near))
        links, marks = ["base", *(part.child for part in mechanism.parts)], list[str]()
        for k in range(3):
            a, b = rng.choice(links, 2, replace=False)
            x, y, u, v, p, q = (float(c) for c in rng.uniform(-0.5, 0.5, 6))
            r, s = (float(c) for c in rng.uniform(0.0, 0.08, 2))
            marks.append(
                f'<pinbound:segment name="a{k}" link="{a}" xyz_a="{x} {y} 0" xyz_b="{u} {v} 0" radius="{r}"/>'
                if k % 2
                else f'<pinbound:point name="a{k}" link="{a}" xyz="{x} {y} 0" radius="{r}"/>'
            )
            marks.append(f'<pinbound:point name="b{k}" link="{b}" xyz="{p} {q} 0" radius="{s}"/>')
            marks.append(f'<pinbound:boundary name="beta_{k}" a="a{k}" b="b{k}" min_distance="0.002"/>')
        try:
            return load(mechanism.urdf("".join(marks)))
        except InputError:
            continue


def flooded(region: Any, grid: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points of a grid (g * g, 2) over a window, which are free, and which a flood from home reaches."""
    slice_ = region.slice
    low, high = slice_.window
    axes = [low[i] + (high[i] - low[i]) * (np.arange(grid) + 0.5) / grid for i in (0, 1)]
    X = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    free = np.asarray(slice_.robot.boundaries.free(slice_.lift(X)))
    robot = slice_.robot
    turns = robot.lift(slice_.lift(X))[:, [robot.lift.names.index(n) for n in robot.lift.names if n.endswith(" turn")]]
    index = np.arange(grid * grid).reshape(grid, grid)
    pairs = [(index[1:], index[:-1]), (index[:, 1:], index[:, :-1])]
    a, b = (np.concatenate([pair[k].ravel() for pair in pairs]) for k in (0, 1))
    joined = free[a] & free[b] & np.all(np.abs(turns[a] - turns[b]) < np.pi, axis=1)  # no way leads across a cut
    graph = sparse.coo_matrix((np.ones(joined.sum(), dtype=np.int8), (a[joined], b[joined])), shape=(grid * grid,) * 2)
    labels = np.where(free, sparse.csgraph.connected_components(graph, directed=False)[1] + 1, 0).reshape(grid, grid)
    place = np.clip(((slice_.start - low) / (high - low) * grid).astype(int), 0, grid - 1)
    near = labels[max(place[0] - 1, 0) : place[0] + 2, max(place[1] - 1, 0) : place[1] + 2]
    home = labels[tuple(place)] or int(near.max())
    return X, free, (labels.ravel() == home) & (home > 0)


def lifter() -> Mechanism:
    """Return a four-bar that toggles, whose coupler carries a tool with a hand on it."""
    parts = [
        Part("crank_joint", "base", "crank", 0j, None, 1, -1.0, 3.0),
        Part("knee", "crank", "coupler", 0.22 + 0j, None, 1, -3.0, 3.0),
        Part("rocker_joint", "base", "rocker", 0.3 + 0j, None, 1, -1.0, 2.8),
        Part("tool_joint", "coupler", "tool", 0.34 + 0j, None, 1, -2.6, 2.6),
    ]
    home = {"crank_joint": 1.2, "knee": -0.8, "rocker_joint": 1.6, "tool_joint": 0.6}
    pin = ("four_bar", "coupler", 0.25 + 0j, "rocker", 0.2 + 0j)
    return Mechanism(parts, [pin], {"four_bar": ("knee", "rocker_joint")}, home)


def lifter_urdf(mechanism: Mechanism) -> str:
    """Return its URDF: bodies, marks, and boundaries of which some see the loop, and one does not."""
    marks = (
        '<pinbound:segment name="tool_core" link="tool" xyz_a="0.01 0 0" xyz_b="0.32 0 0" radius="0.02"/>'
        '<pinbound:point name="tip" link="tool" xyz="0.32 0 0" radius="0.02"/>'
        '<pinbound:segment name="rocker_core" link="rocker" xyz_a="0.02 0 0" xyz_b="0.18 0 0" radius="0.02"/>'
        '<pinbound:point name="crank_pin" link="crank" xyz="0.22 0 0" radius="0.03"/>'
        '<pinbound:segment name="floor_edge" link="base" xyz_a="-0.1 -0.08 0" xyz_b="0.4 -0.08 0" radius="0.03"/>'
        '<pinbound:point name="post" link="base" xyz="0.62 0.3 0" radius="0.04"/>'
        '<pinbound:box name="crate" link="base" xyz="-0.3 0.1 0" rpy="0 0 0.3" size="0.1 0.1 0.1" radius="0"/>'
        '<pinbound:box name="grip" link="hand" xyz="0.03 0 0" rpy="0 0 0" size="0.04 0.06 0.02" radius="0"/>'
        '<pinbound:boundary name="tool_crank" a="tool_core" b="crank_pin" min_distance="0.002"/>'
        '<pinbound:boundary name="tool_post" a="tip" b="post" min_distance="0.005"/>'
        '<pinbound:boundary name="crank_rocker" a="crank_pin" b="rocker_core" min_distance="0.002"/>'
        '<pinbound:boundary name="tip_floor" a="tip" b="floor_edge" min_distance="0.002"/>'
        '<pinbound:boundary name="grip_crate" a="grip" b="crate" min_distance="0.002"/>'
    )
    hand = '<link name="hand"/><joint name="flange" type="fixed"><parent link="tool"/><child link="hand"/>'
    return mechanism.urdf(marks, hand + '<origin xyz="0.32 0 0"/></joint>')
