"""A live view of the robot in a browser, by viser. It shows meshes, and Python computes every number.

viser loads when a view is first asked for (extra `view`). It brings trimesh, which triangulates simple bodies.
"""

from __future__ import annotations

import threading
from importlib import import_module
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from pinbound import units
from pinbound.annotations import Mark, Measure
from pinbound.boundaries.boundary import one_configuration
from pinbound.coverage.bodies import SHAPES, Body, collision_bodies
from pinbound.exceptions import UnsupportedError
from pinbound.explorer.planes import windows
from pinbound.figures.plots import PALETTE
from pinbound.robot.loop_robot import LoopRobot
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Ints

__all__ = ["LiveView", "live_view"]

_BODY = (120, 134, 148)
_MARK = (40, 50, 60)
_TOUCHES = (213, 94, 0)
_STRETCH = 0.25  # metres: length of the drawn part of a line or plane
_DOT = 0.004  # metres: points and segments of radius zero are drawn with this thickness
_SKIN = 0.0005  # metres: other marks of radius zero, which may be flat, are drawn with this thickness
_MOST_LIMITS = 40  # with more boundaries, limits are not computed: each limit needs all boundaries


class LiveView:
    """A robot that is shown by a viser server.

    Attributes:
        robot: The robot.
        server: The `viser.ViserServer`.
        q: (n,) the configuration that is shown [rad or m].
        missing: One sentence for each body that is not drawn.
    """

    def __init__(self, robot: Robot, server: Any, at: ArrayLike | None = None) -> None:
        """Draw a robot on a running server, with one slider for each coordinate."""
        self.robot, self.server = robot, server
        start = robot.home if at is None else one_configuration(at, robot.coordinates)
        self.q: Array = np.array(start, dtype=np.float64)
        self.missing: list[str] = []
        self._lock = threading.Lock()
        server.on_client_connect(self._look)
        self._frames = [server.scene.add_frame(f"/link_{k}", show_axes=False) for k in range(len(robot.tree.links))]
        self._links = {name: k for k, name in enumerate(robot.tree.links)}
        for number, body in enumerate(collision_bodies(robot)):
            self._add_body(number, body)
        self._marks = {mark.name: self._add_mark(number, mark) for number, mark in enumerate(_marks(robot))}
        self._said = server.gui.add_markdown("")
        names = ("none", *robot.boundaries.names)
        self._choice = server.gui.add_dropdown("boundary", names, initial_value="none")
        self._choice.on_update(self._chosen)
        self._factors = units.factors(["rad" if robot.turns(name) else "m" for name in robot.coordinates])
        for index, (name, (low, high)) in enumerate(zip(robot.coordinates, windows(robot, self.q, {}), strict=True)):
            self._add_slider(index, name, low, high)
        self.show(self.q)

    def _look(self, client: Any) -> None:
        """Point the camera of a new window at the robot, from the side that shows most of it."""
        places = np.array([self.robot.positions(link, self.q) for link in self.robot.tree.links])
        low, high = places.min(axis=0), places.max(axis=0)
        size, middle = float(np.linalg.norm(high - low)) or 1.0, 0.5 * (low + high)
        across = np.array([0.4, -1.6, 0.5]) if high[1] - low[1] <= high[0] - low[0] else np.array([1.6, -0.4, 0.5])
        client.camera.position, client.camera.look_at = middle + size * across, middle

    def _chosen(self, _: Any) -> None:
        self.show(self.q)

    def _add_slider(self, index: int, name: str, low: float, high: float) -> None:
        factor = float(self._factors[index])
        unit = units.names(["rad" if self.robot.turns(name) else "m"])[0]
        slider = self.server.gui.add_slider(
            f"{name} [{unit}]", low * factor, high * factor, 0.01, float(self.q[index]) * factor
        )

        def moved(_: Any) -> None:
            q = self.q.copy()
            q[index] = float(slider.value) / factor
            self.show(q)

        slider.on_update(moved)

    def _add_body(self, number: int, body: Body) -> None:
        try:
            vertices, triangles = _body_triangles(self.robot, body)
        except ValueError as error:  # a mesh cannot be read, or the body has no shape to draw
            self.missing.append(f"{body.name} is not drawn: {error}")
            return
        place = f"/link_{self._links[body.link]}/body_{number}"
        self.server.scene.add_mesh_simple(place, vertices, triangles, color=_BODY, flat_shading=True)

    def _add_mark(self, number: int, mark: Mark) -> Any:
        vertices, triangles = _mark_triangles(mark)
        place = f"/link_{self._links[mark.link]}/mark_{number}"
        return self.server.scene.add_mesh_simple(place, vertices, triangles, color=_MARK, opacity=0.3)

    def show(self, q: ArrayLike) -> None:
        """Show a configuration (n,): placements of links, clearances, contacts, and the chosen marks."""
        with self._lock:
            self.q = np.array(one_configuration(q, self.robot.coordinates), dtype=np.float64)
            for frame, link in zip(self._frames, self.robot.tree.links, strict=True):
                origin = self.robot.positions(link, self.q)
                axes = np.array([self.robot.positions(link, self.q, row) - origin for row in np.eye(3).tolist()])
                frame.position, frame.wxyz = origin, _quaternion(axes.T)
            signed = self.robot.boundaries.signed_clearances(self.q)
            self._paint(signed)
            self._said.content = self._text(signed)

    def _paint(self, signed: Array) -> None:
        chosen = str(self._choice.value)
        colours = dict.fromkeys(self._marks, _MARK)
        for index, boundary in enumerate(self.robot.boundaries):
            pair = boundary.point_a.name, boundary.point_b.name
            if not signed[index] > 0.0:
                colours |= dict.fromkeys(pair, _TOUCHES)
            if boundary.name == chosen:
                text = PALETTE[index % len(PALETTE)]
                colours |= dict.fromkeys(pair, tuple(int(text[k : k + 2], 16) for k in (1, 3, 5)))
        for name, handle in self._marks.items():
            handle.color = colours[name]

    def _text(self, signed: Array) -> str:
        names = self.robot.boundaries.names
        touching = [name for name, value in zip(names, signed.tolist(), strict=True) if not value > 0.0]
        if self.robot.boundaries.free(self.q):
            least = (
                f", smallest clearance {1e3 * signed.min():.3f} mm ({names[int(np.argmin(signed))]})" if names else ""
            )
            lines = [f"**Free**{least}"]
        else:
            lines = [f"**Not free**: {self._open() or ', '.join(touching) or 'a joint limit is passed'}"]
        if not touching and 0 < len(names) <= _MOST_LIMITS:
            lines += ["", *(f"- {self._limits(name)}" for name in self.robot.coordinates)]
        return "\n".join([*lines, "", f"Coverage: {self.robot.coverage.summary}.", *self.missing])

    def _open(self) -> str:
        """Return which loops cannot be closed at q; "" if all can. The robot cannot reach a q with an open loop."""
        if not isinstance(self.robot, LoopRobot):
            return ""
        z, lift = self.robot.lift(self.q), self.robot.lift
        ends = [one.transmission_range for one in lift.linkages]
        values = [float(z[columns[2]]) for columns in lift.columns]
        names = [
            one.name for one, w, (low, high) in zip(lift.linkages, values, ends, strict=True) if not low <= w <= high
        ]
        return f"a loop cannot be closed: {', '.join(names)}" if names else ""

    def _limits(self, name: str) -> str:
        unit = "rad" if self.robot.turns(name) else "m"
        try:
            found = self.robot.boundaries.limits(name, self.q)
        except UnsupportedError as error:
            return f"{name}: {error}"
        low, high = (units.amount(float(end), unit, 3) for end in (found.lower, found.upper))
        return f"{name}: {low} ({found.lower_stop}) to {high} ({found.upper_stop})"


