"""Measure everything in one run and write docs/performance.md with its table and plots: `python -m benchmarks.report`.

Ratios, not times, are what holds on another machine: all peers are run in turn, again and again, and each ratio is the
median over repetitions of one repetition's quotient. Machines are shared; that is why.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import importlib.metadata
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402

from benchmarks import casadi_drake, peers, robots  # noqa: E402

ROOT = Path(__file__).parents[1]
N = 90_000
PEERS = (
    ("placements", "Pinocchio placements, Python loop", peers.placements_loop, 300),
    ("parallel", "`pin.computeCollisionsInParallel` (yes or no)", peers.collisions_in_parallel, 2000),
    ("distances", "`pin.computeDistances`, read", peers.compute_distances, 300),
    ("coal", "`coal.distance`, pair by pair", peers.coal_pair_by_pair, 300),
    ("pairs", "NumPy, pair by pair (reference interpreter)", peers.pair_by_pair, 20_000),
)
DRAKE = (
    ("drake", "Drake, `CheckConfigsCollisionFree` (yes or no)", casadi_drake.drake_checker, 2000),
    ("drake distances", "Drake, signed distances, Python loop", casadi_drake.drake_distances, 300),
)
OPTIONAL = {
    "casadi": (
        "CasADi",
        "gets the same ten expressions, with common parts found once, and works on NumPy's memory without a copy.",
    ),
    "drake": (
        "Drake",
        "gets the same joints, and spheres of 1 um at the marked points. Its checker filters pairs of bodies, not of\n"
        "spheres, and gives a yes or no.",
    ),
}
INSTALLED = {name for name, module in (("casadi", "casadi"), ("drake", "pydrake")) if casadi_drake.has(module)}


def configurations(robot: Any, count: int) -> Any:
    return np.random.default_rng(0).uniform(-2 * np.pi, 2 * np.pi, (count, len(robot.coordinates)))


def ratio(times: dict[str, Any], name: str, unit: str) -> float:
    """The median of the quotients, repetition by repetition."""
    return float(np.median(times[name] / times[unit]))


def minervabot(repetitions: int) -> tuple[list[str], dict[str, Any]]:
    robot = robots.minervabot()
    Q = configurations(robot, N)
    calls: dict[str, Any] = {name: (call, N) for name, call in peers.hand_written(robot, Q).items()}
    calls = {f"c {name}": value for name, value in calls.items()}
    for mode in ("norms", "clearances", "smallest", "least", "gradients"):
        calls[mode] = (peers.kernel(robot, Q, mode), N)
    calls["norms, float32"] = (peers.kernel(robot, Q, dtype=np.float32), N)
    calls["norms, NumPy"] = (peers.kernel(robot, Q, backend="numpy"), N)
    if "casadi" in INSTALLED:
        calls |= {f"casadi, {name}": (call, N) for name, call in casadi_drake.casadi_norms(robot, Q).items()}
    others = PEERS + (DRAKE if "drake" in INSTALLED else ())
    for key, _, peer, rows in others:
        calls[key] = (peer(robot, Q[:rows]), rows)
    times = peers.interleaved(calls, repetitions)
    unit = "c norms" if "c norms" in times else "norms"
    labels = {
        "c norms": "hand-written C, ten norms: the limit",
        "c least": "hand-written C, smallest norm",
        "norms": "**pinbound, ten norms**",
        "clearances": "pinbound, ten clearances",
        "smallest": "pinbound, smallest clearance and its boundary",
        "least": "pinbound, smallest clearance (and `free`)",
        "gradients": "pinbound, ten gradients",
        "norms, float32": "pinbound, ten norms, float32",
        "norms, NumPy": "pinbound, ten norms, NumPy alone",
        "casadi, generated C": "CasADi, ten norms mapped over the rows, generated C",
        "casadi, virtual machine": "the same, CasADi's virtual machine",
        **{key: label for key, label, _, _ in others},
    }
    rows = [
        f"| {labels[k]} | {np.median(t):,.1f} | {t.min():,.1f} "
        f"| {ratio(times, k, unit):,.2f} | {ratio(times, k, 'norms'):,.2f} |"
        for k, t in times.items()
    ]
    return rows, times


def panda(repetitions: int, folder: Path) -> tuple[list[str], dict[str, Any], int]:
    robot, pair = robots.panda(folder), robots.panda(folder, ("panda_link3", "panda_hand"))
    Q = configurations(robot, 20_000)
    Q90 = configurations(robot, N)
    start = time.perf_counter()
    robot.boundaries.kernel.prepare("least")
    calls = {
        "pair": (peers.kernel(pair, Q90), N),
        "pair, NumPy": (peers.kernel(pair, Q90, backend="numpy"), N),
        "least": (peers.kernel(robot, Q, "least"), len(Q)),
        "smallest": (peers.kernel(robot, Q, "smallest"), len(Q)),
        "least, float32": (peers.kernel(robot, Q, "least", dtype=np.float32), len(Q)),
        "parallel": (peers.collisions_in_parallel(robot, Q[:500]), 500),
    }
    if "drake" in INSTALLED:
        calls["drake"] = (casadi_drake.drake_collisions(robot, Q[:500]), 500)
    times = peers.interleaved(calls, repetitions)
    print("panda prepared and measured in", round(time.perf_counter() - start), "s", file=sys.stderr)
    labels = {
        "pair": "one pair, link 3 to hand, norm",
        "pair, NumPy": "the same, NumPy alone",
        "least": "smallest clearance of all pairs",
        "smallest": "smallest clearance and its pair",
        "least, float32": "smallest clearance, float32",
        "parallel": "`pin.computeCollisionsInParallel`, same spheres and pairs (yes or no)",
        "drake": "Drake, `HasCollisions`, same spheres and pairs, Python loop (yes or no)",
    }
    rows = [
        f"| {labels[k]} | {np.median(t):,.1f} | {t.min():,.1f} | {ratio(times, k, 'least'):,.2f} |"
        for k, t in times.items()
    ]
    return rows, times, len(robot.boundaries)


def threads(repetitions: int) -> float:
    robot = robots.minervabot()
    Q = configurations(robot, 2_000_000)
    calls = {str(k): (peers.kernel(robot, Q, threads=k), len(Q)) for k in (1, 2)}
    times = peers.interleaved(calls, repetitions, wall=True)
    return float(np.median(times["1"] / times["2"]))


def single(repetitions: int = 20) -> float:
    robot = robots.minervabot()
    q, B = configurations(robot, 1)[0], robot.boundaries
    B.norms(q)
    best = []
    for _ in range(repetitions):
        start = time.process_time()
        for _ in range(1000):
            B.norms(q)
        best.append((time.process_time() - start) * 1e3)
    return float(np.median(best))


def startup(repetitions: int) -> dict[str, dict[str, np.ndarray]]:
    """Seconds of wall and of processor time of fresh processes, interleaved, by name and repetition."""
    first = "import numpy as np, pinbound as pb\nB = pb.load('minervabot_v3').boundaries\nQ = np.ones((1000, 3))\n"
    programs = {
        "pinocchio": "import pinocchio",
        "pinbound": "import pinbound",
        "numpy": first + "B.norms(Q, backend='numpy')",
        "cached": first + "B.norms(Q, backend='compiled')",
    }
    wall: dict[str, list[float]] = {name: [] for name in programs}
    processor: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(repetitions + 1):
        for name, code in programs.items():
            before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
            subprocess.run([sys.executable, "-c", code], check=True)
            wall[name].append(time.perf_counter() - start)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            processor[name].append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    clocks = {"wall": wall, "processor": processor}
    return {clock: {name: np.array(t[1:]) for name, t in times.items()} for clock, times in clocks.items()}


def curves(folder: Path, picture: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    robot = robots.minervabot()
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.2), constrained_layout=True)
    counts = [10**k for k in range(1, 7)]
    names = (
        ("compiled", "compiled (Numba)", "#0072B2", "o", 10**7),
        ("numpy", "NumPy alone", "#E69F00", "s", 10**7),
        ("parallel", "pin.computeCollisionsInParallel", "#009E73", "^", 10**4),
        ("placements", "Pinocchio placements, Python loop", "#D55E00", "v", 10**3),
    )
    for key, label, colour, marker, most in names:
        xs = [n for n in counts if n <= most]
        ys = []
        for n in xs:
            Q = configurations(robot, n)
            call = {
                "compiled": lambda Q=Q: peers.kernel(robot, Q),
                "numpy": lambda Q=Q: peers.kernel(robot, Q, backend="numpy"),
                "parallel": lambda Q=Q: peers.collisions_in_parallel(robot, Q),
                "placements": lambda Q=Q: peers.placements_loop(robot, Q),
            }[key]()
            ys.append(float(np.median(peers.interleaved({"x": (call, n)}, 7)["x"])))
        left.loglog(xs, ys, color=colour, marker=marker, label=label)
    left.set(
        xlabel="configurations N in one call",
        ylabel="time for one configuration [ns]",
        title="Ten norms of MinervaBotV3",
    )
    left.legend(fontsize=8)
    big = robots.panda(folder)
    Q = configurations(big, 20_000)
    sizes = [1, 3, 10, 30, 100, len(big.boundaries)]
    for mode, label, colour, marker in (
        ("norms", "all norms", "#0072B2", "o"),
        ("least", "smallest clearance only", "#CC79A7", "D"),
    ):
        ys = []
        for size in sizes:
            part = _first(big, size)
            ys.append(float(np.median(peers.interleaved({"x": (peers.kernel(part, Q, mode), len(Q))}, 7)["x"])))
        right.loglog(sizes, ys, color=colour, marker=marker, label=label)
    right.set(
        xlabel="boundaries m (sphere pairs of the Panda)",
        ylabel="time for one configuration [ns]",
        title="Panda, compiled, N = 20,000",
    )
    right.legend(fontsize=8)
    for axes in (left, right):
        axes.grid(True, which="both", alpha=0.25)
    figure.savefig(picture, dpi=150)


class _first:
    """The first boundaries of a robot, spread over its pairs."""

    def __init__(self, robot: Any, size: int) -> None:
        from pinbound.boundaries.boundary_set import BoundarySet

        order = np.random.default_rng(1).permutation(len(robot.boundaries))[:size]
        chosen = [robot.boundaries[int(k)] for k in sorted(order)]
        self.coordinates = robot.coordinates
        self.boundaries = BoundarySet(
            chosen, robot.coordinates, robot.linear_limits, robot.home, robot.boundaries._common
        )


def cpu() -> str:
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.is_file() else []
    name = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())
    wide = any(line.startswith("flags") and "avx512f" in line for line in lines)
    return f"{name}, {'AVX-512' if wide else 'no AVX-512'}, {os.cpu_count()} cores"


def remember(ratios: dict[str, float]) -> None:
    """Add one line to the history: ratios hold on other machines, and show a loss from one release to the next."""
    path, today = Path(__file__).with_name("history.csv"), datetime.datetime.now(tz=datetime.timezone.utc).date()
    with path.open("a", newline="") as file:
        writer = csv.writer(file)
        for label, value in ratios.items():
            writer.writerow([importlib.metadata.version("pinbound"), today, cpu(), label, f"{value:.3g}"])


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=31)
    parser.add_argument("--out", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows, times = minervabot(options.repetitions)
        panda_rows, panda_times, pairs = panda(options.repetitions, folder)
        two, one, start = threads(9), single(), startup(15)
        curves(folder, options.out / "performance.png")
        _, again = minervabot(options.repetitions)
    versions = {p: importlib.metadata.version(p) for p in ("numpy", "numba", "pin", *sorted(INSTALLED))}
    more = {
        f"{name}_{clock}": float(np.median(times["cached"] - times[name]))
        for clock, times in start.items()
        for name in ("pinbound", "numpy")
    }
    unit = "c norms" if "c norms" in times else "norms"
    key = [
        ("ten norms / hand-written C", "norms", unit),
        ("NumPy alone / hand-written C", "norms, NumPy", unit),
        ("`computeCollisionsInParallel` / ten norms", "parallel", "norms"),
        ("placements loop / ten norms", "placements", "norms"),
        *(
            [("CasADi's generated C / ten norms", "casadi, generated C", "norms")]
            if "casadi, generated C" in times
            else []
        ),
        *([("Drake's checker / ten norms", "drake", "norms")] if "drake" in times else []),
        ("smallest clearance only / ten norms", "least", "norms"),
        ("smallest clearance and its boundary / ten norms", "smallest", "norms"),
    ]
    repeated = [f"| {label} | {ratio(times, a, b):,.2f} | {ratio(again, a, b):,.2f} |" for label, a, b in key]
    page = PAGE.format(
        cpu=cpu(),
        load=os.getloadavg()[0],
        cores=os.cpu_count(),
        date=datetime.datetime.now(tz=datetime.timezone.utc).date(),
        versions=", ".join(f"{k} {v}" for k, v in versions.items()),
        repetitions=options.repetitions,
        rows="\n".join(rows),
        repeated="\n".join(repeated),
        panda_rows="\n".join(panda_rows),
        pairs=pairs,
        panda=np.median(panda_times["least"]),
        factor=ratio(panda_times, "parallel", "least"),
        two=two,
        one=one,
        imports=ratio(start["processor"], "pinbound", "pinocchio"),
        notes="\n".join(
            f"{label} {note if name in INSTALLED else 'was not installed.'}" for name, (label, note) in OPTIONAL.items()
        ),
        **more,
    )
    (options.out / "performance.md").write_text(page)
    remember({label: ratio(times, a, b) for label, a, b in key})
    print(page)


PAGE = """\
# Performance

