"""The tables of docs/palletizers.md: presets with their regions and their corners against ours; models without one.

python -m benchmarks.palletizers
"""

from __future__ import annotations

import math

import numpy as np

import pinbound as pb
from pinbound.robot.presets import Model, models


def row(model: Model) -> str:
    """Return one line of a table."""
    facts = model.facts
    head = f"| {model.manufacturer} {model.model} | {facts['parallelograms'] or '?'} | {facts['third_axis']} "
    head += f"| {model.confidence} |"
    if model.name is None:
        return head
    robot = pb.load(model.name)
    region = pb.feasible_region(robot, ("J2", "J3"))
    ranged = {"J2", "J3"} <= set(model.facts["ranges_deg"])
    area = f"{math.degrees(math.degrees(region.area)):.1f}" if ranged else "ranges not known"
    edges = np.concatenate([np.linspace(edge.start, edge.end, 2001) for edge in region.edges])
    inner = np.radians(np.stack(np.meshgrid(np.arange(-180, 181), np.arange(-210, 181)), axis=-1).reshape(-1, 2))
    points = np.concatenate((edges, inner[region.contains(inner, "region")]))
    zero = np.zeros(len(points))
    reach = (1e3 * robot.positions("flange", np.column_stack((zero, points, zero))))[:, 0].max()
    published = model.facts.get("reach_mm")
    said = f"{reach:.1f} / {published}" if published and ranged else f"- / {published}" if published else "-"
    worst = "-"
    if "corners" in model.facts:
        table = np.array(model.facts["corners"])
        Q = np.column_stack((np.zeros(len(table)), np.radians(table[:, :2]), np.zeros(len(table))))
        off = np.abs(1e3 * robot.positions("flange", Q)[:, [0, 2]] - table[:, 2:]).max()
        worst = f"{off:.2f} ({len(table)} corners)"
    rules = "; ".join(dict.fromkeys(one["basis"] for one in model.facts["rules"])) or "none found"
    return f"{head} `{model.name.removeprefix('palletizers/')}` | {rules} | {area} | {said} | {worst} |"


def main() -> None:
    """Print the tables."""
    head = "| maker and model | rods | third axis | confidence |"
    print(f"{head} preset `palletizers/` | rule | region [deg^2] ", end="")
    print("| reach of the region / published [mm] | worst corner [mm] |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    print("\n".join(row(model) for model in models() if model.name is not None))
    print(f"\n{head}\n| --- | --- | --- | --- |")
    print("\n".join(row(model) for model in models() if model.name is None))


if __name__ == "__main__":
    main()
