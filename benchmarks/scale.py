"""How load, compile, the first answer and memory grow with joints and boundaries: `python -m benchmarks.scale`.

Each row is a process of its own, with an empty cache of code: a chain of links, joints about x, y and z in turn, and
boundaries between random pairs of its links. Times are processor time; memory is the most that the process has held
until `free` has answered, less what it held after `import pinbound`. The gradients of 5,000 boundaries over 1,000
coordinates are 40 MB a row.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SIZES = ((100, 100), (200, 100), (500, 1), (1000, 1), (8, 1000), (100, 1000), (500, 1000), (1000, 1000), (1000, 5000))
FEW = 64
AXES = "1 0 0", "0 1 0", "0 0 1"


def chain(links: int, boundaries: int, folder: Path) -> tuple[Path, Path]:
    """Write a robot of so many links, its joints turning it along a helix, and a sidecar of its boundaries."""
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    text = [f'<robot name="chain{links}">', f'<link name="l0">{body}</link>']
    for i in range(links):
        text.append(f'<link name="l{i + 1}">{body}</link>')
        text.append(f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>')
        text.append(f'<origin xyz="0.1 0.01 0.05" rpy="0 0 0.1"/><axis xyz="{AXES[i % 3]}"/>')
        text.append('<limit lower="-0.1" upper="0.1" effort="1" velocity="1"/></joint>')
    text.append("</robot>")
    rng = np.random.default_rng(0)
    side = ["points:"]
    places = rng.uniform(-0.01, 0.01, (links + 1, 3)).tolist()
    side += [f"- {{name: p{i}, link: l{i}, xyz: {xyz}, radius: 0.001}}" for i, xyz in enumerate(places)]
    side.append("boundaries:")
    chosen: dict[tuple[int, int], None] = {}
    while len(chosen) < min(boundaries, links * (links - 1) // 2):
        a, b = sorted(rng.integers(0, links + 1, 2).tolist())
        if b - a > 1:
            chosen[a, b] = None
    if len(chosen) < boundaries:  # few links: more points on each
        side = ["points:"]
        for i in range(links + 1):
            for k, xyz in enumerate(rng.uniform(-0.01, 0.01, (16, 3)).tolist()):
                side.append(f"- {{name: p{i}_{k}, link: l{i}, xyz: {xyz}, radius: 0.001}}")
        side.append("boundaries:")
        many: dict[tuple[int, int, int, int], None] = {}
        while len(many) < boundaries:
            a, b = sorted(rng.integers(0, links + 1, 2).tolist())
            if b - a > 1:
                i, j = rng.integers(0, 16, 2).tolist()
                many[a, b, i, j] = None
        side += [f"- {{name: b{a}_{b}_{i}_{j}, a: p{a}_{i}, b: p{b}_{j}}}" for a, b, i, j in many]
    else:
        side += [f"- {{name: b{a}_{b}, a: p{a}, b: p{b}}}" for a, b in chosen]
    urdf, sidecar = folder / "chain.urdf", folder / "marks.yaml"
    urdf.write_text("\n".join(text), encoding="utf-8")
    sidecar.write_text("\n".join(side) + "\n", encoding="utf-8")
    return urdf, sidecar


def resident() -> float:
    """The most that this process has held [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def one(links: int, boundaries: int) -> dict[str, float]:
    """Measure one size in this process."""
    import pinbound as pb

    with tempfile.TemporaryDirectory() as name:
        os.environ["PINBOUND_CACHE_DIR"] = name
        urdf, sidecar = chain(links, boundaries, Path(name))
        held = resident()
        marks = [time.process_time()]

        def step(key: str) -> None:
            marks.append(time.process_time())
            found[key], found[f"{key}, MB"] = marks[-1] - marks[-2], resident() - held

        found: dict[str, float] = {"import, MB": held}
        robot = pb.load(urdf, annotations=sidecar)
        step("load")
        B, home = robot.boundaries, robot.home
        B.signed_clearances(home)
        step("first q")
        if boundaries < FEW:  # one expression a pair, whose length is the path's
            return found
        Q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (256, len(home)))
        B.smallest(Q, backend="compiled")
        step("smallest, first")
        B.smallest(Q, backend="compiled")
        step("smallest, 256 rows again")
        B.free(Q, backend="compiled")
        step("free, first")
        B.gradients(Q[:8], backend="compiled")
        step("gradients, first")
        return found


def main() -> None:
    """Measure every size, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", type=int, nargs=2)
    parser.add_argument("--sizes", type=int, nargs="*", default=[])
    options = parser.parse_args()
    if options.one:
        print(json.dumps(one(*options.one)))
        return
    sizes = list(zip(options.sizes[::2], options.sizes[1::2], strict=True)) or SIZES
    head = ["joints", "boundaries", "load [s]", "first q [s]", "`smallest`, compiled [s]"]
    head += ["a row [us]", "`free`, compiled [s]", "8 gradients, compiled [s]", "memory [MB]"]
    print(f"| {' | '.join(head)} |\n|{' ---: |' * len(head)}")
    for links, boundaries in sizes:
        command = [sys.executable, "-m", "benchmarks.scale", "--one", str(links), str(boundaries)]
        found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        each = 1e6 * found.get("smallest, 256 rows again", np.nan) / 256
        keys = "load", "first q", "smallest, first", "free, first", "gradients, first"
        row = [f"{found[key]:.2f}" if key in found else "" for key in keys]
        row.insert(3, "" if np.isnan(each) else f"{each:.1f}")
        memory = found.get("free, first, MB", found["first q, MB"])
        print(f"| {links:,} | {boundaries:,} | {' | '.join(row)} | {memory:.0f} |", flush=True)
        print({k: round(v, 3) for k, v in found.items()}, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
