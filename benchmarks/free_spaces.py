"""What free_volume, certified_polytope and certified_cover reach on the UR5 and the Panda, against seconds.

    python benchmarks/free_spaces.py volumes
    python benchmarks/free_spaces.py atlas panda.urdf --pairs pairs.json --seconds 120
    python benchmarks/free_spaces.py polytope panda.urdf --pairs pairs.json --seconds 20 60
    python benchmarks/free_spaces.py polytope panda.urdf --pairs pairs.json --seeds 10 --keep . --iris iris.json
    python benchmarks/free_spaces.py samples panda.urdf --pairs pairs.json --keep . --samples 10000000
    python benchmarks/free_spaces.py cover panda.urdf --pairs pairs.json --all --share 0.55 --queries 1000
    python benchmarks/free_spaces.py pictures --out FOLDER

Without a robot it is the UR5 of example-robot-data with spheres around each body's box (`certify_robots.py`); give a
spherized URDF and its pairs for the Panda of VAMP. Every polytope is sampled, every plan certified again. Seconds of
the processor are beside those of the wall, which other processes share.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import pinbound as pb
from benchmarks.certify_robots import CASES, annotate, cover
from benchmarks.spheres import spheres_of

HOME = (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785)
SAMPLES = 1_000_000


class Clock:
    """Seconds since it was made, of the wall and of the processor."""

    def __init__(self) -> None:
        """Start."""
        self.wall, self.own = time.perf_counter(), time.process_time()

    def __str__(self) -> str:
        """Return both."""
        return f"{time.process_time() - self.own:.1f} s of processor, {time.perf_counter() - self.wall:.1f} s of wall"


def ur5(folder: Path) -> pb.Robot:
    """Return the UR5 with spheres around its bodies."""
    case = CASES[0]
    bare = pb.load(case.urdf)
    return pb.load(case.urdf, annotations=annotate(bare, case, cover(bare.model, case), folder))


def robots(options: argparse.Namespace, folder: Path) -> dict[str, pb.Robot]:
    """Return the robots that were asked for."""
    found = {} if options.robot else {"UR5": ur5(folder)}
    if options.robot:
        found["Panda"] = spheres_of(options.robot, options.pairs, list(HOME), folder)
    return found


def volumes(options: argparse.Namespace, folder: Path) -> int:
    """Decide three coordinates to 99 %; 1 if free boxes hold a sample in contact."""
    wrong = 0
    for name, robot in robots(options, folder).items():
        for first in (1, 2, 3):
            names, clock = robot.coordinates[first : first + 3], Clock()
            window = {one: (-np.pi, np.pi) for one in robot.coordinates if name == "UR5"}
            found = pb.free_volume(robot, names, budget=pb.Budget(10**9, options.seconds[-1]), window=window)
            wrong += not all_free(robot, found)
            said = f"{name}, {len(robot.boundaries)} pairs, {', '.join(names)}: {100 * found.decided:.2f} % decided, "
            print(f"{said}{found.boxes / 1e6:.2f} million boxes, {clock}", flush=True)
    return int(wrong > 0)


def atlases(options: argparse.Namespace, folder: Path) -> int:
    """Make a pair atlas for some seconds, save it, load it; 1 if a sample contradicts what it says."""
    wrong = 0
    for name, robot in {
        **robots(options, folder),
        **({} if options.robot else {"MinervaBotV3": pb.load("minervabot_v3")}),
    }.items():
        window = {one: (-np.pi, np.pi) for one in robot.coordinates if name == "UR5"}
        clock = Clock()
        atlas = pb.pair_atlas(robot, budget=pb.Budget(10**10, options.seconds[-1]), window=window)
        print(f"{name}: {atlas!r}; {atlas.work / 1e6:.2f} million boxes, {clock}", flush=True)
        for group in atlas.groups:
            if len(group.columns) > 1:
                print(f"    {group!r}, {len(group.boxes(pb.Where.FREE))} boxes free")
        path, clock = atlas.save(folder / "atlas.npz"), Clock()
        loaded = pb.load_atlas(robot, path)
        print(f"    {path.stat().st_size / 1e6:.3f} MB, loaded in {clock}")
        low, high = ends_of(robot)
        Q = np.random.default_rng(0).uniform(low, high, (min(options.samples, 200_000), len(low)))
        clock = Clock()
        where = loaded.where(Q)
        print(f"    where of {len(Q)}: {clock}")
        clock = Clock()
        free = robot.boundaries.free(Q)
        print(f"    robot.boundaries.free: {clock}")
        each, signed = loaded.pairs_where(Q), robot.boundaries.signed_clearances(Q)
        bad = int(np.count_nonzero((each > 0) & (signed <= 0.0)) + np.count_nonzero((each < 0) & (signed > 0.0)))
        bad += int(np.count_nonzero((where > 0) & ~free) + np.count_nonzero((where < 0) & free))
        shares = [100.0 * float(np.mean(where == one)) for one in (1, -1, 0)]
        print(
            "    samples {:.1f} % FREE, {:.1f} % CONTACT, {:.1f} % UNDECIDED".format(*shares) + f", {bad} wrong",
            flush=True,
        )
        wrong += bad
    return int(wrong > 0)


def all_free(robot: pb.Robot, found: pb.FreeVolume) -> bool:
    """Return whether 100,000 samples of the free boxes are free."""
    rng, axes = np.random.default_rng(0), [robot.coordinates.index(name) for name in found.coordinates]
    if not len(found.free):
        return True
    boxes = found.free[rng.integers(0, len(found.free), 100_000)]
    Q = np.tile(found.at, (len(boxes), 1))
    Q[:, axes] = boxes[:, 0] + rng.uniform(size=(len(boxes), len(axes))) * (boxes[:, 1] - boxes[:, 0])
    return bool(np.all(robot.boundaries.free(Q)))


def polytope(options: argparse.Namespace, folder: Path) -> int:
    """Grow a polytope around home and other free seeds for some seconds; 1 if a sample inside is in contact."""
    wrong, rng = 0, np.random.default_rng(1)
    for name, robot in robots(options, folder).items():
        Q = rng.uniform(robot.lower, robot.upper, (SAMPLES, len(robot.coordinates)))
        seeds = np.vstack([robot.home[None], Q[robot.boundaries.free(Q[:200]).nonzero()[0]]])[: options.seeds]
        (options.out / f"{name}_seeds.json").write_text(json.dumps(seeds.tolist()))
        theirs = json.loads(options.iris.read_text()) if options.iris else []
        for number, q in enumerate(seeds):
            for seconds in options.seconds:
                clock = Clock()
                found = pb.certified_polytope(robot, q, budget=pb.Budget(10**10, seconds))
                said = f"{name}, seed {number}, {seconds:g} s: {found.verdict.value}, {len(found.faces)} faces"
                print(f"{said}, {found.boxes / 1e6:.1f} million boxes, {clock}", flush=True)
                if found.verdict is not pb.Verdict.CERTIFIED:
                    continue
                if options.keep:
                    np.savez(options.keep / f"{name}_{number}_{seconds:g}.npz", A=found.A, b=found.b, q=found.q)
                share = float(np.mean(found.contains(Q)))
                contacts, count = sampled(robot, (found.A, found.b, found.q), options.samples, rng)
                wrong += contacts
                print(
                    f"    {100 * share:.3g} % of the box; {contacts} of {count} samples inside in contact", flush=True
                )
            if number < len(theirs) and theirs[number]["A"]:
                A, b = np.array(theirs[number]["A"]), np.array(theirs[number]["b"])
                share = float(np.mean(np.all(Q @ A.T <= b, axis=1)))
                contacts, count = sampled(robot, (A, b, q), options.samples, rng)
                said = f"{100 * share:.3g} % of the box, {100 * contacts / count:.2f} % of it in contact"
                print(f"    IrisZo: {said}, {theirs[number]['seconds'][0]:.1f} s of processor", flush=True)
    return int(wrong > 0)


def samples(options: argparse.Namespace, folder: Path) -> int:
    """Take samples inside polytopes that `--keep` kept, and inside IrisZo's beside them; 1 if one of ours touches."""
    wrong, total, rng, clock = 0, 0, np.random.default_rng(3), Clock()
    theirs = json.loads(options.iris.read_text()) if options.iris else []
    for name, robot in robots(options, folder).items():
        Q = rng.uniform(robot.lower, robot.upper, (SAMPLES, len(robot.coordinates)))
        paths = options.keep.glob(f"{name}_*.npz")
        for path in sorted(paths, key=lambda one: int(one.stem.split("_")[1])):
            kept, number = np.load(path), int(path.stem.split("_")[1])
            contacts, count = sampled(robot, (kept["A"], kept["b"], kept["q"]), options.samples, rng)
            wrong, total = wrong + contacts, total + count
            share = np.mean(np.all(Q @ kept["A"].T <= kept["b"], axis=1))
            said = f"{path.name}: {100 * share:.1f} % of the box, {contacts} of {count} samples inside in contact"
            if number < len(theirs) and theirs[number]["A"]:
                A, b = np.array(theirs[number]["A"]), np.array(theirs[number]["b"])
                other = np.mean(np.all(Q @ A.T <= b, axis=1))
                touching, of = sampled(robot, (A, b, kept["q"]), SAMPLES, rng)
                said += f"; IrisZo {100 * other:.1f} %, {len(b)} faces, {100 * touching / of:.2f} % of it in contact"
                said += f", {theirs[number]['seconds'][0]:.1f} s: ratio {share / other:.2f}"
            print(said, flush=True)
    print(f"{wrong} of {total} samples inside in contact; {clock}", flush=True)
    return int(wrong > 0)


