"""Regions through loops that are not parallelograms against a flood on a grid of exact signed clearances.

python -m benchmarks.loops_regions [mechanisms] [width] [seed]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import shapely

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import linkages as zoo
import pinbound as pb

GRIDS = (201, 601, 1801)


def disagreements(region: pb.Region) -> tuple[int, int]:
    """Return how many points of the grid differ outside the stated accuracy, and of which grid: the last that did."""
    left, grid = 0, 0
    for grid in GRIDS:
        X, free, flooded = zoo.flooded(region, grid)
        inside = np.asarray(region.contains(X, order="region"))
        if np.any(inside & ~free):
            return int(np.sum(inside & ~free)), grid
        differ = np.flatnonzero(inside != flooded)
        away = shapely.distance(shapely.points(X[differ]), region.polygon.boundary)
        left = int(np.sum(away > region.accuracy))
        if not left:
            break
    return left, grid


def main(count: int, width: float, seed: int) -> None:
    """Run the campaign and print its result."""
    rng, times, bad, outside, spread = np.random.default_rng(seed), [], 0, 0, []
    toggles = passive = several = holes = undecided = 0
    for number in range(count):
        kind = list(zoo.KINDS)[number % len(zoo.KINDS)]
        robot = zoo.scene(kind, rng, pb.load)
        names = tuple(rng.choice(robot.coordinates, 2, replace=False).tolist())
        begun = time.process_time()
        try:
            region = pb.feasible_region(robot, names, width=width)
        except (pb.UnsupportedError, pb.DimensionError) as error:
            print(f"{number} {kind}: {error}")
            bad += 1
            continue
        times.append(time.process_time() - begun)
        left, grid = disagreements(region)
        if left and not region.unresolved:
            bad += 1
            print(f"{number} {kind}: {left} points disagree at {grid} x {grid}: {region}")
        lower, upper = region.area_interval
        grid = max(grid, 601)  # the one that sees all passages
        _, _, flooded = zoo.flooded(region, grid)
        area = flooded.mean() * float(np.prod(region.slice.window[1] - region.slice.window[0]))
        rim = 2.0 * region.polygon.length * float((region.slice.window[1] - region.slice.window[0]).max()) / grid
        if not lower - rim <= area <= upper + rim:
            outside += 1
            print(f"{number} {kind}: area {area:.6g} is not in [{lower:.6g}, {upper:.6g}] +- {rim:.2g}: {region}")
        spread.append((upper - lower) / max(region.area, 1e-12))
        edges = {edge.name for edge in region.edges}
        toggles += any("toggle" in name for name in edges)
        passive += any(not edge.is_contact and edge.source not in names for edge in region.edges)
        several, holes = several + (len(region.components) > 1), holes + (len(region.loops) > 1)
        undecided += bool(region.unresolved)
    s = np.array(times)
    print(
        f"{count} mechanisms, width {width}: {bad} refused or in disagreement, {outside} areas outside their interval"
    )
    print(f"  an edge is a toggle: {toggles}, a toggle or a limit of a passive joint: {passive}")
    print(f"  several parts: {several}, holes: {holes}, undecided places: {undecided}")
    print(f"  CPU: median {np.median(s):.2f} s, 95 % {np.percentile(s, 95):.2f} s, most {s.max():.2f} s")
    print(f"  area interval, median width: {100 * np.median(spread):.2g} % of the area")
    if bad or outside:
        raise SystemExit(1)


if __name__ == "__main__":
    given = sys.argv[1:]
    main(
        int(given[0]) if given else 200,
        float(given[1]) if len(given) > 1 else 0.02,
        int(given[2]) if len(given) > 2 else 0,
    )
