"""Covers of the Panda's and the UR5's meshes beside CoACD, V-HACD and a sampled sphere cover, all judged in one way.

    pip install coacd vhacdx
    nice python -m benchmarks.cover_peers --only panda,ur5 --seconds 900 --out cover-peers.md
    python -m benchmarks.cover_peers --only ur5 --links forearm_link,wrist_1_link,wrist_3_link

Each tool gives parts of each mesh: hulls, or spheres. A triangle is outside if one of its corners is in no part (by
more than 1e-9 m), which is certain; how far is measured. The excess is bounded by `pinbound`'s own function, with the
same ball about all parts. CoACD is given `--accuracy` as its threshold in metres, V-HACD 32 hulls. The sampled spheres
are a usual recipe: for each sample of the surface that no sphere holds yet, the largest ball that touches the surface
there from inside, by the samples, grown by the accuracy. A tool that is not installed is left out, and named.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import pinbound as pb
from benchmarks.covers import NAMES, ROBOTS, mesh_bodies
from pinbound.annotations.shapes import extreme_vertices
from pinbound.coverage.excess import excess_of
from pinbound.coverage.mesh_covers import cover_meshes
from pinbound.coverage.mesh_proof import away_from
from pinbound.coverage.near import Near
from pinbound.coverage.parts import outline
from pinbound.coverage.surfaces import surface_of
from pinbound.meshes import Mesh

Array = NDArray[np.float64]
Tool = Callable[[Mesh, float], list[Any]]
SAMPLES = 4000  # of a mesh's surface, for spheres
MOST_SPHERES = 5000
OUTSIDE = 1e-9  # metres: a corner that is further outside counts


def welded(mesh: Mesh) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices, each once, and triangles: other tools want them so."""
    vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return vertices, index.ravel()[mesh.triangles]


def hull(points: Array) -> Any:
    """Return a hull of points as a mark."""
    return pb.Hull("h", "l", tuple(map(tuple, extreme_vertices(points).tolist())))


def by_pinbound(mesh: Mesh, accuracy: float) -> list[Any]:
    """Return marks as `pinbound mark` proposes them."""
    return list(cover_meshes([("m", "l", mesh)], accuracy, most=32)[0].marks)


def by_coacd(mesh: Mesh, accuracy: float) -> list[Any]:
    """Return CoACD's hulls; its threshold in metres."""
    import coacd

    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(*welded(mesh)), threshold=accuracy, real_metric=True)
    return [hull(np.array(vertices)) for vertices, _ in parts]


def by_vhacd(mesh: Mesh, accuracy: float) -> list[Any]:
    """Return V-HACD's hulls: 32, as many as pinbound may have."""
    import vhacdx

    vertices, rows = welded(mesh)
    faces = np.column_stack((np.full(len(rows), 3), rows)).ravel().astype(np.uint32)
    parts = vhacdx.compute_vhacd(vertices, faces, maxConvexHulls=32)
    return [hull(np.array(points)) for points, _ in parts]


def by_spheres(mesh: Mesh, accuracy: float) -> list[Any]:
    """Return spheres that hold samples of a surface: the largest that touch it from inside, grown by the accuracy."""
    random = np.random.default_rng(0)
    corners = mesh.vertices[mesh.triangles]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(crossed, axis=1)
    rows = random.choice(len(corners), SAMPLES, p=area / area.sum())
    samples = np.einsum("nk,nki->ni", random.dirichlet(np.ones(3), SAMPLES), corners[rows])
    inward = -crossed[rows] / area[rows, None]
    tree, left, found = cKDTree(samples), np.ones(SAMPLES, dtype=bool), list[Any]()
    while np.any(left) and len(found) < MOST_SPHERES:
        row = int(np.flatnonzero(left)[0])
        radius = float(np.linalg.norm(np.ptp(samples, axis=0)))
        for _ in range(40):  # the ball that touches the surface here and nowhere goes beyond it (shrinking balls)
            centre = samples[row] + radius * inward[row]
            away, other = tree.query(centre)
            if away >= radius * (1.0 - 1e-6) or other == row:
                break
            gap = samples[row] - samples[other]
            along = float(gap @ -inward[row])
            radius = float(gap @ gap) / (2.0 * along) if along > 0.0 else radius / 2.0
        centre, radius = samples[row] + radius * inward[row], radius + accuracy
        left[tree.query_ball_point(centre, radius)] = False
        left[row] = False
        found.append(pb.Point(f"s{len(found)}", "l", tuple(centre.tolist()), radius))
    return found