def sampled(robot: pb.Robot, one: tuple[np.ndarray, ...], most: int, rng: Any) -> tuple[int, int]:
    """Return how many of so many samples inside `{A q <= b}` around q are in contact.

    By a walk of 2000 at once: of each chord through the polytope 32 places are taken, and one of them to go on from.
    """
    A, b, q = one
    at, contacts, count = np.tile(q, (2000, 1)), 0, 0
    while count < most:
        ways = rng.normal(size=at.shape)
        along, room = ways @ A.T, b - at @ A.T
        with np.errstate(divide="ignore", invalid="ignore"):
            times = room / along
        first = np.max(np.where(along < 0.0, times, -np.inf), axis=1)
        last = np.min(np.where(along > 0.0, times, np.inf), axis=1)
        part = 1e-12 + (1.0 - 2e-12) * rng.uniform(size=(32, len(at)))  # the ends are rounded
        Q = at + (first + part * (last - first))[:, :, None] * ways
        contacts += int(np.count_nonzero(~robot.boundaries.free(Q.reshape(-1, len(q)))))
        count += part.size
        at = Q[0]
    return contacts, count


def covers(options: argparse.Namespace, folder: Path) -> int:
    """Cover free space, save, load, and plan between random free configurations; 1 if a plan does not hold."""
    wrong = 0
    for name, robot in robots(options, folder).items():
        names, clock = None if options.all else robot.coordinates[1:4], Clock()
        window = {one: (-np.pi, np.pi) for one in robot.coordinates if name == "UR5"}
        budget = pb.Budget(10**10, options.seconds[-1])
        made = pb.certified_cover(robot, names, share=options.share, budget=budget, window=window)
        print(f"{name}: {made!r}; {clock}", flush=True)
        path = made.save(folder / "cover.npz")
        found = pb.load_cover(robot, path)
        rng, axes = np.random.default_rng(2), list(found.axes)
        Q = np.tile(robot.home, (40 * options.queries, 1))
        Q[:, axes] = rng.uniform(*(np.array(ends)[axes] for ends in ends_of(robot)), (len(Q), len(axes)))
        Q = Q[robot.boundaries.free(Q)]
        held = float(np.mean(found.contains(Q[:20_000])))
        size = f"{path.stat().st_size / 1e6:.2f} MB"
        print(f"    {size}; {100 * held:.1f} % of other free samples are in its sets", flush=True)
        Q = Q[: 2 * options.queries]
        verdicts, seconds, clock = dict[str, int](), list[float](), Clock()
        for start, goal in zip(Q[::2], Q[1::2], strict=True):
            one = Clock()
            way = pb.plan(robot, start, goal, cover=found, budget=pb.Budget(10**8, options.each))
            seconds.append(time.process_time() - one.own)
            key = f"{way.verdict.value} {way.found_by}".rstrip()
            verdicts[key] = verdicts.get(key, 0) + 1
            if way.verdict is pb.Verdict.CERTIFIED:
                wrong += pb.certify(robot, way.waypoints).verdict is not pb.Verdict.CERTIFIED
                wrong += not np.all(robot.boundaries.free(between(way.waypoints)))
        spread = ", ".join(f"{100 * share:g} %: {np.quantile(seconds, share):.2f} s" for share in (0.5, 0.9, 0.99, 1.0))
        print(f"    {len(Q) // 2} plans: {verdicts}, {wrong} not certified again; of processor {spread}; {clock}")
    return int(wrong > 0)