Written by `python -m benchmarks.report` on {date}: {cpu}; {versions}.
One thread unless said. All rows of a table were run in turn, {repetitions} times over; a ratio is the median of the
quotients of single repetitions. Times are processor time; the load was {load:.1f} on {cores} cores at the
end of the run. Others' work shares caches and memory: trust the ratios more than the times.
`docs/kernel.md` says how the kernel works and how exact it is.

## MinervaBotV3, ten boundaries, N = 90,000 (fewer for slow peers)

| method | median [ns a configuration] | least [ns] | / hand-written C | / ten norms |
| --- | ---: | ---: | ---: | ---: |
{rows}

{notes}
What the hand-written C, CasADi and Drake return is compared with pinbound's before they are timed.

The key ratios, measured again at the end of the run:

| ratio | first | again |
| --- | ---: | ---: |
{repeated}

## Panda

One pair of spheres, and all {pairs} pairs of the 26 spheres of `panda_collision` on links that are neither the same nor
neighbours and that do not overlap at home; exact signed clearances in float64.

| method | median [ns a configuration] | least [ns] | / smallest clearance |
| --- | ---: | ---: | ---: |
{panda_rows}

{panda:.0f} ns for the smallest clearance of {pairs} pairs, {factor:.0f} times faster than Pinocchio's C++ batch on
the same spheres. For comparison, measured elsewhere on such a machine and not in this run: VAMP's hand-vectorised
float32 check of a Panda of 59 spheres takes 85 ns for a yes or no. It has more spheres, and stops at the first contact.