TOOLS: dict[str, Tool] = {"pinbound": by_pinbound, "CoACD": by_coacd, "V-HACD": by_vhacd, "sampled spheres": by_spheres}


def judged(mesh: Mesh, marks: list[Any], accuracy: float) -> tuple[int, float, float]:
    """Return how many triangles are outside, by how much at most at their corners, and a bound of the excess [m]."""
    places = mesh.vertices[mesh.triangles]
    away = np.min([away_from(one.shape, places.reshape(-1, 3)) - one.shape.radius for one in marks], axis=0)
    outside = np.any(away.reshape(-1, 3) > OUTSIDE, axis=1)
    surfaces = [surface_of(*outline(mark)) for mark in marks]
    around = max(0.1 * accuracy, 1e-6 + max(one.radius + one.slack for one in surfaces))
    found = excess_of(surfaces, Near(mesh), around, accuracy, range(len(surfaces)))
    return int(outside.sum()), max(float(away.max()), 0.0), max(one.bound for one in found)


def main() -> int:
    """Run and print the table; 1 if a triangle is outside pinbound's own marks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="panda,ur5", help="robots, separated by commas")
    parser.add_argument("--links", default="", help="links, separated by commas; default: all")
    parser.add_argument("--tools", default=",".join(TOOLS), help="separated by commas")
    parser.add_argument("--accuracy", type=float, default=0.002, help="[m]")
    parser.add_argument("--seconds", type=float, default=900.0, help="CPU, after which no tool is started")
    parser.add_argument("--out", type=Path, help="where each row is written when it is there")
    options = parser.parse_args()
    heads = ("robot", "tool", "links", "triangles", "with a corner outside", "by up to [mm]")
    heads += ("parts", "largest excess [mm]", "median of links [mm]", "CPU [s]")
    lines = ["| " + " | ".join(heads) + " |", "| --- | --- |" + " ---: |" * (len(heads) - 2)]
    links = [one for one in options.links.split(",") if one]
    start, missed = time.process_time(), 0
    robots = {name: mesh_bodies(ROBOTS / NAMES[name]) for name in options.only.split(",")}
    for name, (robot, bodies) in robots.items():  # all loaded before any tool: CoACD changes what URDFs are parsed with
        meshes = [robot.meshes.of(body) for body in bodies if not links or body.link in links]
        for tool in options.tools.split(","):
            if time.process_time() - start > options.seconds:
                print(f"{name}, {tool}: left out, for the time is spent", flush=True)
                continue
            try:
                before = time.process_time()
                made = [TOOLS[tool](mesh, options.accuracy) for mesh in meshes]
                cpu = time.process_time() - before
            except ImportError as error:
                print(f"{tool}: not installed ({error})", flush=True)
                continue
            found = [judged(mesh, marks, options.accuracy) for mesh, marks in zip(meshes, made, strict=True)]
            outside, out = sum(one[0] for one in found), max(one[1] for one in found)
            excess = 1e3 * np.array([one[2] for one in found])
            cells = (name, tool, len(meshes), f"{sum(len(mesh.triangles) for mesh in meshes):,}", f"{outside:,}")
            cells += (f"{1e3 * out:.3f}", sum(map(len, made)), f"{excess.max():.2f}", f"{np.median(excess):.2f}")
            lines.append("| " + " | ".join(map(str, (*cells, f"{cpu:.1f}"))) + " |")
            print(lines[-1], flush=True)
            missed += outside if tool == "pinbound" else 0
            if options.out is not None:
                options.out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