def between(waypoints: np.ndarray) -> np.ndarray:
    """Return configurations every 0.01 rad of a motion."""
    parts = [
        a + np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(b - a) / 0.01))[:, None] * (b - a)
        for a, b in pairwise(waypoints)
    ]
    return np.concatenate(parts)


def ends_of(robot: pb.Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return ends of all coordinates, a turn where there is no limit."""
    return np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)


def pictures(options: argparse.Namespace, folder: Path) -> int:
    """Draw a slice, a projection and a volume."""
    from pinbound.figures.canvas import save
    from pinbound.figures.free_figure import draw_free

    for name, robot in robots(options, folder).items():
        window = {one: (-np.pi, np.pi) for one in robot.coordinates if name == "UR5"}
        two, three, budget = robot.coordinates[1:3], robot.coordinates[1:4], pb.Budget(10**9, options.seconds[-1])
        found = {
            "slice": pb.free_volume(robot, two, budget=budget, window=window, decided=0.995),
            "projection": pb.free_projection(robot, two, budget=budget, window=window, decided=0.97),
            "volume": pb.free_volume(robot, three, budget=budget, window=window, decided=0.97),
        }
        for kind, one in found.items():
            save(draw_free(robot, one), options.out / f"{name}_{kind}")
            print(f"{name}, {kind}: {100 * one.decided:.1f} % decided, {one.seconds:.1f} s", flush=True)
    return 0


def main() -> int:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    runs = {
        "volumes": volumes,
        "atlas": atlases,
        "polytope": polytope,
        "samples": samples,
        "cover": covers,
        "pictures": pictures,
    }
    parser.add_argument("run", choices=list(runs))
    parser.add_argument("robot", type=Path, nargs="?")
    parser.add_argument("--pairs", type=Path)
    parser.add_argument("--seconds", type=float, nargs="+", default=[10.0])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--share", type=float, default=0.9)
    parser.add_argument("--samples", type=int, default=SAMPLES, help="inside each polytope")
    parser.add_argument("--keep", type=Path, help="a folder where polytopes are written")
    parser.add_argument("--iris", type=Path, help="what benchmarks/iris_zo.py wrote, for the same seeds")
    parser.add_argument("--all", action="store_true", help="cover all coordinates, by polytopes")
    parser.add_argument("--each", type=float, default=1.0, help="seconds that a plan may take")
    parser.add_argument("--queries", type=int, default=100)
    parser.add_argument("--out", type=Path, default=Path())
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        return runs[options.run](options, Path(folder))


if __name__ == "__main__":
    sys.exit(main())
