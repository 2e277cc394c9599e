"""Raw bodies: collision bodies (else visual ones) as in the URDF, with meshes read by coal's loader (Pinocchio's).

pinbound's reader of meshes and its covers are not used here.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, cast

import numpy as np

from pinbound.coverage.bodies import SHAPES, Body, collision_bodies
from pinbound.crosscheck.engine import Engine, Shape, body_shapes
from pinbound.exceptions import InputError
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Flags

__all__ = ["READ", "RawBodies", "raw_shapes", "unreadable"]

READ: tuple[str, ...] = tuple(dict.fromkeys((*SHAPES, "mesh")))
"""Shapes of bodies that coal gets."""


def unreadable(robot: Robot, body: Body) -> str:
    """Return why coal cannot use a body; empty if it can."""
    if body.shape != "mesh":
        return ""
    import coal as coal_untyped

    coal = cast(Any, coal_untyped)
    try:
        file = robot.meshes.path(body)
        coal.CachedMeshLoader(coal.NODE_TYPE.BV_OBBRSS).load(str(file), np.array(body.scale))
    except InputError as error:
        return f"has a mesh that cannot be read: {error}"
    except (RuntimeError, ValueError) as error:  # the exceptions of coal's loader
        return f"has a mesh that coal does not read: {error}"
    return ""


def raw_shapes(robot: Robot, bodies: Sequence[Body]) -> list[Shape]:
    """Return bodies as shapes of coal, also meshes; the caller must have removed `unreadable` ones."""
    found: list[Shape] = []
    for body in bodies:
        if body.shape == "mesh":
            file = str(robot.meshes.path(body))
            found.append(Shape(body.link, "mesh", (), body.rotation, body.translation, file=file, scale=body.scale))
        else:
            found += body_shapes([body])
    return found


class RawBodies:
    """Coal's results for the raw bodies of pairs of links."""

    def __init__(self, robot: Robot, pairs: Sequence[tuple[str, str]]) -> None:
        """Take the pairs; bodies that coal cannot use are left out, and `left_out` says why."""
        wanted = {name for links in pairs for name in links}
        self.left_out: dict[str, str] = {}
        bodies: list[Body] = []
        for body in collision_bodies(robot):
            if body.link in wanted:
                known = body.shape in READ
                why = unreadable(robot, body) if known else f"has a {body.shape}, which is not compared"
                if why:
                    self.left_out[body.link] = why
                else:
                    bodies.append(body)
        of_link: dict[str, list[int]] = {name: [] for name in wanted}
        for place, body in enumerate(bodies):
            of_link[body.link].append(place)
        self.places: dict[tuple[str, str], list[int]] = {}
        chosen: list[tuple[int, int]] = []
        for links in pairs:
            both = list(product(of_link[links[0]], of_link[links[1]]))
            self.places[links] = list(range(len(chosen), len(chosen) + len(both)))
            chosen += both
        self.engine = Engine(robot, raw_shapes(robot, bodies), chosen)

    def collisions(self, Q: Array) -> Flags:
        """Return which pairs of links are in contact (N, pairs of links) at every row of Q (N, n)."""
        found = self.engine.collisions(Q)
        return np.column_stack([np.any(found[:, places], axis=1) for places in self.places.values()])

    def first_contact(self, links: tuple[str, str], Q: Array) -> int | None:
        """Return the first row of Q (N, n) at which the bodies of two links are in contact, or None."""
        places = self.places.get(links, [])
        for row, q in enumerate(Q):
            if any(self.engine.collides(q, place) for place in places):
                return row
        return None
