"""Certificates of a whole robot: every pair of the spheres that a URDF gives its links, as motion planners use them.

    python benchmarks/certify_many.py panda_spherized.urdf --pairs pairs.json --home 0 -0.785 0 -2.356 0 1.571 0.785

The URDF's collision bodies are spheres; `--pairs` lists pairs of them by their order in the file, else all pairs of
links that are no neighbours are taken. Timed, as CPU time of the process: straight motions of 1 rad one by one, 1,000
waypoints, 10,000 motions at once by one thread and by two, and the largest box around home. With PYTHONPATH set to
another checkout the same command times that one; `--out` keeps verdicts and bounds, `--compare` reads them.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from itertools import combinations
from pathlib import Path

import numpy as np
from lxml import etree

import pinbound as pb

VERDICTS = tuple(pb.Verdict)


def load(urdf: Path, pairs: Path | None, home: list[float]) -> pb.Robot:
    root = etree.parse(str(urdf)).getroot()
    spheres = [
        (link.get("name"), one.find("origin").get("xyz"), one.find("geometry/sphere").get("radius"))
        for link in root.findall("link")
        for one in link.findall("collision")
    ]
    joints = {frozenset((j.find("parent").get("link"), j.find("child").get("link"))) for j in root.findall("joint")}
    chosen = (
        json.loads(pairs.read_text())
        if pairs
        else [
            (i, j)
            for (i, (a, *_)), (j, (b, *_)) in combinations(enumerate(spheres), 2)
            if a != b and frozenset((a, b)) not in joints
        ]
    )
    moving = [j.get("name") for j in root.findall("joint") if j.get("type") in ("revolute", "continuous", "prismatic")]
    text = [f"home: {{{', '.join(f'{name}: {value}' for name, value in zip(moving, home, strict=False))}}}", "points:"]
    text += [
        f"- {{name: s{i}, link: {link}, xyz: [{', '.join(xyz.split())}], radius: {radius}}}"
        for i, (link, xyz, radius) in enumerate(spheres)
    ]
    text += ["boundaries:", *(f"- {{name: b{i}_{j}, a: s{i}, b: s{j}}}" for i, j in chosen)]
    sidecar = Path(tempfile.mkdtemp()) / "spheres.yaml"
    sidecar.write_text("\n".join(text) + "\n", encoding="utf-8")
    return pb.load(urdf, annotations=sidecar)


def motions(robot: pb.Robot, count: int, length: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return straight motions of one length within the limits, their starts uniform."""
    rng = np.random.default_rng(seed)
    starts = rng.uniform(robot.lower, robot.upper, (8 * count, len(robot.coordinates)))
    steps = rng.normal(size=starts.shape)
    ends = starts + length * steps / np.linalg.norm(steps, axis=1)[:, None]
    kept = np.flatnonzero(np.all((ends >= robot.lower) & (ends <= robot.upper), axis=1))[:count]
    return starts[kept], ends[kept]


def timed(work) -> tuple[float, object]:
    started = time.process_time()
    found = work()
    return time.process_time() - started, found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdf", type=Path)
    parser.add_argument("--pairs", type=Path)
    parser.add_argument("--home", type=float, nargs="*", default=[])
    parser.add_argument("--count", type=int, default=300, help="motions one by one")
    parser.add_argument("--passes", type=int, default=1, help="times that each of them is certified; the least counts")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--compare", type=Path)
    options = parser.parse_args()
    robot = load(options.urdf, options.pairs, options.home)
    print(f"{robot.name}: {len(robot.boundaries)} pairs, {len(robot.coordinates)} coordinates")
    starts, ends = motions(robot, options.count, 1.0, 0)
    pb.certify(robot, np.stack((starts[0], ends[0])))
    least = np.full(len(starts), np.inf)
    for _ in range(options.passes):
        found = [timed(lambda i=i: pb.certify(robot, np.stack((starts[i], ends[i])))) for i in range(len(starts))]
        least = np.minimum(least, [seconds for seconds, _ in found])
    print(f"1 rad, median of {len(found)}: {1e3 * np.median(least):.2f} ms", end="; ")
    print(dict(Counter(one.verdict.value for _, one in found)))
    kept = np.array([[VERDICTS.index(one.verdict), one.lower, one.upper] for _, one in found])
    if options.out:
        np.save(options.out, kept)
    if options.compare:
        before = np.load(options.compare)
        certified = before[:, 0] == 0
        print(f"verdicts that differ: {np.count_nonzero(before[:, 0] != kept[:, 0])}; ", end="")
        print(f"most that a lower bound lost: {np.max((before - kept)[certified, 1]):.1e} m")
    rng = np.random.default_rng(0)
    home = np.array(options.home or robot.home)
    walk = home + np.cumsum(0.02 * rng.normal(size=(1000, len(home))), axis=0)
    walk = np.clip(walk, robot.lower + 1e-3, robot.upper - 1e-3)
    for _ in range(2):
        seconds, one = timed(lambda: pb.certify(robot, walk))
    print(f"1,000 waypoints: {1e3 * seconds:.0f} ms, {one.verdict.value}, {one.boxes:,} boxes")
    if hasattr(pb, "certify_many"):
        starts, ends = motions(robot, 10_000, 1.0, 1)
        for threads in (1, 2):
            began = time.perf_counter()
            seconds, many = timed(lambda threads=threads: pb.certify_many(robot, starts, ends, threads=threads))
            wall = time.perf_counter() - began
            each = f"{1e3 * seconds / len(starts):.3f} ms of CPU, {1e3 * wall / len(starts):.3f} ms of wall time each"
            print(f"{len(starts):,} motions of 1 rad at once, threads={threads}: {each}; {many!r}")
    for _ in range(2):
        seconds, box = timed(lambda: pb.certified_box(robot, home))
    volume = np.prod(box.upper_corner - box.lower_corner)
    print(f"certified_box: {seconds:.2f} s, {box.verdict.value}, {box.boxes:,} boxes, volume {volume:.4g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
