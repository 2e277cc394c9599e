"""Decide slices of two coordinates, beside codac's interval paving: share decided against seconds.

    python -m benchmarks.codac_planar write planar.json   # with pinbound: pinbound's figures, and the cases
    python benchmarks/codac_planar.py pave planar.json          # with codac: the same sets, paved

A case is a box of two coordinates, and pairs `|r(q)| > T` whose r is written out in sines and cosines, the others held:
what pinbound reduces a pair to before it bounds it, so that codac gets short expressions. codac halves down to a width;
several are tried, the share that lies neither inside nor outside is what is not decided.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

SHARES = (0.9, 0.99, 0.999)
WIDTHS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)


def written(robot: Any, names: tuple[str, ...]) -> dict[str, Any]:
    """Return one case: its box, and components of each r as text, with its threshold."""
    import sympy as sp

    from pinbound.path.restriction import restrict

    axes = [robot.coordinates.index(name) for name in names]
    q = sp.symbols("q0 q1")
    pairs: list[dict[str, Any]] = []
    for one in robot.boundaries:
        chain = restrict(one.path.minimal, robot.home, axes)
        r = sp.Matrix(chain.offsets[-1])
        for i in reversed(range(chain.rotations)):
            u, phi = sp.Matrix(chain.axes[i]), sum(float(c) * x for c, x in zip(chain.coefficients[i], q, strict=True))
            r = u * u.dot(r) + sp.cos(phi) * (r - u * u.dot(r)) + sp.sin(phi) * u.cross(r) + sp.Matrix(chain.offsets[i])
        r = [rounded(sp.expand(x)) for x in r]
        pairs.append({"r": [str(x) for x in r if x != 0], "threshold": float(one.rule.placed_distance)})
    low, high = np.maximum(robot.lower[axes], -np.pi), np.minimum(robot.upper[axes], np.pi)
    return {"box": [low.tolist(), high.tolist()], "pairs": pairs}


def rounded(x: Any) -> Any:
    """Return an expression without terms below 1e-13: they cost codac time, and change nothing that is compared."""
    import sympy as sp

    terms = [term for term in sp.Add.make_args(x) if abs(term.as_coeff_Mul()[0]) > 1e-13]
    return sp.Add(*terms)


def write(options: argparse.Namespace) -> int:
    """Print pinbound's figures, and write the cases."""
    import pinbound as pb
    from benchmarks.free_spaces import ur5

    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        arm = ur5(Path(folder))
    minerva = pb.load("minervabot_v3")
    held = [pb.BoundaryMark(f"{b.name}_mm", b.point_a.name, b.point_b.name, 1e-3) for b in minerva.boundaries]
    margin = minerva.with_annotations(pb.Annotations.of([], held))
    names = [b.name for b in margin.boundaries if b.name.endswith("_mm")]
    cases = [
        ("MinervaBotV3, 1 mm", margin, ("q2", "q3"), names),
        ("UR5", arm, ("shoulder_lift_joint", "elbow_joint"), None),
        ("UR5", arm, ("elbow_joint", "wrist_1_joint"), None),
        ("UR5", arm, ("wrist_1_joint", "wrist_2_joint"), None),
    ]
    for said, robot, two, some in cases:
        window = {one: (-np.pi, np.pi) for one in robot.coordinates if said == "UR5"}
        label = f"{said}, {two[0]}, {two[1]}"
        for share in SHARES:
            best = np.inf
            for _ in range(3 if share < 0.995 else 1):
                start = time.process_time()
                one = pb.free_volume(robot, two, None, some, pb.Budget(10**9, 60.0), window, decided=share)
                best = min(best, time.process_time() - start)
            print(f"{label}: {100 * one.decided:.3f} %, {best:.3f} s, {len(one.free)} free boxes", flush=True)
        picked = robot if some is None else Selected(robot, some)
        found[label] = written(picked, two)
    options.file.write_text(json.dumps(found))
    return 0


class Selected:
    """Some boundaries of a robot."""

    def __init__(self, robot: Any, names: list[str]) -> None:
        """Hold them."""
        self.coordinates, self.home, self.lower, self.upper = robot.coordinates, robot.home, robot.lower, robot.upper
        self.boundaries = robot.boundaries.select(names)


def pave(options: argparse.Namespace) -> int:
    """Pave with codac, and print what it decides."""
    import codac

    for label, case in json.loads(options.file.read_text()).items():
        q = codac.VectorVar(2)
        space = {"q0": q[0], "q1": q[1], "cos": codac.cos, "sin": codac.sin, "__builtins__": {}}
        whole = codac.IntervalVector([list(ends) for ends in zip(*case["box"], strict=True)])
        start = time.process_time()
        separators: list[Any] = []
        for pair in case["pairs"]:
            parts = [codac.sqr(eval(text, space)) for text in pair["r"] if "q" in text]  # of our own making
            rest = sum(float(text) ** 2 for text in pair["r"] if "q" not in text)
            if not parts:
                continue
            square = parts[0]
            for part in parts[1:]:
                square = square + part
            room = codac.Interval(pair["threshold"] ** 2 - rest, float("inf"))
            separators.append(codac.SepInverse(codac.AnalyticFunction([q], square), room))
        both = separators[0]
        for one in separators[1:]:
            both = both & one
        print(f"{label}: {len(separators)} separators made in {time.process_time() - start:.2f} s")
        for width in WIDTHS:
            start = time.process_time()
            found = codac.pave(whole, both, width)
            seconds = time.process_time() - start
            open_ = sum(box.volume() for box in found.boxes(codac.PavingInOut.bound))
            share = 1.0 - open_ / whole.volume()
            print(f"    width {width}: {100 * share:.3f} % decided, {seconds:.3f} s", flush=True)
            if seconds > options.seconds:
                break
    return 0


def main() -> int:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", choices=["write", "pave"])
    parser.add_argument("file", type=Path)
    parser.add_argument("--seconds", type=float, default=10.0, help="a finer width is not tried after so many")
    options = parser.parse_args()
    return write(options) if options.run == "write" else pave(options)


if __name__ == "__main__":
    sys.exit(main())
