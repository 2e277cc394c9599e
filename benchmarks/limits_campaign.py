"""Limits of random robots of bodies: `BoundarySet.limits` against the interval of every boundary on its own.

    python benchmarks/limits_campaign.py --count 400 --seed 100

Each robot is a random tree of two to four joints: revolute, continuous or prismatic, narrow and wide limits, mimic
joints among them, so that screws and slides of many turns occur. Marks are points, segments, boxes, hulls, lines and
planes. `limits` samples bodies with a proof and isolates few of them (`boundaries/ahead.py`). Here each boundary is
isolated, as `Boundary.span` does it, and all are intersected. Ends must agree to 1e-11, names exactly. Exit code 1 if
they do not.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import pinbound as pb
from pinbound.boundaries.spans import CoordinateLimits, linear_span

HEAD = '<robot name="random" xmlns:pinbound="urn:pinbound:1"><link name="base"/>'
KINDS = ("revolute", "revolute", "continuous", "prismatic")
RANGES = {"revolute": ("-1 1.2", "-3 3", "-6.3 6.3", "-4 1", "-60 80"), "prismatic": ("-0.3 0.4", "-20 30", "0 1")}
AXES = ("1 0 0", "0 1 0", "0 0 1", "0.6 0.8 0")
FACTORS = {"revolute": ("1", "-1", "2", "0.5"), "prismatic": ("0.02", "-0.01", "0.05")}


def vector(rng: Any, size: float) -> str:
    """Return three random numbers."""
    return " ".join(f"{x:.4f}" for x in rng.normal(size=3) * size)


def joint(rng: Any, number: int, links: list[str], leaders: list[str]) -> str:
    """Return a joint and its link."""
    kind, parent = str(rng.choice(KINDS)), links[-1] if rng.random() < 0.8 else str(rng.choice(links))
    mimic = ""
    if leaders and rng.random() < 0.4:
        kind = str(rng.choice(["revolute", "prismatic", "prismatic"]))
        mimic = f'<mimic joint="{rng.choice(leaders)}" multiplier="{rng.choice(FACTORS[kind])}" offset="0.1"/>'
    else:
        leaders.append(f"j{number}")
    text = f'<joint name="j{number}" type="{kind}"><parent link="{parent}"/><child link="l{number}"/>'
    text += f'<origin xyz="{vector(rng, 0.25)}" rpy="{vector(rng, 1.0)}"/><axis xyz="{rng.choice(AXES)}"/>{mimic}'
    if kind != "continuous":
        lower, upper = ("-500 500" if mimic else str(rng.choice(RANGES[kind]))).split()
        text += f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'
    links.append(f"l{number}")
    return f'{text}</joint><link name="l{number}"/>'


def mark(rng: Any, name: str, kind: str, link: str) -> str:
    """Return a mark of one kind."""
    at = f'name="{name}" link="{link}"'
    if kind == "segment":
        return f'<pinbound:segment {at} xyz_a="{vector(rng, 0.2)}" xyz_b="{vector(rng, 0.3)}" radius="0.02"/>'
    if kind == "box":
        size = " ".join(f"{x:.3f}" for x in rng.uniform(0.02, 0.2, 3))
        return f'<pinbound:box {at} xyz="{vector(rng, 0.2)}" rpy="{vector(rng, 1.0)}" size="{size}"/>'
    if kind == "hull":
        return f'<pinbound:hull {at} vertices="{" ".join(vector(rng, 0.15) for _ in range(5))}"/>'
    if kind == "line":
        return f'<pinbound:line {at} xyz="{vector(rng, 0.4)}" direction="{vector(rng, 1.0)}" radius="0.01"/>'
    if kind == "plane":
        return f'<pinbound:plane {at} xyz="{vector(rng, 0.5)}" normal="{vector(rng, 1.0)}"/>'
    return f'<pinbound:point {at} xyz="{vector(rng, 0.2)}" radius="0.03"/>'


def robot(rng: Any) -> str:
    """Return a URDF."""
    links, leaders = ["base"], list[str]()
    joints = "".join(joint(rng, number, links, leaders) for number in range(int(rng.integers(2, 5))))
    kinds = rng.choice(["segment", "box", "hull", "line", "plane", "point"], int(rng.integers(3, 6)))
    found = [(f"m{k}", str(rng.choice(links)), str(kind)) for k, kind in enumerate(kinds)]
    marks = "".join(mark(rng, name, kind, link) for name, link, kind in found)
    pairs = [(a, b) for i, a in enumerate(found) for b in found[i + 1 :] if a[1] != b[1]]
    pairs = [(a, b) for a, b in pairs if not {a[2], b[2]} <= {"line", "plane"}]
    bounds = "".join(f'<pinbound:boundary name="{a[0]}_{b[0]}" a="{a[0]}" b="{b[0]}"/>' for a, b in pairs)
    return f"{HEAD}{joints}<pinbound:annotations>{marks}{bounds}</pinbound:annotations></robot>"


def of_each(loaded: pb.Robot, index: int, q: Any) -> CoordinateLimits:
    """Return the limits of one coordinate, every boundary isolated."""
    name = loaded.coordinates[index]
    spans = [(one.joint, linear_span(one, index, q)) for one in loaded.linear_limits]
    held = [span for _, span in spans if span]
    window = max((span[0] for span in held), default=-np.inf), min((span[1] for span in held), default=np.inf)
    spans += [(one.name, one.span(name, q, window, True)) for one in loaded.boundaries]
    return CoordinateLimits.of(name, float(q[index]), spans, loaded.boundaries.beyond(q))


def agree(found: CoordinateLimits, wanted: CoordinateLimits) -> bool:
    """Return whether two answers say the same."""
    ends = (found.lower, found.upper), (wanted.lower, wanted.upper)
    names = (found.lower_stop, found.upper_stop) == (wanted.lower_stop, wanted.upper_stop)
    return names and bool(np.allclose(*ends, rtol=1e-12, atol=1e-11))


def main() -> None:
    """Print what was compared."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=400, help="random robots")
    parser.add_argument("--seed", type=int, default=0, help="of the first robot")
    options = parser.parse_args()
    robots = asked = wrong = left = refused = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.seed, options.seed + options.count):
            rng, path = np.random.default_rng(seed), Path(folder) / "random.urdf"
            path.write_text(robot(rng))
            try:
                loaded = pb.load(path)
            except pb.PinboundError:  # its home is in contact, or there is nothing to watch
                left += 1
                continue
            robots += 1
            low, high = np.clip(loaded.lower, -4.0, 4.0), np.clip(loaded.upper, -4.0, 4.0)
            for q in [q for q in rng.uniform(low, high, (60, len(low))) if loaded.boundaries.free(q)][:2]:
                for index, name in enumerate(loaded.coordinates):
                    try:
                        wanted = of_each(loaded, index, q)
                    except pb.UnsupportedError:  # a boundary that never repeats, and nothing near
                        refused += 1
                        continue
                    asked += 1
                    found = loaded.boundaries.limits(name, q)
                    if not agree(found, wanted):
                        wrong += 1
                        print(f"WRONG seed {seed}, {name} at {q.tolist()}: {found}, not {wanted}", flush=True)
    print(f"{robots} robots, {asked} limits compared, {wrong} wrong; {left} robots do not load, {refused} refused")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
