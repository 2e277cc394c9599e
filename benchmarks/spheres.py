"""A whole robot as spheres: `python -m benchmarks.spheres ROBOT.urdf --pairs pairs.json` (or without: the Panda's 26).

`free` and `smallest` against the program of one expression a pair, which they replace, and against C written as VAMP
works (`spheres_peer.c`), all in turn, processor time, medians of the ratios of single repetitions. `--check ROWS`
compares `free`, with joint limits and without, with the sign of float64 on so many rows, every second within 1e-6 m
of contact; `--piece 1` takes others, so that a long check can be done in pieces.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import subprocess
import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

import pinbound as pb
from benchmarks import peers, robots
from pinbound.kernel.ball_kernel import BallKernel
from pinbound.kernel.engine import Kernel

SOURCE = Path(__file__).with_name("spheres_peer.c")


def spheres_of(urdf: Path, pairs: Path, home: list[float], folder: Path) -> Any:
    """Every sphere of the collision bodies, in the order of the file; pairs by that order."""
    points: list[dict[str, Any]] = []
    for link in ET.parse(urdf).getroot().iter("link"):
        for body in link.iter("collision"):
            origin, sphere = body.find("origin"), body.find("geometry/sphere")
            if sphere is not None:
                xyz = (origin.get("xyz") if origin is not None else None) or "0 0 0"
                name, at = f"s{len(points)}", [float(x) for x in xyz.split()]
                points.append(
                    {"name": name, "link": link.get("name"), "xyz": at, "radius": float(sphere.get("radius"))}
                )
    chosen = json.loads(pairs.read_text())
    used = {k for pair in chosen for k in pair}
    coordinates = pb.load(urdf).coordinates
    sidecar = {
        "home": dict(zip(coordinates, home, strict=False)),
        "points": [point for k, point in enumerate(points) if k in used],
        "boundaries": [{"name": f"p{a}_{b}", "a": f"s{a}", "b": f"s{b}"} for a, b in chosen],
    }
    path = folder / "spheres.yaml"
    path.write_text(json.dumps(sidecar))
    return pb.load(urdf, annotations=path)


def vamp_like(robot: Any, kernel: BallKernel, folder: Path, Q: Any) -> Any:
    """The C peer as a function of nothing that fills and returns its answer; None without a compiler."""
    found = peers.compiler()
    if found is None:
        return None
    library = folder / "spheres_peer.so"
    flags = ["-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC"]
    subprocess.run([found, *flags, "-o", str(library), str(SOURCE), "-lm"], check=True)
    tree = kernel.tree
    parts, bodies = tree.clusters, tree.bodies
    order = [ball for part in parts for ball in part.balls]
    spot = {ball: place for place, ball in enumerate(order)}
    ends = np.cumsum([0, *(len(part.balls) for part in parts)])
    of_part = {i: next(j for j, body in enumerate(bodies) if body.node == part.node) for i, part in enumerate(parts)}
    groups: dict[tuple[int, int], list[Any]] = {}
    for one in tree.pairs_of(parts):
        groups.setdefault((of_part[one.first], of_part[one.last]), []).append(one)
    rows, pairs, fars, far, entries, firsts = list[Any](), list[Any](), list[Any](), list[Any](), list[Any](), [0]
    marks = {p.name: p.radius for b in robot.boundaries for p in (b.point_a, b.point_b)}
    names = list(dict.fromkeys(name for pair in kernel.pairs for name in pair.marks))
    radius = {ball: marks[name] for ball, name in enumerate(names)}
    for (a, b), inner in groups.items():
        rows.append([a, b, len(pairs), len(pairs) + len(inner)])
        fars.append((bodies[a].radius + bodies[b].radius + max(one.threshold for one in inner)) ** 2)
        for one in inner:
            pairs.append([one.first, one.last])
            far.append((parts[one.first].radius + parts[one.last].radius + one.threshold) ** 2)
            entries += [[spot[x] for x in tree.ends[number].tolist()] for number in one.pairs]
            firsts.append(len(entries))
    nodes = tree.nodes
    kept = [int(np.flatnonzero(node.axis)[0]) for node in nodes]
    integers = {
        "up": [node.above for node in nodes],
        "column": [int(np.flatnonzero(tree.angles[node.angle])[0]) if node.angle >= 0 else 0 for node in nodes],
        "kept": kept,
        "link_node": [body.node for body in bodies],
        "part_node": [part.node for part in parts],
        "part_first": ends[:-1],
        "part_last": ends[1:],
        "group": rows,
        "pair": pairs,
        "entry_first": firsts[:-1],
        "entry_last": firsts[1:],
        "entry": entries,
    }
    signs = [
        float(node.axis[k] * max(tree.angles[node.angle], key=abs)) if node.angle >= 0 else 1.0
        for node, k in zip(nodes, kept, strict=True)
    ]
    reals = {
        "sign": signs,
        "step": [node.step for node in nodes],
        "link_middle": [body.middle for body in bodies],
        "part_middle": [part.middle for part in parts],
        "sphere": [tree.balls[ball][1] for ball in order],
        "radius": [radius[ball] for ball in order],
        "group_far": fars,
        "pair_far": far,
    }
    arrays = {k: np.ascontiguousarray(v, dtype=np.int32) for k, v in integers.items()}
    arrays |= {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in reals.items()}
    fields = ["up", "column", "kept", "sign", "step", "link_node", "part_node", "part_first", "part_last"]
    fields += ["link_middle", "part_middle", "sphere", "radius", "group", "pair", "entry_first", "entry_last", "entry"]
    fields += ["group_far", "pair_far"]

    class Robot(ctypes.Structure):
        _fields_ = [(k, ctypes.c_int) for k in ("n", "nodes", "links", "parts", "groups")] + [
            (k, ctypes.c_void_p) for k in fields
        ]

    record = Robot(tree.n, len(nodes), len(bodies), len(parts), len(rows), *(arrays[k].ctypes.data for k in fields))
    function, out = ctypes.CDLL(str(library)).free_rows, np.zeros(len(Q), dtype=np.uint8)
    head = ctypes.byref(record), ctypes.c_void_p(Q.ctypes.data), ctypes.c_void_p(out.ctypes.data)

    def run() -> Any:
        function(*head, ctypes.c_size_t(len(Q)))
        return out, arrays

    return run


def near_contact(kernel: BallKernel, Q: Any, seed: int) -> Any:
    """Rows moved along one random line each until the smallest clearance is within 1e-6 m of zero."""
    rng = np.random.default_rng(seed)
    low, high = Q.copy(), Q + rng.uniform(-1.0, 1.0, Q.shape)
    ends = [kernel.smallest(rows, False, None, 1, "compiled")[0] for rows in (low, high)]
    which = ends[0] * ends[1] < 0
    low, high, sign = low[which], high[which], np.sign(ends[0][which])
    for _ in range(20):
        middle = 0.5 * (low + high)
        same = np.sign(kernel.smallest(middle, False, None, 1, "compiled")[0]) == sign
        low, high = np.where(same[:, None], middle, low), np.where(same[:, None], high, middle)
    return np.concatenate((low, high))


def check(robot: Any, kernel: BallKernel, count: int, piece: int) -> None:
    """Compare on `count` rows, of pieces that share none; with the joint limits, and without."""
    done, wrong, near, block, seed = 0, 0, 0, 200_000, 1_000_000 * piece
    start, low, high = time.process_time(), robot.lower, robot.upper
    while done < count:
        rng = np.random.default_rng(seed)
        Q = rng.uniform(low, high, (block, len(robot.coordinates)))
        close = near_contact(kernel, Q, seed + 1)
        copies = close[rng.integers(0, len(close), block)] + rng.uniform(-1e-7, 1e-7, (block, Q.shape[1]))
        for rows in (Q, copies):
            least = kernel.smallest(rows, False, None, 1, "compiled")[0]
            inside = np.all((rows >= low) & (rows <= high), axis=1)
            wrong += int(np.count_nonzero(kernel.free(rows, backend="compiled") != (least > 0.0)))
            found = kernel.free_within(rows, low, high, backend="compiled")
            wrong += int(np.count_nonzero(found != ((least > 0.0) & inside)))
            near += int(np.count_nonzero(np.abs(least) < 1e-6))
            done += block
        seed += 2
        seconds = time.process_time() - start
        text = f"piece {piece}: {done:,} rows, {near:,} within 1e-6 m of contact: {wrong} differ from float64's sign"
        print(f"{text}; {seconds:.0f} s", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot", type=Path, nargs="?")
    parser.add_argument("--pairs", type=Path)
    parser.add_argument("--home", default="0 -0.785 0 -2.356 0 1.571 0.785")
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--repetitions", type=int, default=15)
    parser.add_argument("--check", type=int, default=0)
    parser.add_argument("--piece", type=int, default=0, help="of the rows of --check: 0, 1, 2 and so on")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.robot:
            robot = spheres_of(options.robot, options.pairs, [float(x) for x in options.home.split()], folder)
        else:
            robot = robots.panda(folder)
        before = robot.boundaries.signed_kernel.kernel
        arguments = before.pairs, before.n, before.reference, robot.boundaries.common
        kernel, old = BallKernel(*arguments), Kernel(*arguments)
        start = time.process_time()
        Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (options.rows, len(robot.coordinates)))
        kernel.free(Q, backend="compiled")
        print(f"{len(kernel.pairs)} pairs; first `free`: {time.process_time() - start:.2f} s of processor time")
        if options.check:
            check(robot, kernel, options.check, options.piece)
            return
        calls = {
            "free": lambda: kernel.free(Q, backend="compiled"),
            "free, limits too": lambda: kernel.free_within(Q, robot.lower, robot.upper, backend="compiled"),
            "smallest and its pair": lambda: kernel.smallest(Q, True, None, 1, "compiled"),
            "one expression a pair, smallest": lambda: old.smallest(Q, False, None, 1, "compiled"),
            "one expression a pair, smallest and its pair": lambda: old.smallest(Q, True, None, 1, "compiled"),
        }
        peer = vamp_like(robot, kernel, folder, Q)
        if peer is not None:
            whole = len(Q) // 16 * 16
            different = np.count_nonzero(peer()[0][:whole].astype(bool) != kernel.free(Q, backend="compiled")[:whole])
            print(f"the C peer, in float32 alone, differs in {different} of {whole} rows")
            calls["C, as VAMP works"] = peer
        times = peers.interleaved({k: (call, len(Q)) for k, call in calls.items()}, options.repetitions)
        print("| what | median [ns a configuration] | least [ns] | / one expression a pair | / C |")
        print("| --- | ---: | ---: | ---: | ---: |")
        for k, t in times.items():
            unit = times["one expression a pair, smallest" + (" and its pair" if "its pair" in k else "")]
            c = f"{np.median(t / times['C, as VAMP works']):.2f}" if peer is not None else ""
            print(f"| {k} | {np.median(t):,.0f} | {t.min():,.0f} | {np.median(t / unit):.3f} | {c} |")


if __name__ == "__main__":
    main()