## A whole robot, and what the default call does

The Panda's 59 spheres and 690 pairs of the VAMP planner, one thread, on a machine without AVX-512, beside others' work:
`free` takes 0.20 of the time that one expression a pair takes, and 1.16 to 1.20 of C written as VAMP works; `smallest`,
exact in float64, 0.32. The default call runs compiled from the third call on where code is kept (1.00 to 1.05 of
`backend="compiled"`), and its first call in a cold process takes NumPy's time. `docs/kernel.md` has the tables, the
commands and the proofs;
`benchmarks/history.csv` keeps the key ratios, one line each a release.

## Other figures

| what | value |
| --- | ---: |
| two threads against one, ten norms, N = 2,000,000, wall time (needs two idle cores) | {two:.2f} times faster |
| one single q, `B.norms(q)` | {one:.1f} us |
| `import pinbound` / `import pinocchio` | {imports:.2f} |
| first compiled call of a process, cached code, more than `import pinbound`, wall time | {pinbound_wall:.2f} s |
| the same, processor time | {pinbound_processor:.2f} s |
| the same, more than with `backend="numpy"`, wall time | {numpy_wall:.2f} s |
| the same, processor time | {numpy_processor:.2f} s |

The process of the last four rows loads MinervaBotV3 and takes its ten norms for 1,000 configurations. What it needs
beyond the import is mostly the reading of the robot and the reduction of its paths, which NumPy needs too.

![Time for one configuration against N, and against the number of boundaries](performance.png)
"""


if __name__ == "__main__":
    main()