def live_view(robot: Robot, port: int = 8080, host: str = "127.0.0.1", at: ArrayLike | None = None) -> LiveView:
    """Serve a live view of a robot, with meshes, at ``http://HOST:PORT``; the server runs until its process ends.

    Args:
        robot: The robot.
        port: The first port that is tried.
        host: The address on which the server listens; by default only this machine can connect.
        at: (n,) the configuration that is shown first [rad or m]; home by default.

    Raises:
        UnsupportedError: If viser is not installed.
        DimensionError: If `at` is not one configuration.
    """
    try:
        viser: Any = import_module("viser")
    except ImportError as error:
        raise UnsupportedError("this needs viser, which is not installed: pip install 'pinbound[view]'") from error
    return LiveView(robot, viser.ViserServer(host=host, port=port, verbose=False), at)


def _marks(robot: Robot) -> list[Mark]:
    return list(robot.annotations.marks.values())


def _quaternion(rotation: Array) -> Array:
    from scipy.spatial.transform import Rotation

    x, y, z, w = cast(Any, Rotation).from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def _body_triangles(robot: Robot, body: Body) -> tuple[Array, Ints]:
    if body.shape == "mesh":
        mesh = robot.meshes.of(body)
        return mesh.vertices, mesh.triangles
    if body.shape not in SHAPES:
        raise ValueError(f"{body.shape} has no form to draw")
    made: Any = import_module("trimesh").creation
    make = {
        "box": lambda: made.box(extents=body.size),
        "sphere": lambda: made.icosphere(radius=body.size[0]),
        "cylinder": lambda: made.cylinder(radius=body.size[0], height=body.size[1]),
        "capsule": lambda: made.capsule(radius=body.size[0], height=body.size[1]),
    }
    found = make[body.shape]()
    vertices: Array = np.asarray(found.vertices, dtype=np.float64) @ body.rotation.T + body.translation
    return vertices, np.asarray(found.faces, dtype=np.int64)


def _mark_triangles(mark: Mark) -> tuple[Array, Ints]:
    """Return the hull of balls about a mark's vertices; for a line or plane, of a part of it."""
    trimesh: Any = import_module("trimesh")
    shape = mark.shape
    points = shape.vertices
    if shape.normal is not None:
        across: Array = np.linalg.svd(shape.normal[None])[2][1:]
        ends = {Measure.ACROSS: shape.normal[None], Measure.HEIGHT: across}[shape.measure]
        points = shape.origin + _STRETCH * np.vstack((ends, -ends))
    ball: Array = np.asarray(trimesh.creation.icosphere(subdivisions=2).vertices, dtype=np.float64)
    radius = shape.radius or (_DOT if len(points) <= 2 else _SKIN)
    hull = trimesh.convex.convex_hull((points[:, None] + radius * ball).reshape(-1, 3), qhull_options="QJ")
    return np.asarray(hull.vertices, dtype=np.float64), np.asarray(hull.faces, dtype=np.int64)
