"""Marks over meshes against the raw meshes: does a configuration that is clear for the marks of two links ever touch?

    python -m benchmarks.mesh_crosscheck --only panda,allegro --samples 1000000 --folder campaign
    python -m benchmarks.mesh_crosscheck --only panda --samples 40000 --folder broken --shrink 1    # must find misses

Each robot gets the marks that `pinbound mark` proposes, proven covers of its meshes among them. They are kept in the
folder, with a hash of the code that proposed them; the log names them by a hash of their file. Pinocchio places the
raw bodies, coal says which pairs of links touch: meshes as its own loader reads them, pairs of bodies that its own tree
of boxes leaves. A miss can only be where coal says contact. So pinbound is asked there alone: no boundary between the
two links in contact is a miss.

Half of the configurations are random within all limits. The others are near contact, watched pair by watched pair:
between a configuration in contact and one that is free for that pair, the contact is bisected, of the marks and of the
raw bodies in turn. Its two ends are taken, and 18 configurations drawn about it. Their spread is normal in every
coordinate, with a deviation between 1e-5 and 0.03 rad (or m), uniform in its logarithm. A needless refusal is coal's
distance of the bodies of a pair where its marks have just met.

Each block of 20,000 configurations has random numbers of its own and is a line of `log.jsonl` in the folder: a run that
was ended goes on. Exit code 1 if there is a miss.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import numpy as np

import pinbound as pb
from pinbound.annotations import Box, Hull, Mark
from pinbound.coverage.covers import parts_allowed
from pinbound.crosscheck.inside import Insides
from pinbound.crosscheck.raw import RawBodies
from pinbound.marking.candidates import draw

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = SHARE / "example-robot-data" / "robots"
NAMES = {
    "panda": "panda_description/urdf/panda.urdf",
    "allegro": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "talos": "talos_data/robots/talos_full_v2.urdf",
}
PROPOSERS = ("annotations", "coverage", "geometry", "marking", "meshes", "model", "path", "robot")
AROUND = 20  # configurations about one contact
SPREAD = (-5.0, -1.5)  # powers of ten [rad or m]
BLOCK = 20_000
HALVINGS = 24
FIRST, WALKERS, STEPS = 20_000, 256, 40  # of the search for contacts
KEPT = 50  # configurations in contact that are kept, a pair
NEARNESS = (1e-4, 1e-3, 1e-2)  # metres
COAL = 1e-9  # metres: what coal's yes or no is asked for; a contact that is clear by less is coal's rounding, or ours


def code_hash() -> str:
    """Return a hash of the code that proposes marks."""
    found = hashlib.sha256()
    for room in PROPOSERS:
        for file in sorted((Path(pb.__file__).parent / room).rglob("*.py")):
            found.update(file.read_bytes())
    return found.hexdigest()[:12]


def proposed(name: str, accuracy: float, most: int, folder: Path) -> tuple[Path, dict[str, Any]]:
    """Return the sidecar of a robot's proposed marks, and what is known of it; made where it is not kept."""
    stem = folder / f"{name}-{1e3 * accuracy:g}mm-{most}-{code_hash()}"
    sidecar, known = stem.with_suffix(".yaml"), stem.with_suffix(".json")
    if not known.exists():
        start = time.process_time()
        found = pb.propose_marks(pb.load(ROBOTS / NAMES[name], package_dirs=[SHARE]), accuracy=accuracy, most=most)
        found.annotations.save(sidecar)
        excess: dict[str, float] = {}
        for one in found.covers:
            excess[one.link] = max(one.excess, excess.get(one.link, 0.0))
        facts = {"excess": excess, "notes": found.notes, "uncovered": [body.name for body in found.uncovered]}
        known.write_text(json.dumps(facts | {"seconds": time.process_time() - start}))
    return sidecar, json.loads(known.read_text())


def shrunk(mark: Mark, by: float) -> Mark:
    """Return a hull or box whose corners are nearer to its middle by a length [m]; other marks as they are."""
    if isinstance(mark, Hull):
        corners = np.array(mark.vertices)
        away = corners - corners.mean(axis=0)
        smaller = corners - by * away / np.linalg.norm(away, axis=1, keepdims=True)
        return replace(mark, vertices=tuple(map(tuple, smaller.tolist())))
    if isinstance(mark, Box):
        return replace(mark, size=tuple(max(0.0, edge - 2.0 * by) for edge in mark.size))
    return mark


