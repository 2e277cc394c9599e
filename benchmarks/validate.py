"""Cross-validation against coal: robots x levels, counts and worst cases, as a page.

python benchmarks/validate.py [--samples 2000] [--points 1000000] [--rays 10000] [--folder ../shared/robots]
                              [--out docs/validation.md]
"""

from __future__ import annotations

import argparse
import importlib.metadata
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pinbound as pb
from pinbound.crosscheck import CrossCheck
from pinbound.tolerances import CROSSCHECK_BODY

HEAD = """# Validation against coal

[crosscheck.md](crosscheck.md) explains the levels and the terms. Made by

```sh
{command} --out docs/validation.md
```

The command for MinervaBotV3 alone is `pinbound crosscheck minervabot_v3 --out region.png`. The public robots have the
marks and pairs that `pinbound mark` proposes with the accuracy in the table: capsules, boxes and prisms that fit
their bodies, or spheres. The robots of `tests/segments.py` have segments, sweeps, lines and planes in all kinds of
pairs, also degenerate ones: parallel up to rounding, crossing, without length, along a joint's axis. Seconds are those
of one busy core.

"""


@dataclass(frozen=True)
class Case:
    """A robot, how finely its bodies are covered, and how many samples of the point level it gets."""

    name: str
    path: str | Path
    accuracy: float | None
    points: int
    by: Literal["bodies", "spheres"] = "bodies"


