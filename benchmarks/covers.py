"""Covers of public robots' meshes: triangles, marks, vertices, excess, time; and every triangle proven to be held.

    python -m benchmarks.covers --only panda,ur5 --accuracy 0.002 --most 24
    nice python -m benchmarks.covers --all --accuracy 0.02 --seconds 7200 --out covers-all.md

Each robot's meshes are covered as `pinbound mark` covers them, and the proof is then made anew from the marks alone, by
`robot.coverage`'s own code. `--all` takes every URDF of example-robot-data, and those of the folders that are given; a
URDF with the same mesh files as one before is named with it, and not covered again. What cannot be loaded, and meshes
that cannot be read, are named with their reason. Robots with the smallest files come first. With `--out` each row is
written when it is there, and robots that the file has already are left out: a run that was ended goes on. A robot that
starts after the seconds are spent is left out, and named. Exit code 1 if a triangle is not proven to lie in the marks.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path

import pinbound as pb
from pinbound.coverage.bodies import Body, read_bodies
from pinbound.coverage.covers import BY, By, covers
from pinbound.coverage.mesh_proof import prove
from pinbound.exceptions import Problems

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = SHARE / "example-robot-data" / "robots"
NAMES = {
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "z1": "z1_description/urdf/z1.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
    "talos": "talos_data/robots/talos_full_v2.urdf",
}
HEADS = ("robot", "links with meshes", "triangles", "proven", "marks", "vertices of marks", "largest excess [mm]")
HEADS += ("links above the accuracy", "CPU [s]", "wall [s]")


@dataclass
class Row:
    """What was found of one robot."""

    name: str
    links: int
    triangles: int
    held: int
    marks: int
    vertices: int
    excess: float
    wide: int
    cpu: float
    wall: float


def every_urdf(folders: list[Path]) -> dict[str, Path]:
    """Return all URDFs of example-robot-data and of other folders, by name."""
    found = {path.stem: path for path in sorted(ROBOTS.rglob("*.urdf"))}
    for folder in folders:
        found |= {path.stem: path for path in sorted(folder.rglob("*.urdf"))}
    return found


def mesh_bodies(path: Path) -> tuple[pb.Robot, list[Body]]:
    """Return a robot, and its bodies that are meshes."""
    robot = pb.load(path, package_dirs=[SHARE, path.parent.parent, path.parent.parent.parent])
    return robot, [body for body in read_bodies(robot.document, Problems("")).bodies if body.shape == "mesh"]


def measured(name: str, path: Path, accuracy: float, by: By, most: int | None) -> Row:
    """Cover one robot's meshes, and prove it again."""
    robot, bodies = mesh_bodies(path)
    missing = [body.name for body in bodies if robot.meshes.fault(body)]
    if missing:
        print(f"{name}: not read: {', '.join(missing)}", flush=True)
    bodies = [body for body in bodies if not robot.meshes.fault(body)]
    cpu, wall = time.process_time(), time.perf_counter()
    found = covers(bodies, accuracy, by, robot.meshes, most)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    meshes = [robot.meshes.of(one.bodies[0]) for one in found]
    return Row(
        name,
        len({one.link for one in found}),
        sum(len(mesh.triangles) for mesh in meshes),
        sum(prove(mesh, one.marks).held for mesh, one in zip(meshes, found, strict=True)),
        sum(len(one.marks) for one in found),
        sum(len(mark.shape.vertices) for one in found for mark in one.marks),
        max((one.excess for one in found), default=0.0),
        len({one.link for one in found if one.excess > accuracy}),
        cpu,
        wall,
    )


def table(rows: list[Row]) -> str:
    """Return the rows as Markdown."""
    lines = ["| " + " | ".join(HEADS) + " |", "| --- |" + " ---: |" * (len(HEADS) - 1)]
    for row in rows:
        cells = (row.name, row.links, f"{row.triangles:,}", f"{row.held:,}", row.marks, f"{row.vertices:,}")
        cells += (f"{1e3 * row.excess:.2f}", row.wide, f"{row.cpu:.1f}", f"{row.wall:.1f}")
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines) + "\n"


def size_of(path: Path) -> int:
    """Return the bytes of a robot's mesh files, each once; 0 if it cannot be loaded."""
    try:
        robot, bodies = mesh_bodies(path)
    except pb.PinboundError:
        return 0
    files: set[Path] = set()
    for body in bodies:
        try:
            files.add(robot.meshes.path(body))
        except pb.PinboundError:
            continue  # a mesh that is not there is named when its robot's turn comes
    return sum(file.stat().st_size for file in files)


def same_meshes(path: Path, seen: dict[tuple[object, ...], str], name: str) -> str:
    """Return why a robot is not covered: it cannot be loaded, has no meshes, or those of one before; else nothing."""
    try:
        _, bodies = mesh_bodies(path)
    except pb.PinboundError as error:
        return " ".join(str(error).split())[:160]
    if not bodies:
        return "no mesh among its bodies"
    key = tuple(sorted((body.filename, body.scale) for body in bodies))
    first = seen.setdefault(key, name)
    return "" if first == name else f"the meshes of {first}"


def main() -> int:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--accuracy", type=float, default=0.002, help="[m]")
    parser.add_argument("--by", choices=BY[:-1], default="hulls")
    parser.add_argument("--most", type=int, help="marks of a link; default: as `pinbound mark`")
    parser.add_argument("--seconds", type=float, default=300.0, help="after these no robot is started")
    parser.add_argument("--only", default="", help="robots, separated by commas")
    parser.add_argument("--all", nargs="*", type=Path, help="every URDF, those of these folders, too")
    parser.add_argument("--out", type=Path, help="where each row is written when it is there")
    options = parser.parse_args()
    paths = {name: ROBOTS / place for name, place in NAMES.items()}
    if options.all is not None:
        paths = every_urdf(options.all)
        paths = {name: paths[name] for name in sorted(paths, key=lambda name: size_of(paths[name]))}
    chosen = [one for one in options.only.split(",") if one] or list(paths)
    had = options.out.read_text() if options.out is not None and options.out.exists() else ""
    rows: list[Row] = []
    seen: dict[tuple[object, ...], str] = {}
    start = time.perf_counter()

    def say(line: str) -> None:
        print(line, flush=True)
        if options.out is not None:
            with options.out.open("a") as stream:
                stream.write(line + "\n")

    if options.out is not None and not had:
        say("\n".join(table([]).splitlines()))
    for name in chosen:
        why = same_meshes(paths[name], seen, name) if options.all is not None else ""
        if f"| {name} |" in had or f"{name}: " in had:
            continue
        if why:
            say(f"{name}: {why}")
        elif time.perf_counter() - start > options.seconds:
            print(f"{name}: left out, for the time is spent", flush=True)
        else:
            rows.append(measured(name, paths[name], options.accuracy, options.by, options.most))
            say(table(rows[-1:]).splitlines()[-1])
    print(table(rows))
    return int(any(row.held < row.triangles for row in rows))


if __name__ == "__main__":
    sys.exit(main())