class Compared:
    """A robot with its proposed marks, and coal on its raw bodies."""

    def __init__(self, name: str, accuracy: float, most: int, folder: Path, shrink: float) -> None:
        """Load the robot; `shrink` [m] breaks its marks after they were proven."""
        sidecar, self.facts = proposed(name, accuracy, most, folder)
        content = hashlib.sha256(sidecar.read_bytes()).hexdigest()[:12]
        self.name = name
        self.robot = pb.load(ROBOTS / NAMES[name], package_dirs=[SHARE], annotations=sidecar)
        pairs = self.robot.coverage.pairs
        self.pairs, self.links = len(pairs), [pair.links for pair in pairs if pair.status.value == "watched"]
        if shrink:
            marks = self.robot.annotations
            small = {key: shrunk(mark, shrink) for key, mark in marks.marks.items()}
            broken = sidecar.with_name(f"broken-{sidecar.name}")
            replace(marks, marks=small).save(broken)
            self.robot = pb.load(ROBOTS / NAMES[name], package_dirs=[SHARE], annotations=broken)
        of: dict[frozenset[str], list[str]] = {}
        for one in self.robot.boundaries:
            of.setdefault(frozenset((one.point_a.link, one.point_b.link)), []).append(one.name)
        self.sets = [self.robot.boundaries.select(of[frozenset(pair)]) for pair in self.links]
        self.raw = RawBodies(self.robot, self.links)
        self.places = list(self.raw.places.values())
        self.insides = Insides(self.raw.engine)
        self.key = {"robot": name, "shrink": shrink, "marks": content}

    def least(self, pair: int, Q: np.ndarray) -> np.ndarray:
        """Return the smallest signed clearance of a pair of links (N,)."""
        return np.asarray(self.sets[pair].smallest(Q, backend="compiled").clearance)

    def touches(self, pair: int, q: np.ndarray) -> bool:
        """Return whether the raw bodies of a pair of links touch."""
        return any(self.raw.engine.collides(q, place) for place in self.places[pair])

    def gap(self, pair: int, q: np.ndarray) -> float:
        """Return coal's distance of the raw bodies of a pair of links [m], zero if they touch."""
        if self.touches(pair, q):
            return 0.0
        return max(0.0, min(self.raw.engine.distance(q, place) for place in self.places[pair]))

    def is_inside(self, pair: int, q: np.ndarray) -> bool:
        """Return whether one body of a pair that does not touch is wholly inside another's mesh."""
        return any(flags.any() for place in self.places[pair] for flags in self.insides.of_pair(place, q[None]))


@dataclass
class Contacts:
    """Configurations in contact of one pair of links, for the raw bodies and for the marks."""

    raw: np.ndarray
    marks: np.ndarray


def contacts_of(one: Compared, seed: int) -> list[Contacts]:
    """Return configurations in contact, pair by pair: drawn at random, or found by walking to smaller clearances."""
    rng = np.random.default_rng([seed, zlib.crc32(one.name.encode()), 0])
    Q = draw(one.robot, FIRST, rng)
    hits, found = one.raw.collisions(Q), list[Contacts]()
    for pair in range(len(one.links)):
        raw = Q[np.flatnonzero(hits[:, pair])[:KEPT]]
        marks = raw[one.least(pair, raw) <= 0.0] if len(raw) else raw
        if len(raw) < KEPT // 5:
            marks = np.concatenate((marks, walked(one, pair, Q, rng)))[:KEPT]
            raw = np.concatenate((raw, [q for q in marks if one.touches(pair, q)] or raw[:0]))[:KEPT]
        found.append(Contacts(raw, marks))
    return found


