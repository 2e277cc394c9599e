"""Can link 5 and link 7 of the Panda touch, over the limits of joint 6 and joint 7? The region, against coal.

    python benchmarks/link5_link7.py --figure docs/figures/link5-link7

Link 5 and link 7 carry the hulls of their collision meshes, which are hulls as they come. The region of (q6, q7) that
is free of contact between them has a boundary that is enclosed in cells, and an interval of its area that is proven. A
grid of 121 x 121 configurations asks coal about the raw meshes: a node in contact must not be inside the region, and
the share of free nodes must agree with the area.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

import pinbound as pb
from pinbound.coverage.bodies import collision_bodies
from pinbound.crosscheck.engine import Engine
from pinbound.crosscheck.raw import RawBodies, raw_shapes
from pinbound.figures import plots
from pinbound.figures.canvas import save

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
PANDA = SHARE / "example-robot-data" / "robots" / "panda_description" / "urdf" / "panda.urdf"
LINKS = ("panda_link5", "panda_link7")
JOINTS = ("panda_joint6", "panda_joint7")
NODES = 121


def robot_of(home: float) -> pb.Robot:
    """Return the Panda with one hull on link 5, one on link 7, and their boundary; joint 6 at `home` [rad]."""
    robot = pb.load(PANDA, package_dirs=[SHARE])
    hulls: list[pb.Hull] = []
    for body in collision_bodies(robot):
        if body.link in LINKS:
            mesh = robot.meshes.of(body)
            corners = mesh.vertices[ConvexHull(mesh.vertices).vertices]
            hulls.append(pb.Hull(body.link, body.link, tuple(map(tuple, corners.tolist()))))  # type: ignore[arg-type]
    said = dict(zip(robot.coordinates, robot.home.tolist(), strict=True)) | {JOINTS[0]: home, JOINTS[1]: 0.0}
    marks = pb.Annotations.of(hulls, [pb.BoundaryMark("5-7", *LINKS)])
    return robot.with_annotations(replace(marks, home=said))


def grid(robot: pb.Robot) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the nodes of both joints over their limits, and the configurations (NODES^2, n)."""
    places = [robot.coordinates.index(name) for name in JOINTS]
    axes = [np.linspace(robot.lower[place], robot.upper[place], NODES) for place in places]
    Q = np.tile(robot.home, (NODES * NODES, 1))
    Q[:, places] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return axes, Q


def on_visual_meshes(robot: pb.Robot) -> int:
    """Print at how many nodes coal finds the visual meshes of the two links in contact."""
    bodies = [
        replace(body, filename=body.filename.replace("collision", "visual").replace(".stl", ".dae"))
        for body in collision_bodies(robot)
        if body.link in LINKS
    ]
    _, Q = grid(robot)
    touch = Engine(robot, raw_shapes(robot, bodies), [(0, 1)]).collisions(Q)[:, 0]
    counts = [len(robot.meshes.of(body).triangles) for body in bodies]
    print(f"In contact on the visual meshes ({counts} triangles): {int(touch.sum())} of {len(Q)} nodes.")
    return 0


def main() -> int:
    """Run, print, write; exit code 1 if a node in contact is called inside."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=float, default=0.01, help="of the cells [rad]")
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--visual", action="store_true", help="ask coal about the visual meshes, and nothing else")
    options = parser.parse_args()
    robot = robot_of(home=1.87)
    if options.visual:
        return on_visual_meshes(robot)
    start, cpu = time.perf_counter(), time.process_time()
    region = pb.feasible_region(robot, JOINTS, width=options.width, accuracy=1e-3, budget=np.inf)
    wall, cpu = time.perf_counter() - start, time.process_time() - cpu
    low, high = region.area_interval
    places = [robot.coordinates.index(name) for name in JOINTS]
    axes, Q = grid(robot)
    start = time.perf_counter()
    touch = RawBodies(robot, [LINKS]).collisions(Q)[:, 0]
    queries = time.perf_counter() - start
    boundary = robot.boundaries["5-7"]
    marks = boundary.signed_clearance(Q) <= 0.0
    inside = region.contains(Q)
    deepest = float(boundary.penetration(Q[touch]).depth.max())
    whole = float(np.prod([axis[-1] - axis[0] for axis in axes]))
    lines = [
        f"Area of the limits of ({', '.join(JOINTS)}): {whole:.4f} rad^2.",
        f"Free of contact, in one part with home: drawn {region.area:.4f}, proven {low:.4f} to {high:.4f} rad^2"
        f" ({100 * low / whole:.1f} to {100 * high / whole:.1f} %), in {wall:.1f} s ({cpu:.1f} s of CPU).",
        f"In contact on the raw meshes: {int(touch.sum())} of {len(Q)} nodes (coal, {queries:.1f} s); for the marks,"
        f" with 0.02 mm around: {int(marks.sum())}; deepest {1e3 * deepest:.1f} mm.",
        f"Nodes in contact that the region calls inside: {int((touch & inside).sum())}."
        f" Free nodes that it leaves out: {int((~touch & ~inside).sum())}.",
        f"Area by the share of free nodes: {whole * float((~touch).mean()):.4f} rad^2.",
    ]
    print("\n".join(lines))
    if options.figure is not None:
        figure = plots.draw_region(region, robot.home[places])
        drawn = figure.axes[0]
        label = f"in contact, by coal ({int(touch.sum())})"
        drawn.plot(*np.degrees(Q[touch][:, places]).T, ".", color="#333333", markersize=2.5, label=label, zorder=2)
        square = float(np.degrees(1.0)) ** 2  # of the axes, which are in degrees
        share = 100.0 * region.area / whole
        drawn.set_title(
            "Free of contact between link 5 and link 7:\n"
            f"{square * region.area:,.0f} of {square * whole:,.0f} deg² ({share:.1f} %),\n"
            f"proven {100 * low / whole:.1f} to {100 * high / whole:.1f} %",
            loc="left",
        )
        drawn.set_xlim(np.degrees(axes[0][0]) - 8.0)
        drawn.legend(loc=(0.3, 0.2), framealpha=1)
        figure.set_size_inches(5.2, 7.2)  # as wide as what it shows, so that letters are large on a telephone
        save(figure, options.figure)
    return int((touch & inside).any())


if __name__ == "__main__":
    sys.exit(main())
