"""This tree against an older one in one run: import, loading, points and segments in batches, certificates, tests.

    git worktree add /tmp/older c292e71
    python -m benchmarks.against /tmp/older [--repetitions 15] [--tests tests/test_path.py tests/test_univariate.py ...]

Two processes, one a tree, are asked in turn for one job after the other, so that both see the same neighbours. All
times are processor time; a ratio is the median of the quotients of single repetitions, with its quartiles. Of test
files the tests are taken that stand in both trees under one name, and each tree runs its own.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parents[1]

MARKS = ("point", "segment")

WORKER = """
import json, sys, time
import numpy as np
import pinbound as pb
arms = json.loads(sys.stdin.readline())
robots = {name: pb.load(path) for name, path in arms.items()}
robots["minervabot_v3"] = pb.load("minervabot_v3")
draw = np.random.default_rng(0)
Q = {name: draw.uniform(robot.lower, robot.upper, (20_000, len(robot.coordinates))) for name, robot in robots.items()}
def batch(name, mode, backend):
    rows = Q[name] if backend == "compiled" else Q[name][:2_000]
    def job():
        ask = robots[name].boundaries
        if mode == "smallest":
            ask.kernel.smallest(rows, True, None, 1, backend)
        else:
            getattr(ask, mode)(rows, backend=backend)
    return job
jobs = {
    f"{name}, {mode}, {backend}": batch(name, mode, backend)
    for name in robots for mode in ("norms", "gradients", "smallest") for backend in ("compiled", "numpy")
}
for name, path in {**arms, "minervabot_v3": "minervabot_v3"}.items():
    jobs[f"{name}, load"] = lambda path=path: pb.load(path)
    jobs[f"{name}, one q"] = lambda name=name: [robots[name].boundaries.norms(q) for q in Q[name][:300]]
    def certify(name=name):
        for start, end in zip(Q[name][:20], Q[name][20:40]):
            pb.certify(robots[name], [start, start + 0.1 * (end - start)])
    jobs[f"{name}, 20 certificates"] = certify
    def first(path=path, name=name):
        robot = pb.load(path)
        pb.certify(robot, [robot.home, robot.home + 0.05 * (Q[name][0] - robot.home)])
    jobs[f"{name}, load and the first certificate"] = first
print(json.dumps(list(jobs)), flush=True)
for line in sys.stdin:
    start = time.process_time()
    jobs[line.strip()]()
    print(time.process_time() - start, flush=True)
"""


def arm(kind: str) -> str:
    """Return an arm of seven joints whose links carry spheres or capsules."""
    axes = ("0 0 1", "0 1 0", "0 0 1", "0 -1 0", "0 0 1", "0 -1 0", "0 0 -1")
    links = "".join(f'<link name="l{k}"/>' for k in range(8))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0.03 {0.02 * (-1) ** k} 0.3"/><axis xyz="{axis}"/>'
        '<limit lower="-2.8" upper="2.8" effort="1" velocity="1"/></joint>'
        for k, axis in enumerate(axes)
    )
    marks, names = "", []
    for k in range(8):
        if kind == "segment":
            marks += f'<pinbound:segment name="m{k}" link="l{k}" xyz_a="0 0 0.05" xyz_b="0.02 0 0.25" radius="0.03"/>'
            names.append((f"m{k}", k))
            continue
        for i in range(3):
            marks += f'<pinbound:point name="m{k}_{i}" link="l{k}" xyz="0 0 {0.05 + 0.1 * i:.2f}" radius="0.03"/>'
            names.append((f"m{k}_{i}", k))
    pairs = [(a, b) for a, i in names for b, j in names if j > i + 2]
    said = "".join(f'<pinbound:boundary name="{a}_{b}" a="{a}" b="{b}"/>' for a, b in pairs)
    return (
        f'<robot name="{kind}s" xmlns:pinbound="urn:pinbound:1">{links}{joints}'
        f"<pinbound:annotations>{marks}{said}</pinbound:annotations></robot>"
    )


class Tree:
    """One tree, and the process that does its jobs."""

    def __init__(self, root: Path, robots: dict[str, str]) -> None:
        """Start it with the paths of robots by name."""
        self.root = root
        self.environment = {**os.environ, "PYTHONPATH": str(root / "src"), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-W", "ignore", "-c", WORKER]
        self.process = subprocess.Popen(
            command, cwd=root, env=self.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.jobs: list[str] = json.loads(self._ask(json.dumps(robots)))

    def _ask(self, line: str) -> str:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline()

    def time(self, job: str) -> float:
        """Return the seconds of processor time that a job takes."""
        return float(self._ask(job))

    def run(self, *command: str) -> float:
        """Return the seconds of processor time of a process of its own."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(command, cwd=self.root, env=self.environment, capture_output=True, text=True, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            raise SystemExit(done.stdout[-2000:] + done.stderr[-2000:])
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def tests(self, file: str) -> set[str]:
        """Return the tests of a file, by the ends of their names."""
        command = [sys.executable, "-m", "pytest", "-q", "--collect-only", "-p", "no:cacheprovider", file]
        done = subprocess.run(command, cwd=self.root, env=self.environment, capture_output=True, text=True, check=False)
        return {line for line in done.stdout.splitlines() if line.startswith(file + "::")}


def told(name: str, old: list[float], new: list[float]) -> None:
    """Print medians and their ratio."""
    quotients = np.array(new) / np.array(old)
    low, middle, high = np.quantile(quotients, [0.25, 0.5, 0.75])
    print(
        f"{name:52} {np.median(old) * 1e3:10.2f} {np.median(new) * 1e3:10.2f} {middle:6.2f} ({low:.2f} .. {high:.2f})"
    )


def main() -> None:
    """Print a table: the job, the older tree and this one [ms], and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("older", type=Path)
    parser.add_argument("--repetitions", type=int, default=15)
    parser.add_argument("--only", default="", help="jobs whose names hold this text")
    parser.add_argument("--tests", nargs="*", default=[])
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp())
    robots: dict[str, str] = {}
    for kind in MARKS:
        path = folder / f"{kind}s.urdf"
        path.write_text(arm(kind))
        robots[f"{kind}s"] = str(path)
    old, new = (Tree(root.resolve(), robots) for root in (options.older, HERE))
    print(f"{'':52} {'older [ms]':>10} {'this [ms]':>10}  ratio")
    if options.only in "import":
        line = [sys.executable, "-c", "import pinbound"]
        pairs = [(old.run(*line), new.run(*line)) for _ in range(options.repetitions)]
        told("import, a process", [a for a, _ in pairs], [b for _, b in pairs])
    for job in (name for name in new.jobs if name in old.jobs and options.only in name):
        old.time(job), new.time(job)  # what is compiled or kept is not counted
        pairs = [(old.time(job), new.time(job)) for _ in range(options.repetitions)]
        told(job, [a for a, _ in pairs], [b for _, b in pairs])
    for file in options.tests:
        both = sorted(old.tests(file) & new.tests(file))
        line = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *both]
        if both:
            pairs = [(old.run(*line), new.run(*line)) for _ in range(max(1, options.repetitions // 5))]
            told(f"{file}, {len(both)} tests", [a for a, _ in pairs], [b for _, b in pairs])


if __name__ == "__main__":
    main()
