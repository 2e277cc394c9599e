"""Damaged mesh files: each is read in time, or is one error that names it; what is lost is never lost without a word.

    python benchmarks/fuzz_meshes.py --start 0 --stop 10000

Small surfaces are written in ten formats and damaged: cut off, bytes turned over, blocks taken out or doubled, numbers
replaced by what is none or by huge ones, counts raised, archives that unpack to gigabytes, heads that tell of 10^7
triangles. Asked of each file is that reading ends within five seconds, by a mesh or by one `InputError` with a remedy;
that a file which was cut off, or lost bytes, gives all triangles that were written, or is refused, or has a note; and
that the marks over what was read hold it. OBJ and text STL count nothing, so that a text which lost whole polygons is a
whole file and cannot be told: of such files all polygons that they say have to be read, and they are counted apart.
Exit code 1 if something else was seen.
"""

from __future__ import annotations

import argparse
import io
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

import pinbound as pb
from pinbound.coverage.mesh_covers import cover_meshes
from pinbound.meshes import Mesh, read_mesh

SECONDS = 5.0
MEMORY = 3 * 2**30  # bytes of address space
COVERED = 50  # one in so many of the meshes that are read is covered, too
WORDS = (b"nan", b"inf", b"-1", b"1e400", b"99999999999", b"0", b"x", b"1_0", b"", b"-0.0", b"1e30", b"4294967295")