def walked(one: Compared, pair: int, Q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return configurations (k, n) in contact for the marks of a pair, found by random steps downhill."""
    clear = one.least(pair, Q)
    best = np.argsort(clear)[:WALKERS]
    at, value = Q[best], clear[best]
    for step in np.geomspace(0.5, 0.005, STEPS):
        tries = at + step * rng.normal(size=at.shape) * (rng.random(at.shape) < 0.5)
        inside = one.robot.intervals.hold(tries)
        tries = np.where(inside[:, None], tries, at)
        clear = one.least(pair, tries)
        at, value = np.where((clear < value)[:, None], tries, at), np.minimum(clear, value)
    return at[value <= 0.0]


def places_near(
    one: Compared, known: list[Contacts], jobs: Iterable[tuple[int, bool]], Q: np.ndarray, hits: np.ndarray, rng: Any
) -> list[tuple[int, bool, np.ndarray, np.ndarray]]:
    """Return pair, whether of the marks, and the last free and the first touching configuration, by bisection."""
    lanes: dict[tuple[int, bool], int] = {}
    for job in jobs:
        lanes[job] = lanes.get(job, 0) + 1
    found: list[tuple[int, bool, np.ndarray, np.ndarray]] = []
    for (pair, of_marks), count in lanes.items():
        ends = known[pair].marks if of_marks else known[pair].raw
        rows = rng.permutation(len(Q))[:64]
        rows = rows[one.least(pair, Q[rows]) > 0.0 if of_marks else ~hits[rows, pair]]
        if not len(ends) or not len(rows):
            continue
        low, high = Q[rows[rng.integers(len(rows), size=count)]], ends[rng.integers(len(ends), size=count)]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            touching = one.least(pair, middle) <= 0.0 if of_marks else np.array([one.touches(pair, q) for q in middle])
            low = np.where(touching[:, None], low, middle)
            high = np.where(touching[:, None], middle, high)
        found += [(pair, of_marks, first, second) for first, second in zip(low, high, strict=True)]
    return found


def block(one: Compared, known: list[Contacts], seed: int, index: int) -> dict[str, Any]:
    """Compare one block of configurations, and return what was seen."""
    start = time.process_time()
    rng = np.random.default_rng([seed, zlib.crc32(one.name.encode()), index + 1])
    Q = draw(one.robot, BLOCK // 2, rng)
    random_hits = one.raw.collisions(Q)
    met = [pair for pair, ends in enumerate(known) if len(ends.raw) or len(ends.marks)]
    count = BLOCK // 2 // AROUND if met else 0
    turns = [divmod(index * count + place, len(met)) for place in range(count)]
    places = places_near(one, known, [(met[k], turn % 2 == 0) for turn, k in turns], Q, random_hits, rng)
    close, of = around(one, places, rng)
    hits = np.concatenate((random_hits, one.raw.collisions(close)))
    Q = np.concatenate((Q, close))
    misses: list[dict[str, Any]] = []
    for pair in np.flatnonzero(hits.any(axis=0)).tolist():
        rows = np.flatnonzero(hits[:, pair])
        clear = one.least(pair, Q[rows])
        for row, value in zip(rows[~(clear <= 0.0)].tolist(), clear[~(clear <= 0.0)].tolist(), strict=True):
            depth = max(one.raw.engine.depth(Q[row], place) for place in one.places[pair])
            misses.append({"links": one.links[pair], "clearance": value, "depth": depth, "q": Q[row].tolist()})
    nearness = np.zeros(len(NEARNESS), dtype=int)
    for pair in np.unique(of).tolist():
        apart = np.abs(one.least(pair, close[of == pair]))
        nearness += [int(np.sum(apart <= limit)) for limit in NEARNESS]
    gaps, inside, worst = refusals(one, places)
    return {
        "configurations": len(Q),
        "near": len(close),
        "nearness": nearness.tolist(),
        "touching": int(np.sum(hits.any(axis=1))),
        "contacts": int(hits.sum()),
        "pairs near": sorted({pair for pair, *_ in places}),
        "misses": len(misses),
        "missed": misses[:20],
        "gaps": gaps,
        "inside": inside,
        "worst": worst,
        "seconds": time.process_time() - start,
    }


def around(
    one: Compared, places: Sequence[tuple[int, bool, np.ndarray, np.ndarray]], rng: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Return configurations (k, n) about bisected contacts, within all limits, and the pair of each (k,)."""
    n = len(one.robot.coordinates)
    rows, of = [np.empty((0, n))], [np.empty(0, dtype=int)]
    for pair, _, low, high in places:
        size = 10.0 ** rng.uniform(*SPREAD, (3 * AROUND, 1))
        tries = np.concatenate(([low, high], 0.5 * (low + high) + size * rng.normal(size=(3 * AROUND, n))))
        kept = tries[one.robot.intervals.hold(tries)][:AROUND]
        rows.append(kept)
        of.append(np.full(len(kept), pair))
    return np.concatenate(rows), np.concatenate(of)


def refusals(
    one: Compared, places: Sequence[tuple[int, bool, np.ndarray, np.ndarray]]
) -> tuple[list[float], list[dict[str, Any]], dict[str, Any]]:
    """Return coal's distances where marks have just met [m], places inside a mesh apart, and the widest."""
    gaps: list[float] = []
    inside: list[dict[str, Any]] = []
    worst: dict[str, Any] = {}
    for pair, of_marks, _, high in places:
        if not of_marks:
            continue
        gap = one.gap(pair, high)
        said = {"links": one.links[pair], "gap": gap, "q": high.tolist()}
        if gap > 0.0 and one.is_inside(pair, high):
            inside.append(said)
            continue
        gaps.append(round(gap, 8))
        if gap > worst.get("gap", -1.0):
            worst = said
    return gaps, inside, worst


def run(one: Compared, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Compare blocks until there are enough or the time is up; return all lines of this robot, older ones too."""
    log = options.folder / "log.jsonl"
    key = one.key | {"seed": options.seed}
    lines = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    lines = [line for line in lines if key.items() <= line.items()]
    have = {line["block"] for line in lines}
    wanted = [index for index in range(-(-options.samples // BLOCK)) if index not in have]
    if not wanted:
        return lines
    start = time.process_time()
    known = contacts_of(one, options.seed)
    found = time.process_time() - start
    for index in wanted:
        if time.process_time() - start > options.seconds:
            break
        line = key | {"block": index, "found in": found} | block(one, known, options.seed, index)
        lines.append(line)
        with log.open("a") as file:
            file.write(json.dumps(line) + "\n")
        for miss in line["missed"]:
            print(f"MISS {miss['links']} clear by {miss['clearance']:.3e} m at {miss['q']}", flush=True)
    return lines


HEADS = ("robot", "pairs of links", "watched", "of them near contact", "marks", "boundaries", "largest excess [mm]")
HEADS += ("configurations", "near contact", "within 1 mm", "in contact", "configurations x pairs", "contacts", "missed")
HEADS += ("clear by rounding",)
HEADS += ("needless refusal, median [mm]", "largest [mm]", "above 4 mm", "measured", "inside a mesh", "CPU [s]")


def rounded(line: dict[str, Any]) -> int:
    """Return how many of a block's misses are clear by no more than coal's tolerance, where all are listed."""
    whole = line["misses"] == len(line["missed"])
    return sum(miss["clearance"] <= COAL for miss in line["missed"]) if whole else 0


def row_of(one: Compared, lines: Sequence[dict[str, Any]]) -> tuple[Any, ...]:
    """Return the row of the table."""

    def total(key: str) -> int:
        return sum(line[key] for line in lines)

    gaps = 1e3 * np.array([gap for line in lines for gap in line["gaps"]] or [np.nan])
    near = {pair for line in lines for pair in line["pairs near"]}
    excess = 1e3 * max(one.facts["excess"].values(), default=0.0)
    counts = (one.pairs, len(one.links), len(near), len(one.robot.annotations.marks), len(one.robot.boundaries))
    cells = (one.name, *counts, f"{excess:.2f}", f"{total('configurations'):,}", f"{total('near'):,}")
    cells += (f"{sum(line['nearness'][1] for line in lines):,}", f"{total('touching'):,}")
    cells += (f"{total('configurations') * len(one.links):,}", f"{total('contacts'):,}")
    rounding = sum(map(rounded, lines))
    cells += (f"{total('misses') - rounding:,}", rounding)
    cells += (f"{np.median(gaps):.2f}", f"{gaps.max():.2f}", int(np.sum(gaps > 4.0)), f"{len(gaps):,}")
    return (*cells, sum(len(line["inside"]) for line in lines), f"{total('seconds'):.0f}")


def table(rows: Sequence[tuple[Any, ...]]) -> str:
    """Return the rows as Markdown."""
    lines = ["| " + " | ".join(HEADS) + " |", "| --- |" + " ---: |" * (len(HEADS) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(map(str, row)) + " |" for row in rows)]) + "\n"


def main() -> int:
    """Run, print the table, and write it into the folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=1_000_000, help="configurations a robot, by blocks of 20,000")
    parser.add_argument("--seconds", type=float, default=3600.0, help="CPU seconds a robot, in this run")
    parser.add_argument("--accuracy", type=float, default=0.002, help="of the marks [m]")
    parser.add_argument("--most", type=int, help="marks of a link that hold its meshes; default: as `pinbound mark`")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default=",".join(NAMES), help="robots, separated by commas")
    parser.add_argument("--shrink", type=float, default=0.0, help="break hulls and boxes by so much [mm]")
    parser.add_argument("--folder", type=Path, default=Path("mesh-crosscheck"))
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    rows: list[tuple[Any, ...]] = []
    missed = 0
    for name in options.only.split(","):
        most = parts_allowed(options.accuracy, options.most)
        one = Compared(name, options.accuracy, most, options.folder, 1e-3 * options.shrink)
        lines = run(one, options)
        missed += sum(line["misses"] - rounded(line) for line in lines)
        rows.append(row_of(one, lines))
        print(table(rows[-1:]), flush=True)
        text = f"# Marks against raw meshes\n\n`python -m benchmarks.mesh_crosscheck {' '.join(sys.argv[1:])}`\n\n"
        (options.folder / f"table-{'-'.join(options.only.split(','))}.md").write_text(text + table(rows))
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
