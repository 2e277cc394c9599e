"""The bodies and marks of a robot that the page draws, each in the frame of its link."""

from __future__ import annotations

import base64
from typing import Any, cast

import numpy as np

from pinbound.annotations import Mark, Measure, Shape
from pinbound.coverage.bodies import SHAPES, Body, collision_bodies
from pinbound.robot.robot import Robot
from pinbound.typing import Array, Ints
from pinbound.units import several

__all__ = ["bodies_record", "marks_record"]

_FLAT = 1e-9  # a hull whose thickness is below this share of its length is drawn as a flat face


def bodies_record(robot: Robot, meshes: bool) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the bodies that are drawn, and one sentence for each kind of body that is not drawn.

    Args:
        robot: The robot.
        meshes: Whether meshes are drawn.
    """
    drawn: list[dict[str, Any]] = []
    left: dict[str, list[str]] = {}
    for body in collision_bodies(robot):
        one = _record(body)
        if body.shape == "mesh":
            fault = robot.meshes.fault(body) if meshes else "meshes are left out; --meshes (meshes=True) takes them in"
            if fault:
                left.setdefault(fault, []).append(body.name)
                continue
            mesh = robot.meshes.of(body)
            one |= {"vertices": _packed(mesh.vertices, np.float32), "triangles": _packed(mesh.triangles, np.uint32)}
            one |= {"rotation": np.eye(3).tolist(), "translation": [0.0, 0.0, 0.0]}
        elif body.shape not in SHAPES:
            left.setdefault(f"{body.shape} has no form to draw", []).append(body.name)
            continue
        drawn.append(one)
    return drawn, [f"{several(len(names), 'body is', 'bodies are')} not drawn: {why}" for why, names in left.items()]


def _record(body: Body) -> dict[str, Any]:
    return {
        "name": body.name,
        "link": body.link,
        "shape": body.shape,
        "size": list(body.size),
        "rotation": body.rotation.tolist(),
        "translation": body.translation.tolist(),
        "source": body.source,
    }


def _packed(array: Array | Ints, kind: Any) -> str:
    """Return an array as base64 of its little-endian bytes. Float32 (relative error 1e-7) is exact enough to draw."""
    little = np.ascontiguousarray(array, dtype=np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(little.tobytes()).decode("ascii")


def marks_record(robot: Robot) -> list[dict[str, Any]]:
    """Return the marks: core vertices [m], radius, triangles of a hull, direction of a line or normal of a plane."""
    return [_mark(mark) for mark in robot.annotations.marks.values()]


def _mark(mark: Mark) -> dict[str, Any]:
    shape = mark.shape
    measures = {Measure.ACROSS: "line", Measure.HEIGHT: "plane"}
    kind = measures.get(shape.measure, "point" if shape.is_point else "segment" if shape.is_segment else "hull")
    return {
        "name": mark.name,
        "link": mark.link,
        "kind": kind,
        "vertices": shape.vertices.tolist(),
        "radius": shape.radius,
        "normal": None if shape.normal is None else shape.normal.tolist(),
        "triangles": _triangles(shape).tolist() if kind == "hull" else [],
    }


def _triangles(shape: Shape) -> Ints:
    """Return the triangles (k, 3) of the hull of a shape's vertices, oriented outward; for a flat hull, both sides.

    Vertices that are sums of edge vectors may lie inside the hull: only those on its border are corners of triangles.
    """
    from scipy.spatial import ConvexHull

    spread = shape.vertices - shape.vertices.mean(axis=0)
    _, sizes, axes = np.linalg.svd(spread, full_matrices=False)
    if sizes[2] <= _FLAT * sizes[0]:
        ring = np.array(cast(Any, ConvexHull(spread @ axes[:2].T)).vertices)
        fan = np.column_stack((np.repeat(ring[0], len(ring) - 2), ring[1:-1], ring[2:]))
        return np.vstack((fan, fan[:, ::-1]))
    scaled = spread @ axes.T / sizes
    border = np.sort(np.array(cast(Any, ConvexHull(scaled)).vertices))
    found = cast(Any, ConvexHull(scaled[border], qhull_options="QJ"))
    return _outward(shape.vertices, border[np.array(found.simplices)])


def _outward(vertices: Array, triangles: Ints) -> Ints:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    inward = np.einsum("ij,ij->i", normals, a - vertices.mean(axis=0)) < 0.0
    triangles = triangles.copy()
    triangles[inward] = triangles[inward][:, ::-1]
    return triangles