def surfaces() -> list[tuple[np.ndarray, np.ndarray]]:
    """Return vertices and triangles of a tetrahedron, a cube and a ball."""
    rng = np.random.default_rng(7)
    cube = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    ball = rng.normal(size=(30, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    bodies = [np.vstack((np.zeros(3), np.eye(3))), cube, ball.round(4)]
    return [(points, ConvexHull(points).simplices.astype(np.int64)) for points in bodies]


def written(points: np.ndarray, rows: np.ndarray) -> dict[str, bytes]:
    """Return the surface in all formats, by ending; `.txt.stl` and `.asc.ply` are those that are text."""
    mesh = trimesh.Trimesh(points, rows, process=False)
    found: dict[str, bytes] = {}
    for ending, kind, options in (
        (".stl", "stl", {}),
        (".txt.stl", "stl_ascii", {}),
        (".obj", "obj", {}),
        (".ply", "ply", {}),
        (".asc.ply", "ply", {"encoding": "ascii"}),
        (".off", "off", {}),
        (".glb", "glb", {}),
        (".3mf", "3mf", {}),
        (".dae", "dae", {}),
    ):
        try:
            data: Any = mesh.export(file_type=kind, **options)
        except (ImportError, ValueError, KeyError, AttributeError):
            continue  # this trimesh does not write it, or lacks a library for it
        found[ending] = data.encode() if isinstance(data, str) else bytes(data)
    if ".dae" not in found:
        found[".dae"] = dae(points, rows)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.dae", found[".dae"])
    found[".zae"] = stream.getvalue()
    return found


def dae(points: np.ndarray, rows: np.ndarray) -> bytes:
    """Return a COLLADA file of one geometry."""
    numbers = " ".join(f"{x:.9g}" for x in points.ravel())
    indices = " ".join(map(str, rows.ravel().tolist()))
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="pa" count="{points.size}">{numbers}</float_array>
<technique_common><accessor source="#pa" count="{len(points)}" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{len(rows)}"><input semantic="VERTEX" source="#v" offset="0"/><p>{indices}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
""".encode()


def cut_off(data: bytes, rng: np.random.Generator) -> bytes:
    """Return its beginning."""
    return data[: int(rng.integers(0, len(data)))]


def turned_over(data: bytes, rng: np.random.Generator) -> bytes:
    """Return it with some bytes changed."""
    changed = bytearray(data)
    for place in rng.integers(0, len(data), int(rng.integers(1, 16))).tolist():
        changed[place] = int(rng.integers(0, 256))
    return bytes(changed)


def without_block(data: bytes, rng: np.random.Generator) -> bytes:
    """Return it without some of its middle."""
    start, end = np.sort(rng.integers(0, len(data) + 1, 2)).tolist()
    return data[:start] + data[end:]


def doubled(data: bytes, rng: np.random.Generator) -> bytes:
    """Return it with a block said twice."""
    start, end = np.sort(rng.integers(0, len(data) + 1, 2)).tolist()
    return data[:end] + data[start:]


def other_word(data: bytes, rng: np.random.Generator) -> bytes:
    """Return it with one of its words replaced."""
    words = data.split(b" ")
    words[int(rng.integers(0, len(words)))] = WORDS[int(rng.integers(0, len(WORDS)))]
    return b" ".join(words)


def without_line(data: bytes, rng: np.random.Generator) -> bytes:
    """Return it without one line."""
    lines = data.split(b"\n")
    del lines[int(rng.integers(0, len(lines)))]
    return b"\n".join(lines)


def huge_count(data: bytes, rng: np.random.Generator) -> bytes:
    """Return it with a count of its head, or any four bytes, huge."""
    if data[:3] == b"ply" or data[:3].upper() == b"OFF":
        return data.replace(b"face ", b"face 9", 1) if data[:3] == b"ply" else data.replace(b" ", b"0000000 ", 1)
    place = 80 if len(data) > 84 else int(rng.integers(0, max(1, len(data) - 4)))
    return data[:place] + int(rng.integers(2**20, 2**32)).to_bytes(4, "little") + data[place + 4 :]


def junk(data: bytes, rng: np.random.Generator) -> bytes:
    """Return bytes that mean nothing."""
    return rng.bytes(int(rng.integers(1, 400)))


DAMAGES: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    cut_off,
    turned_over,
    without_block,
    doubled,
    other_word,
    without_line,
    huge_count,
    junk,
)
LOSSES = (cut_off, without_block)
"""Of these damages all triangles are there, or the file is refused, or a note says what is not used."""


def bomb(name: str) -> bytes:
    """Return an archive of a few kilobytes that unpacks to a gigabyte."""
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open(name, "w", force_zip64=True) as out,
    ):
        for _ in range(64):
            out.write(bytes(2**24))
    return stream.getvalue()


class Hang(BaseException):
    """Reading did not end in time."""


def on_alarm(*_: object) -> None:
    """End what takes too long."""
    raise Hang


def same(mesh: Mesh, corners: np.ndarray) -> bool:
    """Return whether a mesh has all the triangles (m, 3, 3), to the seven digits of a file."""
    mine = {tuple(sorted(map(tuple, one))) for one in mesh.vertices[mesh.triangles].round(4).tolist()}
    return all(tuple(sorted(map(tuple, one))) in mine for one in corners.round(4).tolist())


def outcome(path: Path, corners: np.ndarray | None, lossy: bool, covered: bool, usual: tuple[str, ...] = ()) -> str:
    """Read one file, and return what came of it; what should not be starts with a capital.

    `usual` are the notes of the file before it was damaged (the unit of a DAE): these say nothing of what is lost.
    """
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        mesh = read_mesh(path)
        if covered and len(mesh.triangles) < 500:
            (cover,) = cover_meshes([("m", "l", mesh)], 0.2 * float(np.ptp(mesh.vertices)) + 1e-3, most=2)
            if not cover.proof.is_complete:
                return "NOT HELD"
    except pb.InputError as error:
        return "refused" if len(error.problems) == 1 and error.problems[0].remedy else "NO REMEDY"
    except pb.UnsupportedError:
        return "too large to be proven"
    except Hang:
        return "HANG"
    except Exception as error:  # what the run is for
        traceback.print_exc()
        return f"CRASH {type(error).__name__}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    if corners is None or not lossy:
        return "read"
    if same(mesh, corners):
        return "read, all of it"
    if set(mesh.notes) - set(usual):
        return "read, and a note says what is not used"
    text = path.read_bytes()
    said = text.count(b"endfacet") if path.suffix == ".stl" else len(re.findall(rb"(?m)^f ", text))
    counts_nothing = path.suffix == ".obj" or (path.suffix == ".stl" and text.startswith(b"solid"))
    return "read, all that a text without counts says" if counts_nothing and len(mesh.triangles) == said else "HOLE"


def asked() -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--stop", type=int, default=10_000)
    parser.add_argument("--only", default="", help="endings, separated by commas; other files are passed over")
    parser.add_argument("--keep", type=Path, help="folder for files that should not be")
    return parser.parse_args()


def main() -> int:
    """Run and count."""
    options = asked()
    warnings.simplefilter("error")  # a warning is no answer
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    signal.signal(signal.SIGALRM, on_alarm)
    bodies = [(points[rows], written(points, rows)) for points, rows in surfaces()]
    notes: dict[tuple[int, str], tuple[str, ...]] = {}
    counts: Counter[tuple[str, str]] = Counter()
    wrong, slowest, start = 0, 0.0, time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        special: list[tuple[str, bytes]] = []
        if options.start == 0:
            special = [("b.3mf", bomb("3D/3dmodel.model")), ("b.zae", bomb("a.dae"))]
            special += [
                ("h.ply", b"ply\nformat ascii 1.0\nelement vertex 30000000\nelement face 10000000\nend_header\n")
            ]
            with (Path(folder) / "t.stl").open("wb") as out:  # 10^7 triangles, all of them zero: a file with a hole
                out.write(bytes(80) + (10**7).to_bytes(4, "little"))
                out.truncate(84 + 50 * 10**7)
            counts["10^7 triangles", outcome(Path(folder) / "t.stl", None, False, False)] += 1
        for number in range(options.start, options.stop):
            rng = np.random.default_rng(number)
            body = int(rng.integers(0, len(bodies)))
            corners, files = bodies[body]
            ending = sorted(files)[int(rng.integers(0, len(files)))]
            damage = DAMAGES[int(rng.integers(0, len(DAMAGES)))]
            if options.only and ending not in options.only.split(","):
                continue
            path = Path(folder) / f"m{ending}"
            if (body, ending) not in notes:
                path.write_bytes(files[ending])
                notes[body, ending] = read_mesh(path).notes
            path.write_bytes(damage(files[ending], rng))
            before = time.process_time()
            found = outcome(path, corners, damage in LOSSES, number % COVERED == 0, notes[body, ending])
            slowest = max(slowest, time.process_time() - before)
            counts[damage.__name__, found] += 1
            if found[0].isupper():
                wrong += 1
                print(f"{number}: {damage.__name__} of {ending}: {found}", flush=True)
                if options.keep is not None:
                    options.keep.mkdir(exist_ok=True)
                    (options.keep / f"{number}{ending}").write_bytes(path.read_bytes())
        for name, data in special:
            (Path(folder) / name).write_bytes(data)
            counts[name, outcome(Path(folder) / name, None, False, False)] += 1
    print("| damage | outcome | files |\n| --- | --- | ---: |")
    for (name, found), count in sorted(counts.items()):
        print(f"| {name.replace('_', ' ')} | {found} | {count:,} |")
    print(f"{options.stop - options.start} files, {time.process_time() - start:.0f} s of CPU, slowest {slowest:.2f} s.")
    print(f"Endings: {', '.join(sorted(bodies[0][1]))}")
    return int(wrong > 0 or any(found[0].isupper() for _, found in counts))


if __name__ == "__main__":
    sys.exit(main())
