"""How `mark` grows with bodies: `python -m benchmarks.mark_scale`, processor time, one process a row.

A hall of arms of six revolute joints each, on a square grid. Each arm has six moving links and a base, with spheres on
all of them, at places as a link's are. Arms at the next places of the grid can meet, all others cannot.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SIZES = ((4, 9), (8, 9), (16, 9), (32, 9), (286, 1))
"""Arms, and bodies a link."""
AXES = "0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"
STEPS = 0.2, 0.15, 0.3, 0.15, 0.15, 0.1


def hall(arms: int, bodies: int, apart: float, folder: Path) -> Path:
    """Write a robot of so many arms, `apart` from each other [m]."""
    rng = np.random.default_rng(0)
    text = [f'<robot name="hall{arms}">', '<link name="floor"/>']
    side = int(np.ceil(np.sqrt(arms)))
    for arm in range(arms):
        text.append(_link(f"a{arm}_0", bodies, 0.2, rng))
        xyz = f"{apart * (arm % side)} {apart * (arm // side)} 0"
        text.append(f'<joint name="a{arm}_fixed" type="fixed"><parent link="floor"/><child link="a{arm}_0"/>')
        text.append(f'<origin xyz="{xyz}"/></joint>')
        for i, (axis, step) in enumerate(zip(AXES, STEPS, strict=True)):
            text.append(_link(f"a{arm}_{i + 1}", bodies, (*STEPS[1:], 0.1)[i], rng))
            text.append(f'<joint name="a{arm}_q{i}" type="revolute"><parent link="a{arm}_{i}"/>')
            text.append(f'<child link="a{arm}_{i + 1}"/><origin xyz="0 0 {step}"/><axis xyz="{axis}"/>')
            text.append('<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>')
    text.append("</robot>")
    urdf = folder / "hall.urdf"
    urdf.write_text("\n".join(text), encoding="utf-8")
    return urdf


def _link(name: str, bodies: int, length: float, rng: np.random.Generator) -> str:
    """A link, spheres along it."""
    parts = [f'<link name="{name}">']
    for height in np.linspace(0.0, length, bodies + 2)[1:-1]:
        x, y = rng.uniform(-0.01, 0.01, 2).tolist()
        parts.append(
            f'<collision><origin xyz="{x} {y} {height}"/><geometry><sphere radius="0.04"/></geometry></collision>'
        )
    return "".join([*parts, "</link>"])


def one(arms: int, bodies: int, apart: float) -> dict[str, float]:
    """Measure one size in this process."""
    import pinbound as pb
    from pinbound.marking import propose_marks

    with tempfile.TemporaryDirectory() as name:
        robot = pb.load(hall(arms, bodies, apart, Path(name)))
    start = time.process_time()
    found = propose_marks(robot)
    counts: dict[str, int] = {}
    for (_, _, reason), count in found.left_out.items():
        counts[reason] = counts.get(reason, 0) + count
    return {
        "seconds": time.process_time() - start,
        "watched": len(found.annotations.boundaries),
        "left out": counts,
        "MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main() -> None:
    """Measure every size, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", type=int, nargs=2)
    parser.add_argument("--apart", type=float, default=2.5, help="of two arms [m]")
    parser.add_argument("--sizes", type=int, nargs="*", default=[])
    options = parser.parse_args()
    if options.one:
        print(json.dumps(one(*options.one, options.apart)))
        return
    sizes = list(zip(options.sizes[::2], options.sizes[1::2], strict=True)) or SIZES
    print("| bodies | links | pairs of bodies | watched | `mark` [s] | memory [MB] |\n|" + " ---: |" * 6)
    for arms, bodies in sizes:
        command = [sys.executable, "-m", "benchmarks.mark_scale", "--one", str(arms), str(bodies)]
        command += ["--apart", str(options.apart)]
        found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        n = 7 * arms * bodies
        row = f"{n:,}", f"{7 * arms + 1:,}", f"{n * (n - 1) // 2:,}", f"{found['watched']:,}"
        print(f"| {' | '.join(row)} | {found['seconds']:.1f} | {found['MB']:.0f} |", flush=True)
        print(found["left out"], file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
