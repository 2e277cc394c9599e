"""Random planar mechanisms: feasible regions against a brute-force oracle.

    python benchmarks/planar_mechanisms.py --count 1000 --seed 0

Each mechanism has 2 to 4 links in a row, two of whose joints (and followers) span the plane, and one to twenty
boundaries between random points with random radii. The oracle evaluates the clearances on a fine grid and floods from
home. They must agree at every grid point further than the region's accuracy from an edge. Where a wall or a gap is
thinner than a grid step, the flood itself is wrong; then the grid is refined, and a disagreement counts only if it
stays.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from scipy import ndimage

import pinbound as pb

AXES = {"planar": ("0 1 0",), "spatial": ("0 1 0", "1 0 0", "0 0 1", "0.6 0.8 0")}
GRIDS = (201, 601, 1801, 3601)


def mechanism(rng: np.random.Generator, style: str = "planar", boundaries: int | None = None) -> str:
    """Return the URDF of a random mechanism, home at zero not yet known to be free."""
    links = int(rng.integers(2, 5))
    active = sorted(rng.choice(links, 2, replace=False).tolist())
    lines = ['<robot name="random" xmlns:pinbound="urn:pinbound:1"><link name="link_0"/>']
    for i in range(links):
        length = rng.uniform(0.08, 0.3)
        origin = f"0 0 {length if i else 0.0:.6f}"
        lower, upper = -rng.uniform(1.5, 3.4), rng.uniform(1.5, 3.4)
        mimic = ""
        if i not in active and rng.random() < 0.5:
            factor = rng.choice([-1.0, 0.5, 2.0, 1.0])
            mimic = (
                f'<mimic joint="j{active[int(rng.integers(2))]}" multiplier="{factor}" offset="{rng.normal():.3f}"/>'
            )
            lower, upper = -20.0, 20.0
        axis = rng.choice(AXES[style])
        lines.append(
            f'<link name="link_{i + 1}"/><joint name="j{i}" type="revolute"><parent link="link_{i}"/>'
            f'<child link="link_{i + 1}"/><origin xyz="{origin}" rpy="0 0 0"/><axis xyz="{axis}"/>{mimic}'
            f'<limit lower="{lower:.4f}" upper="{upper:.4f}" effort="1" velocity="1"/></joint>'
        )
    marks = []
    for k in range(int(rng.integers(1, 6)) if boundaries is None else boundaries):
        a, b = sorted(rng.choice(links + 1, 2, replace=False).tolist())
        for name, link in ((f"a{k}", a), (f"b{k}", b)):
            x, z = rng.normal(0.0, 0.1, 2)
            y = rng.normal(0.0, 0.02) if style == "spatial" else 0.0
            radius = rng.choice([0.0, rng.uniform(0.005, 0.06)])
            marks.append(
                f'<pinbound:point name="{name}" link="link_{link}" xyz="{x:.5f} {y:.5f} {z:.5f}" '
                f'radius="{radius:.5f}"/>'
            )
        distance = rng.choice([0.0, 0.005])
        marks.append(f'<pinbound:boundary name="beta_{k}" a="a{k}" b="b{k}" min_distance="{distance}"/>')
    lines.append("<pinbound:annotations>" + "".join(marks) + "</pinbound:annotations></robot>")
    return "\n".join(lines)


def free_robots(rng: np.random.Generator, folder: Path, count: int, style: str, boundaries: int | None = None):
    """Yield `count` random robots whose home is free, with their two plane coordinates."""
    made = 0
    while made < count:
        path = folder / "random.urdf"
        path.write_text(mechanism(rng, style, boundaries))
        try:
            robot = pb.load(path)
        except pb.InputError as error:
            if "home is outside" not in str(error):
                raise
            continue
        names = robot.coordinates
        yield robot, tuple(rng.choice(names, 2, replace=False).tolist())
        made += 1


@dataclass
class Comparison:
    """What a region and the oracle said of each other."""

    disagreements: int
    grid: int
    points: int
    area_difference: float
    area_error: float


def _free(robot: pb.Robot, Q: np.ndarray) -> np.ndarray:
    free = np.ones(len(Q), dtype=bool)
    for boundary in robot.boundaries:
        free &= boundary.norm(Q) > max(boundary.threshold, robot.annotations.contact_tolerance)
    for limit in robot.linear_limits:
        theta = Q @ limit.coefficients + limit.offset
        free &= (theta > limit.lower) & (theta < limit.upper)
    return free


def oracle(region: pb.Region, grid: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return grid points (g * g, 2), which are free, and which are free and connected to home on the grid."""
    robot, plane = region.slice.robot, region.slice
    low, high = plane.window
    axes = [low[i] + (high[i] - low[i]) * (np.arange(grid) + 0.5) / grid for i in (0, 1)]
    X = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    free = np.concatenate([_free(robot, plane.lift(part)) for part in np.array_split(X, max(1, len(X) // 200_000))])
    labels, _ = ndimage.label(free.reshape(grid, grid))
    place = np.clip(((plane.start - low) / (high - low) * grid).astype(int), 0, grid - 1)
    near = labels[max(place[0] - 1, 0) : place[0] + 2, max(place[1] - 1, 0) : place[1] + 2]
    home = labels[tuple(place)] or int(near.max())
    return X, free, (labels.ravel() == home) & (home > 0)


def compare(region: pb.Region, grids: tuple[int, ...] = GRIDS) -> Comparison:
    """Compare membership and area with the oracle, the grid refined while they disagree."""
    result = None
    for grid in grids:
        X, free, flooded = oracle(region, grid)
        inside = np.asarray(region.contains(X, order="region"))
        assert not np.any(inside & ~free), "a point in contact was called inside"
        differ = np.flatnonzero(inside != flooded)
        if len(differ):
            away = shapely.distance(shapely.points(X[differ]), region.polygon.boundary)
            differ = differ[away > region.accuracy]
        cell = float(np.prod(region.slice.window[1] - region.slice.window[0])) / grid**2
        area = abs(float(flooded.sum()) * cell - region.area)
        result = Comparison(len(differ), grid, len(X), area, region.area_error)
        if not len(differ):
            break
    assert result is not None
    return result


def main() -> None:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--style", choices=tuple(AXES), default="planar")
    parser.add_argument("--boundaries", type=int, default=None)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    times, found = [], []
    with tempfile.TemporaryDirectory() as folder:
        for number, (robot, names) in enumerate(
            free_robots(rng, Path(folder), options.count, options.style, options.boundaries)
        ):
            started = time.process_time()
            region = pb.feasible_region(robot, names)
            times.append(time.process_time() - started)
            one = compare(region)
            found.append((one, len(region.loops) - 1, len(region.components), len(region.slice.curves), times[-1]))
            if one.disagreements:
                print(f"mechanism {number}: {one.disagreements} points disagree at grid {one.grid}; {region}")
    ms = 1e3 * np.array(times)
    print(f"{len(found)} mechanisms ({options.style}), {sum(one.points for one, *_ in found)} grid points")
    print(f"  disagreements:         {sum(one.disagreements for one, *_ in found)}")
    print("  decided at grid:       " + ", ".join(f"{g}: {sum(one.grid == g for one, *_ in found)}" for g in GRIDS))
    print(f"  with curves:           {sum(c > 0 for *_, c, _ in found)}")
    print(f"  with holes:            {sum(h > 0 for _, h, *_ in found)}")
    print(f"  with several parts:    {sum(p > 1 for _, _, p, *_ in found)}")
    spread = f"median {np.median(ms):.1f}, 95 % {np.percentile(ms, 95):.1f}, most {ms.max():.1f}"
    print(f"  CPU time of a region:  {spread} ms")


if __name__ == "__main__":
    main()
