"""Random mechanisms of boxes, prisms and skew segments: feasible regions against coal and a flood fill.

    python benchmarks/searched_mechanisms.py --count 200 --seed 0

Each mechanism has 2 to 4 links in a row, two of whose joints span the plane, and one to four boundaries, at least one
of which turns by several angles there and is searched for. The oracle knows nothing of pinbound's geometry: Pinocchio
places bodies, coal measures them at the points of a grid, and a flood fill from home connects what is free. It must
agree with `region.contains` at every point further than the stated width from an edge, and `region.area_interval`
must hold its area, give or take the grid's own error. Where a wall or gap is thinner than a grid step the flood is
wrong; then the grid is refined, and a disagreement counts only if it stays. Where `region.unresolved` says that it is
open whether parts meet, a difference is no disagreement, but is counted.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import shapely
from scipy import ndimage

import pinbound as pb

AXES = {"planar": ("0 1 0",), "spatial": ("0 1 0", "1 0 0", "0 0 1", "0.6 0.8 0")}
GRIDS = (101, 301, 901)


def _numbers(values: object) -> str:
    return " ".join(f"{value:.5f}" for value in np.ravel(np.asarray(values)).tolist())


def _mark(rng: np.random.Generator, name: str, link: str, kind: str, style: str) -> str:
    spread = 0.03 if style == "planar" else 0.08
    middle = rng.normal(0.0, 0.1, 3) * [1.0, spread / 0.1, 1.0]
    radius = float(rng.choice([0.0, rng.uniform(0.003, 0.03)]))
    at = f'name="{name}" link="{link}"'
    if kind == "point":
        return f'<pinbound:point {at} xyz="{_numbers(middle)}" radius="{rng.uniform(0.005, 0.05):.5f}"/>'
    if kind == "segment":
        way = rng.normal(0.0, 0.1, 3)
        ends = f'xyz_a="{_numbers(middle - way)}" xyz_b="{_numbers(middle + way)}"'
        return f'<pinbound:segment {at} {ends} radius="{rng.uniform(0.005, 0.03):.5f}"/>'
    if kind == "hull":
        vertices = middle + rng.normal(0.0, 0.06, (int(rng.integers(4, 20)), 3))
        return f'<pinbound:hull {at} vertices="{_numbers(vertices)}" radius="{radius:.5f}"/>'
    count = {"plate": 2, "box": 3, "prism": int(rng.integers(4, 6))}[kind]
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0] if rng.random() < 0.5 else np.eye(3)
    ways = turned[:, :3].T * rng.uniform(0.02, 0.25, (3, 1))
    ways = np.concatenate((ways[:count], rng.normal(0.0, 0.05, (max(count - 3, 0), 3))))
    corner = middle - 0.5 * ways.sum(axis=0)
    return f'<pinbound:sweep {at} xyz="{_numbers(corner)}" ways="{_numbers(ways)}" radius="{radius:.5f}"/>'


def mechanism(rng: np.random.Generator, style: str, hulls: bool = False) -> str:
    """Return the URDF of a random mechanism, home at zero not yet known to be free."""
    links = int(rng.integers(2, 5))
    active = sorted(rng.choice(links, 2, replace=False).tolist())
    lines = ['<robot name="random" xmlns:pinbound="urn:pinbound:1"><link name="link_0"/>']
    for i in range(links):
        origin = f"0 0 {rng.uniform(0.08, 0.3) if i else 0.0:.6f}"
        lower, upper, mimic = -rng.uniform(1.0, 3.0), rng.uniform(1.0, 3.0), ""
        if i not in active and rng.random() < 0.5:
            mimic = f'<mimic joint="j{active[int(rng.integers(2))]}" multiplier="{rng.choice([-1.0, 0.5, 1.0])}"/>'
            lower, upper = -20.0, 20.0
        lines.append(
            f'<link name="link_{i + 1}"/><joint name="j{i}" type="revolute"><parent link="link_{i}"/>'
            f'<child link="link_{i + 1}"/><origin xyz="{origin}" rpy="0 0 0"/><axis xyz="{rng.choice(AXES[style])}"/>'
            f'{mimic}<limit lower="{lower:.4f}" upper="{upper:.4f}" effort="1" velocity="1"/></joint>'
        )
    marks: list[str] = []
    solid = ["box", "box", "prism", "plate", *(["hull"] * 4 if hulls else [])]
    for k in range(int(rng.integers(1, 5))):
        a, b = sorted(rng.choice(links + 1, 2, replace=False).tolist())
        kinds = [str(rng.choice(solid)), str(rng.choice([*solid, "segment", "segment", "point"]))]
        if rng.random() < 0.15:
            kinds = ["segment", "segment"]
        for name, link, kind in zip((f"a{k}", f"b{k}"), (a, b), rng.permutation(kinds).tolist(), strict=True):
            marks.append(_mark(rng, name, f"link_{link}", kind, style))
        marks.append(
            f'<pinbound:boundary name="beta_{k}" a="a{k}" b="b{k}" min_distance="{rng.choice([0.0, 0.005])}"/>'
        )
    lines.append("<pinbound:annotations>" + "".join(marks) + "</pinbound:annotations></robot>")
    return "\n".join(lines)


class Bodies:
    """The marks as coal's bodies on Pinocchio's model."""

    def __init__(self, robot: pb.Robot) -> None:
        """Place a body at each mark."""
        self.robot, self.data = robot, robot.model.createData()
        self.geometry = pin.GeometryModel()
        self.gaps: list[float] = []
        for boundary in robot.boundaries:
            ids = [self._add(mark) for mark in (boundary.point_a, boundary.point_b)]
            self.geometry.addCollisionPair(pin.CollisionPair(*ids))
            tolerance = robot.annotations.contact_tolerance
            radii = boundary.point_a.shape.radius + boundary.point_b.shape.radius
            self.gaps.append(max(boundary.min_distance + radii, tolerance) - radii)
        self.found = pin.GeometryData(self.geometry)
        for request, gap in zip(self.found.collisionRequests, self.gaps, strict=True):
            request.security_margin = gap

    def _add(self, mark: object) -> int:
        shape = mark.shape  # type: ignore[attr-defined]
        link, radius, points = mark.link, shape.radius, shape.vertices  # type: ignore[attr-defined]
        frame = self.robot.model.frames[self.robot.model.getFrameId(link, pin.BODY)]
        place = pin.SE3.Identity()
        if len(points) == 1:
            body, place.translation = coal.Sphere(radius), points[0]
        elif len(points) == 2:
            along = points[1] - points[0]
            body = coal.Capsule(radius, float(np.linalg.norm(along)))
            z = along / np.linalg.norm(along)
            x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
            x /= np.linalg.norm(x)
            place = pin.SE3(np.column_stack((x, np.cross(z, x), z)), points.mean(axis=0))
        elif shape.is_zonotope and len(points) == 4:
            sides = [points[2] - points[0], points[1] - points[0]]
            axes = [side / np.linalg.norm(side) for side in sides]
            body = coal.Box(*map(np.linalg.norm, sides), 0.0)
            place = pin.SE3(np.column_stack((*axes, np.cross(*axes))), points.mean(axis=0))
            body.setSweptSphereRadius(radius)
        else:
            shared = coal.StdVec_Vec3s()
            for point in points:
                shared.append(point)
            body = coal.Convex.convexHull(shared, True, "Qt")
            body.setSweptSphereRadius(radius)
        placed = frame.placement * place
        return self.geometry.addGeometryObject(pin.GeometryObject(mark.name, frame.parentJoint, placed, body))  # type: ignore[attr-defined]

    def free(self, Q: np.ndarray) -> np.ndarray:
        """Return whether configurations (N, n) are out of contact and within the limits of all joints."""
        free = np.ones(len(Q), dtype=bool)
        for limit in self.robot.linear_limits:
            theta = Q @ limit.coefficients + limit.offset
            free &= (theta > limit.lower) & (theta < limit.upper)
        for row in np.flatnonzero(free):
            theta = self.robot.coupling.expand(Q[row : row + 1])[0]
            free[row] = not pin.computeCollisions(self.robot.model, self.data, self.geometry, self.found, theta, True)
        return free


@dataclass
class Comparison:
    """What a region and the oracle said of each other."""

    disagreements: int
    told: int
    grid: int
    points: int
    area: float
    area_error: float


def compare(region: pb.Region, grids: tuple[int, ...] = GRIDS) -> Comparison:
    """Compare membership and area with coal and a flood fill, the grid refined while they disagree."""
    bodies, plane = Bodies(region.slice.robot), region.slice
    low, high = plane.window
    result = None
    for grid in grids:
        axes = [low[i] + (high[i] - low[i]) * (np.arange(grid) + 0.5) / grid for i in (0, 1)]
        X = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        free = bodies.free(plane.lift(X))
        labels, _ = ndimage.label(free.reshape(grid, grid))
        place = np.clip(((plane.start - low) / (high - low) * grid).astype(int), 0, grid - 1)
        near = labels[max(place[0] - 1, 0) : place[0] + 2, max(place[1] - 1, 0) : place[1] + 2]
        home = labels[tuple(place)] or int(near.max())
        flooded = (labels.ravel() == home) & (home > 0)
        inside = np.asarray(region.contains(X, order="region"))
        away = np.asarray(shapely.distance(shapely.points(X), region.polygon.boundary))
        differ = np.flatnonzero((inside != flooded) & (away > region.width))
        unsafe = np.flatnonzero(inside & ~free & (away > 1e-4))  # beside an edge coal's 1e-6 m decides
        assert not len(unsafe), f"a point in contact was called inside: {X[unsafe[0]]}"
        open_ = [place for place in region.unresolved if place.joins]
        told = 0
        if open_ and len(differ):
            told, differ = len(differ), differ[:0]
        cell = float(np.prod(high - low)) / grid**2
        border = ndimage.binary_dilation(flooded.reshape(grid, grid)) & ~ndimage.binary_erosion(
            flooded.reshape(grid, grid), border_value=1
        )
        area, error = float(flooded.sum()) * cell, 0.5 * float(border.sum()) * cell
        lower, upper = region.area_interval
        missed = 0 if told or lower - error <= area <= upper + error else 1
        result = Comparison(len(differ) + missed, told, grid, len(X), area, error)
        if not result.disagreements:
            break
    assert result is not None
    return result


def searched_robots(
    rng: np.random.Generator, folder: Path, count: int, style: str, hulls: bool = False
) -> Iterator[tuple[pb.Robot, tuple[str, str]]]:
    """Yield `count` random robots whose home is free, with two coordinates in whose plane contact is searched for."""
    from pinbound.region.outlines import is_searched
    from pinbound.region.slice import slice_of

    made = 0
    while made < count:
        path = folder / "random.urdf"
        path.write_text(mechanism(rng, style, hulls))
        try:
            robot = pb.load(path)
            names = tuple(rng.choice(robot.coordinates, 2, replace=False).tolist())
            plane = slice_of(robot, names, robot.home.copy(), {})
        except (pb.InputError, pb.DimensionError):  # home is in contact
            continue
        if any(is_searched(plane, curve) for curve in plane.curves):
            yield robot, names
            made += 1


def main() -> None:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--style", choices=tuple(AXES), default="planar")
    parser.add_argument("--width", type=float, default=1e-3)
    parser.add_argument("--hulls", action="store_true")
    parser.add_argument("--grids", type=int, nargs="+", default=GRIDS)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    times, found, regions = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        robots = searched_robots(rng, Path(folder), options.count, options.style, options.hulls)
        for number, (robot, names) in enumerate(robots):
            started = time.process_time()
            region = pb.feasible_region(robot, names, width=options.width)
            times.append(time.process_time() - started)
            one = compare(region, tuple(options.grids))
            found.append(one)
            regions.append((len(region.loops) - 1, len(region.components), region.area_interval, region.unresolved))
            if one.disagreements or one.told:
                print(f"mechanism {number}: {one}; {region}; {region.area_interval}", flush=True)
    seconds = np.array(times)
    print(f"{len(found)} mechanisms ({options.style}), {sum(one.points for one in found)} grid points")
    print(f"  disagreements:         {sum(one.disagreements for one in found)}")
    print(f"  told as open:          {sum(one.told > 0 for one in found)}")
    print("  decided at grid:       " + ", ".join(f"{g}: {sum(one.grid == g for one in found)}" for g in options.grids))
    print(f"  with holes:            {sum(holes > 0 for holes, *_ in regions)}")
    print(f"  with several parts:    {sum(parts > 1 for _, parts, *_ in regions)}")
    print(f"  with open places:      {sum(bool(open_) for *_, open_ in regions)}")
    widths = np.array([upper - lower for *_, (lower, upper), _ in regions])
    print(f"  width of the area:     median {np.median(widths):.4f}, most {widths.max():.4f} rad^2")
    spread = f"median {np.median(seconds):.2f}, 95 % {np.percentile(seconds, 95):.2f}, most {seconds.max():.2f}"
    print(f"  CPU time of a region:  {spread} s")


if __name__ == "__main__":
    main()