def cases(options: argparse.Namespace) -> Iterator[Case]:
    """Yield the robots that are there."""
    data = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    public = data / "example-robot-data" / "robots"
    few = max(1, options.points // 1000)
    yield Case("minervabot_v3", "minervabot_v3", None, options.points)
    for name, path, coarse in (
        ("panda_collision", public / "panda_description/urdf/panda_collision.urdf", 0.02),
        ("z1", public / "z1_description/urdf/z1.urdf", 0.02),
        ("a1", public / "a1_description/urdf/a1.urdf", 0.05),
        ("fanuc_m410ic_185", options.folder / "fanuc_m410ic_185_botrail/fanuc_m410ic_185_botrail.urdf", 0.2),
    ):
        if path.is_file():
            yield Case(name, path, 0.001, few)
            yield Case(f"{name}, spheres", path, coarse, few, "spheres")


def segments(options: argparse.Namespace, folder: Path) -> Iterator[Case]:
    """Yield the robots of segments, sweeps, lines and planes that the tests use, written to a folder."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    from segments import ROBOTS

    for name, text in ROBOTS.items():
        path = folder / f"{name}.urdf"
        path.write_text(text, encoding="utf-8")
        yield Case(f"segments: {name}", path, None, options.points // (50 if name == "bodies" else 1))


def marked(case: Case, shapes: tuple[str, ...] | None = None) -> tuple[pb.Robot, pb.Proposal | None]:
    """Return a robot with boundaries, and the proposal that they come from."""
    bare = pb.load(case.path)
    if case.accuracy is None:
        return bare, None
    proposal = pb.propose_marks(bare, case.accuracy, *((shapes,) if shapes else ()), by=case.by)
    return pb.load(case.path, annotations=proposal.annotations), proposal


def incomplete_pairs(proposal: pb.Proposal | None) -> set[frozenset[str]]:
    """Return pairs of links of which some marks touch at home, so that not all of their bodies are watched."""
    left_out = proposal.left_out if proposal is not None else {}
    return {frozenset((a, b)) for a, b, reason in left_out if reason.startswith("in contact")}


def mathematics_row(case: Case, robot: pb.Robot, found: CrossCheck, seconds: float) -> str:
    """Return one row of the first table."""
    assert found.points is not None
    assert found.boundaries is not None
    seen = found.boundaries.boundaries.values()
    contacts = sum(one.rays - one.free for one in seen)
    grazing = sum(one.grazing for one in seen)
    return (
        f"| {case.name} | {len(robot.boundaries)} | {found.points.samples:,} | {found.points.worst:.1e} | "
        f"{found.rays:,} | {contacts:,} | {grazing} | {found.boundaries.worst:.1e} | "
        f"{max((one.metres for one in seen), default=0.0):.1e} | {seconds:.0f} |"
    )


def bodies_row(case: Case, found: CrossCheck, proposal: pb.Proposal | None, seconds: float) -> tuple[str, bool]:
    """Return one row of the second table, and whether no pair of links misses."""
    assert found.bodies is not None
    skip = incomplete_pairs(proposal)
    pairs = [pair for pair in found.bodies.pairs if frozenset(pair.links) not in skip]
    others = [pair for pair in found.bodies.pairs if frozenset(pair.links) in skip]
    total = [
        sum(getattr(pair, name) for pair in pairs)
        for name in ("both_clear", "both_contact", "misses", "refusals", "unreachable", "ways")
    ]
    miss = max((pair.miss for pair in pairs), default=0.0)
    refusal = max((pair.refusal for pair in pairs), default=0.0)
    excess = "-" if proposal is None else f"{2e3 * proposal.excess:.1f}"
    accuracy = "-" if case.accuracy is None else f"{1e3 * case.accuracy:.0f}"
    counts = " | ".join(f"{count:,}" for count in total)
    other = ", ".join(f"{' - '.join(pair.links)} ({pair.misses:,})" for pair in others) or "none"
    row = (
        f"| {case.name} | {accuracy} | {len(pairs)} | {found.bodies.samples:,} | {counts} | {1e3 * miss:.4f} | "
        f"{1e3 * refusal:.2f} | {excess} | {other} | {seconds:.0f} |"
    )
    return row, miss <= CROSSCHECK_BODY and not total[2]


def region_lines(found: CrossCheck) -> list[str]:
    """Return what the region level of MinervaBotV3 saw."""
    level = found.region
    assert level is not None
    return [
        "",
        "## Region",
        "",
        f"MinervaBotV3, ({', '.join(level.coordinates)}), coal on all pairs of links with {level.shapes}: "
        f"{level.nodes:,} nodes {level.step:.4f} rad apart, {level.unsafe} of them in the region and not reached by "
        f"coal, {level.refused} reached by coal and not in the region. Coal was stopped at {len(level.contour)} "
        f"places; the furthest lies {level.contour_inside:.1e} rad inside the region's contour, the furthest outside "
        f"{level.contour_outside:.1e} rad. The regions of the other robots are not planar.",
        "",
    ]


def main() -> int:
    """Check all robots, print the tables, and fail if a level that must hold does not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--rays", type=int, default=10_000)
    parser.add_argument("--folder", type=Path, default=Path(__file__).parents[2] / "shared" / "robots")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    mathematics, bodies, region, holds = list[str](), list[str](), list[str](), True
    with tempfile.TemporaryDirectory() as folder:
        for case in segments(options, Path(folder)):
            robot = pb.load(case.path)
            start = time.monotonic()
            found = pb.cross_check(robot, case.points, 2026, ("points", "boundaries"), max(1, options.rays // 10))
            mathematics.append(mathematics_row(case, robot, found, time.monotonic() - start))
            holds &= found.holds
            print(mathematics[-1], flush=True)
    for case in cases(options):
        robot, proposal = marked(case)
        start = time.monotonic()
        solid = any(boundary.path.is_solid for boundary in robot.boundaries)
        rays = max(1, options.rays // 20) if solid else options.rays  # searched limits take a fifth of a second each
        found = pb.cross_check(robot, case.points, 2026, ("points", "boundaries"), rays)
        mathematics.append(mathematics_row(case, robot, found, time.monotonic() - start))
        holds &= found.holds
        print(mathematics[-1], flush=True)
        if case.name == "panda_collision":
            spheres, _ = marked(case, ("sphere",))  # its 26 spheres alone
            start = time.monotonic()
            found = pb.cross_check(spheres, options.points, 2026, ("points", "boundaries"), options.rays)
            only = Case("panda_collision, its 26 spheres", case.path, case.accuracy, options.points)
            mathematics.append(mathematics_row(only, spheres, found, time.monotonic() - start))
            holds &= found.holds
            print(mathematics[-1], flush=True)
        start = time.monotonic()
        found = pb.cross_check(robot, options.samples, 2026, ("bodies", "region"))
        row, no_miss = bodies_row(case, found, proposal, time.monotonic() - start)
        bodies.append(row)
        holds &= no_miss
        print(row, flush=True)
        if found.region is not None:
            region = region_lines(found)
            holds &= found.region.holds
    text = "\n".join(
        [
            "## Points and contacts",
            "",
            "| robot | boundaries | configurations | clearance, worst [m] | rays | contacts | grazing | contact, worst "
            "[rad] | contact, worst [m] | s |",
            "| --- | --: | --: | --: | --: | --: | --: | --: | --: | --: |",
            *mathematics,
            "",
            "## Bodies",
            "",
            "Counts are over pairs of links. Marks that hold the bodies are conservative: no miss is allowed, and the "
            'bodies of a needless refusal may be apart by the sum of two excesses. For the pairs in the column "not '
            'whole", some spheres touch at home or always, and `pinbound mark` leaves them out. These pairs are not '
            "fully watched, and are not in the counts (their misses are in brackets). With marks that fit there are no "
            "such pairs: the bodies that `pinbound mark` then leaves out as touching overlap by design, in every "
            "configuration (panda_link1 and panda_link3; J2_link and J3_link).",
            "",
            "| robot | accuracy [mm] | pairs of links | configurations | both clear | both contact | missed | refused "
            "| unreachable | ways swept | worst miss [mm] | needless refusal [mm] | allowed by the covers [mm] | "
            "not whole | s |",
            "| --- " + "| --: " * 12 + "| --- | --: |",
            *bodies,
            *region,
        ]
    )
    print(text)
    if options.out is not None:
        command = (
            f"python benchmarks/validate.py --samples {options.samples} --points {options.points} --rays {options.rays}"
        )
        options.out.write_text(HEAD.format(command=command) + text, encoding="utf-8")
    return int(not holds)


if __name__ == "__main__":
    sys.exit(main())
