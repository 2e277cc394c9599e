"""Fuzz the readers: mutated files of every kind end in a robot, a table, or one InputError, never otherwise.

The readers: URDF, xacro, YAML, SRDF; CSV, NPY, NPZ and Parquet as `check` and `batch` read them; the command `mark`.
A URDF that loads without a note is compared with Pinocchio's own reading of the same bytes, a table with what a plain
reader reads (`benchmarks.fuzz_tables`): a difference is a failure too. Run:

    python -m benchmarks.fuzz_readers --all 100000 --seed 0
    python -m benchmarks.fuzz_readers --files 10000 --seed 0 [--only urdf,yaml] [--keep FOLDER]

Each failure prints the reader, the number of the file (`--start N --files 1` repeats it) and its traceback. Every
reader runs in a process of its own, so that one that crashes or does not come back is counted, and the next file is
tried.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import multiprocessing
import os
import random
import re
import signal
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import pinbound as pb
from benchmarks.fuzz_tables import TABLES, invoke, table_case

__all__ = ["READERS", "fuzz", "mutated"]

URDF = """<?xml version="1.0"?>
<robot name="crane" xmlns:pinbound="urn:pinbound:1">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base"><collision><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry><box size="0.1 0.2 0.3"/></geometry>
    </collision></link>
  <link name="boom"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><cylinder radius="0.05" length="0.4"/></geometry></visual></link>
  <link name="rod"/>
  <link name="hook"><collision><geometry><sphere radius="0.04"/></geometry></collision></link>
  <joint name="lift" type="revolute"><parent link="base"/><child link="boom"/><origin xyz="0 0 0.2" rpy="0 0.1 1.2"/>
    <axis xyz="0 1 0"/><limit lower="-1.5" upper="2" effort="10" velocity="1"/></joint>
  <joint name="lift_rod" type="revolute"><parent link="boom"/><child link="rod"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-4" upper="4" effort="10" velocity="1"/>
    <mimic joint="lift" multiplier="-1" offset="0.25"/></joint>
  <joint name="reach" type="prismatic"><parent link="rod"/><child link="hook"/><origin xyz="0.1 0 0" rpy="0.1 0.2 0.3"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.4" effort="10" velocity="1"/></joint>
%s</robot>
"""
MARKS = """  <pinbound:annotations contact_tolerance="2e-5">
    <pinbound:home lift="0.1" reach="0.1"/>
    <pinbound:point name="p" link="base" xyz="1 0 0.4" radius="0.01"/>
    <pinbound:segment name="s" link="hook" xyz_a="0 0 0" xyz_b="0.1 0 0.1" radius="0.02"/>
    <pinbound:plane name="floor" link="base" xyz="0 0 -3" normal="0 0 1"/>
    <pinbound:boundary name="b1" a="p" b="s" min_distance="0.001"/>
    <pinbound:boundary name="b2" a="s" b="floor"/>
  </pinbound:annotations>
"""
BODIES = """<?xml version="1.0"?>
<robot name="crane">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base">
    <collision name="slab"><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
    <collision><geometry><mesh filename="package://crane/slab.stl" scale="1 1 1"/></geometry></collision></link>
  <link name="boom"><collision><origin xyz="0.2 0 0" rpy="0 1.5 0"/><geometry><cylinder radius="0.05" length="0.4"/>
    </geometry></collision><visual><geometry><box size="0.5 0.5 0.5"/></geometry></visual></link>
  <link name="rod"><visual><origin xyz="0.05 0 0"/><geometry><capsule radius="0.02" length="0.1"/></geometry></visual>
    </link>
  <link name="hook"><collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.04"/></geometry></collision>
    <collision_checking><capsule/></collision_checking></link>
  <joint name="lift" type="revolute"><parent link="base"/><child link="boom"/><origin xyz="0 0 0.4" rpy="0 0.1 1.2"/>
    <axis xyz="0 1 0"/><limit lower="-1.5" upper="2" effort="10" velocity="1"/></joint>
  <joint name="lift_rod" type="revolute"><parent link="boom"/><child link="rod"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-4" upper="4" effort="10" velocity="1"/>
    <mimic joint="lift" multiplier="-1" offset="0.25"/></joint>
  <joint name="reach" type="prismatic"><parent link="rod"/><child link="hook"/><origin xyz="0.1 0 0" rpy="0.1 0.2 0.3"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.4" effort="10" velocity="1"/></joint>
</robot>
"""
YAML = """contact_tolerance: 2.0e-5
home: {lift: 0.1, reach: 0.1}
points:
  - {name: p, link: base, xyz: [1, 0, 0.4], radius: 0.01}
segments: [{name: s, link: hook, xyz_a: [0, 0, 0], xyz_b: [0.1, 0, 0.1], radius: 0.02}]
planes:
- name: floor
  link: base
  xyz: [0, 0, -3]
  normal: [0, 0, 1]
boundaries: [{name: b1, a: p, b: s, min_distance: 0.001}, {name: b2, a: s, b: floor}]
limits: [{joint: reach, lower: 0, upper: 0.3}]
followers: [{joint: lift_rod, primary: lift, multiplier: -1}]
assumptions: ["the rod is rigid"]
"""
SRDF = """<?xml version="1.0"?>
<robot name="crane">
  <group name="arm"><joint name="lift"/></group>
  <link_sphere_approximation link="base"><sphere center="1 0 0" radius="0.05"/><sphere center="-1 0 0" radius="0.05"/>
  </link_sphere_approximation>
  <link_sphere_approximation link="hook"><sphere center="0 0 0" radius="0.05"/></link_sphere_approximation>
  <disable_collisions link1="boom" link2="hook" reason="Never"/>
  <disable_default_collisions link="rod"/>
  <enable_collisions link1="rod" link2="base"/>
</robot>
"""
XACRO = (
    (URDF % MARKS)
    .replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    .replace(
        '  <link name="rod"/>',
        """  <xacro:arg name="up" default="2"/><xacro:property name="w" value="${0.5 * pi / pi}"/>
  <xacro:macro name="tool" params="name:=t *block size"><link name="${name}"><xacro:insert_block name="block"/></link>
    <joint name="j_${name}" type="fixed"><parent link="hook"/><child link="${name}"/><origin xyz="0 0 ${size}"/></joint>
  </xacro:macro>
  <xacro:if value="${w &lt; 1}"><xacro:tool size="$(arg up)"><inertial><mass value="${w}"/></inertial></xacro:tool>
  </xacro:if>
  <link name="rod"/>""",
    )
)

NUMBERS = [
    "nan",
    "inf",
    "-inf",
    "1e400",
    "1e308",
    "1e200",
    "1e-320",
    "-0",
    "0",
    "1_0",
    "0x10",
    "\u0661",
    "1,5",
    "",
    " ",
    "1e",
    "+1",
]
NUMBERS += ["3.1416", "-3.14159265359", "1.5708", "1e6", "-1", "2", ".5", "5.", "1 2", "true", "--1", "1d3"]
WORDS = [
    "lift",
    "base",
    "",
    " ",
    "é",
    "a b",
    "a[b",
    "[/]",
    "<",
    "&amp;",
    "&#10;",
    "\u202e",
    "x" * 300,
    "../..",
    "$(find x)",
    "${1}",
]
TAGS = [
    "link",
    "joint",
    "axis",
    "axes",
    "Axis",
    "limit",
    "mimic",
    "origin",
    "parent",
    "geometry",
    "box",
    "x:axis",
    "foo",
    "xacro:if",
]
ENCODINGS = ["utf-16", "utf-32", "utf-8-sig", "iso-8859-1", "gbk", "shift_jis", "utf-7"]


def mutated(text: str, rng: random.Random) -> bytes:
    """Return a text with one to four changes that keep most of its structure, now and then in another encoding."""
    for _ in range(rng.choice([1, 1, 1, 2, 2, 4])):
        text = rng.choice(CHANGES)(text, rng)
    if rng.random() < 0.05:
        encoding = rng.choice(ENCODINGS)
        declared = re.sub(
            r'(<\?xml version="1.0")[^?]*', rf'\1 encoding="{rng.choice([encoding, "utf-8", "bogus"])}"', text
        )
        with contextlib.suppress(UnicodeError):
            return declared.encode(encoding)
    data = bytearray(text.encode(errors="surrogatepass"))
    if rng.random() < 0.1 and data:
        for _ in range(rng.randint(1, 3)):
            data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def _swap(pattern: str, values: list[str]) -> Callable[[str, random.Random], str]:
    def change(text: str, rng: random.Random) -> str:
        found = list(re.finditer(pattern, text))
        if not found:
            return text
        one = rng.choice(found)
        return text[: one.start(1)] + rng.choice(values) + text[one.end(1) :]

    return change


def _slip(text: str, rng: random.Random) -> str:
    """Misspell a word: a letter lost, doubled, replaced, swapped, or in the other case."""
    found = list(re.finditer(r"[A-Za-z_]{3,}", text))
    if not found:
        return text
    one = rng.choice(found)
    word = one.group()
    at = rng.randrange(len(word) - 1)
    slips = [word[:at] + word[at + 1 :], word[:at] + word[at] + word[at:], word[:at] + "x" + word[at + 1 :]]
    slips += [word[:at] + word[at + 1] + word[at] + word[at + 2 :], word.swapcase(), word + "s"]
    return text[: one.start()] + rng.choice(slips) + text[one.end() :]


def _element(text: str, rng: random.Random) -> str:
    """Remove, double, move, rename, prefix or wrap an element that closes itself, or a whole line."""
    pattern = r"<[\w:]+(?: [^<>]*)?/>" if rng.random() < 0.7 else r"[^\n]*\n"
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    one, other = rng.choice(found), rng.choice(found)
    piece = one.group()
    cut = text[: one.start()] + text[one.end() :]
    kind = rng.randrange(7)
    if kind == 0:
        return cut
    if kind == 1:
        return text[: one.end()] + piece + text[one.end() :]
    if kind == 2:
        return cut[: min(other.start(), len(cut))] + piece + cut[min(other.start(), len(cut)) :]
    renamed = {
        3: re.sub(r"<([\w:]+)", lambda m: "<" + rng.choice(TAGS), piece, count=1),
        4: re.sub(r"<(\w+)", r'<p:\1 xmlns:p="urn:p"', piece, count=1),
        5: re.sub(r"<(\w+)", r'<\1 xmlns="urn:d"', piece, count=1),
        6: f"<group>{piece}</group>",
    }[kind]
    return text[: one.start()] + renamed + text[one.end() :]


def _attribute(text: str, rng: random.Random) -> str:
    """Remove, double or prefix an attribute."""
    found = list(re.finditer(r' ([\w:]+)="[^"]*"', text))
    if not found:
        return text
    one = rng.choice(found)
    choices = ["", one.group() + one.group(), f' xmlns:p="urn:p" p:{one.group(1)}="0"', one.group() + ' foo="1"']
    return text[: one.start()] + rng.choice(choices) + text[one.end() :]


def _raw(text: str, rng: random.Random) -> str:
    """Insert, cut or repeat raw text."""
    at, size = rng.randrange(len(text) + 1), rng.randint(1, 40)
    pieces = [
        "<!--",
        "-->",
        "<![CDATA[",
        "<?x ?>",
        "<!DOCTYPE r []>",
        "&lt;",
        "&e;",
        "<",
        ">",
        '"',
        "\0",
        "\x1b",
        "[" * 200,
    ]
    pieces += ["!x ", "*a", "&a ", "{", "]", ": ", "- ", "\t", "\n", "${", "$(", "%", "<<: "]
    kind = rng.randrange(3)
    if kind == 0:
        return text[:at] + rng.choice(pieces) + text[at:]
    return text[:at] + text[at + size :] if kind == 1 else text[:at] + text[at : at + size] * 2 + text[at + size :]


_number = _swap(r"[\"\[ ,](-?\d+\.?\d*(?:e-?\d+)?)(?=[\" ,\]\n])", NUMBERS)
_word = _swap(r"[\"' ]([A-Za-z]\w*)(?=[\"',}\n])", WORDS)
CHANGES = (_number, _number, _word, _slip, _slip, _element, _element, _attribute, _raw)


def _urdf(folder: Path, rng: random.Random) -> str:
    path = folder / "r.urdf"
    path.write_bytes(mutated(URDF % (MARKS if rng.random() < 0.5 else ""), rng))
    robot = pb.load(path)
    robot.boundaries.norms(robot.home)
    return "" if robot.notes else _differs(robot, path.read_bytes())


def _xacro(folder: Path, rng: random.Random) -> str:
    path = folder / "r.urdf.xacro"
    path.write_bytes(mutated(XACRO, rng))
    pb.load(path, xacro_args={} if rng.random() < 0.7 else {"up": "0.5"})
    return ""


def _yaml(folder: Path, rng: random.Random) -> str:
    return _annotated(folder, "m.yaml", rng, mutated(YAML, rng))


def _srdf(folder: Path, rng: random.Random) -> str:
    return _annotated(folder, "m.srdf", rng, mutated(SRDF, rng))


def _annotated(folder: Path, name: str, rng: random.Random, annotations: bytes) -> str:
    (folder / "r.urdf").write_text(URDF % "")
    (folder / name).write_bytes(annotations)
    robot = pb.load(folder / "r.urdf", annotations=folder / name)
    if rng.random() < 0.1:  # it costs more than the rest
        robot.boundaries.norms(robot.home)
    return ""


def _mark(folder: Path, rng: random.Random) -> str:
    """Run the command on a URDF with bodies; what it writes must load with that URDF."""
    path, sidecar = folder / "r.urdf", folder / "marks.yaml"
    sidecar.unlink(missing_ok=True)
    path.write_bytes(mutated(BODIES, rng))
    words = ["mark", str(path), "--out", str(sidecar), *(["--json"] if rng.random() < 0.5 else [])]
    words += rng.choice([[], [], ["--by", "spheres"], ["--accuracy", "0.1"], ["--shapes", "box,capsule"]])
    code, said = invoke(words)
    if code == 2:
        pb.load(path)  # refused by `load` as well, or by `mark` alone
        return "" if said.startswith("pinbound: ") else f"no message: {said}"
    if code not in (0, 1):
        return f"exit code {code}: {said}"
    try:
        pb.load(path, annotations=sidecar)
    except pb.InputError as error:
        return f"what it wrote is refused: {error}"
    return ""


def _table(kind: str) -> Callable[[Path, random.Random], str]:
    return lambda folder, rng: table_case(kind, folder, rng)


READERS: dict[str, Callable[[Path, random.Random], str]] = {
    "urdf": _urdf,
    "xacro": _xacro,
    "yaml": _yaml,
    "srdf": _srdf,
    "mark": _mark,
    **{kind: _table(kind) for kind in TABLES},
}
"""One function a reader: it writes a mutated file, loads it, and returns what is wrong with what was loaded."""

SHARES = {"urdf": 28, "xacro": 8, "yaml": 10, "srdf": 18, "mark": 10, "csv": 9, "npy": 10, "npz": 4, "parquet": 3}
"""Files of each reader out of a hundred (`--all`)."""

STUCK = 60.0
"""Seconds after which a process that does not come back from one file is ended."""


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Send what C++ prints to nobody."""
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)


def _differs(robot: pb.Robot, data: bytes) -> str:
    """Return how Pinocchio reads the same bytes differently: another place of a link, another limit, other joints."""
    import pinocchio

    pin: Any = pinocchio
    try:
        with _silent():
            model = pin.buildModelFromXML(data.decode())
    except (ValueError, UnicodeDecodeError):
        return ""
    theta = np.random.default_rng(0).uniform(-1, 1, len(robot.coupling.joints))
    q = pin.neutral(model)
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        if name not in robot.coupling.joints:
            return f"Pinocchio has joint {name!r}"
        index = robot.coupling.joints.index(name)
        value = float(theta[index])
        q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (math.cos(value), math.sin(value))
        ends = robot.tree.moving_joints[index]
        limits = (float(model.lowerPositionLimit[joint.idx_q]), float(model.upperPositionLimit[joint.idx_q]))
        replaced = {mark.joint for mark in robot.annotations.limits}
        if joint.nq == 1 and limits != (ends.lower, ends.upper) and name not in replaced:
            return f"Pinocchio limits {name!r} to {limits}"
    with _silent():
        data_a, data_b = model.createData(), robot.model.createData()
    pin.framesForwardKinematics(model, data_a, q)
    pin.framesForwardKinematics(robot.model, data_b, theta)
    for link in robot.tree.links:
        a, b = model.getFrameId(link, pin.BODY), robot.model.getFrameId(link, pin.BODY)
        if not np.allclose(data_a.oMf[a].homogeneous, data_b.oMf[b].homogeneous, rtol=1e-9, atol=1e-9):
            return f"Pinocchio places {link!r} elsewhere"
    return ""


def fuzz(
    reader: str, start: int, count: int, seed: int, folder: Path, seconds: float = 5.0
) -> tuple[Counter[str], list[tuple[int, str]]]:
    """Return counts of outcomes of one reader, and its failures: number of the file, and what happened."""
    outcomes, failures = Counter[str](), list[tuple[int, str]]()
    for number in range(start, start + count):
        rng = random.Random(f"{seed}:{reader}:{number}")
        begun = time.monotonic()
        try:
            wrong = READERS[reader](folder, rng)
            outcomes["different" if wrong else "loaded"] += 1
            if wrong:
                failures.append((number, wrong))
        except pb.InputError:
            outcomes["refused"] += 1
        except Exception:  # what is looked for
            outcomes["traceback"] += 1
            failures.append((number, traceback.format_exc(limit=-4)))
        if time.monotonic() - begun > seconds:
            outcomes["slow"] += 1
            failures.append((number, f"took {time.monotonic() - begun:.1f} s"))
    return outcomes, failures


def _work(reader: str, start: int, count: int, seed: int, folder: str, pipe: Any) -> None:
    """Fuzz file by file, and tell each outcome; memory is limited, so that what runs away is a fault."""
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (6 * 2**30, 6 * 2**30))
    np.seterr(over="ignore", invalid="ignore")  # lengths of 1e308 m are what they are
    for number in range(start, start + count):
        pipe.send((number, *fuzz(reader, number, 1, seed, Path(folder))))
    pipe.close()


def _guarded(
    reader: str, start: int, count: int, seed: int, folder: Path
) -> tuple[Counter[str], list[tuple[int, str]]]:
    """Do what `fuzz` does in other processes; count files at which one crashed or got stuck."""
    outcomes, failures, end = Counter[str](), list[tuple[int, str]](), start + count
    context = multiprocessing.get_context("spawn")
    while start < end:
        ours, theirs = context.Pipe(duplex=False)
        child = context.Process(target=_work, args=(reader, start, end - start, seed, str(folder), theirs))
        child.start()
        theirs.close()
        what = ""
        while start < end and not what:
            if not ours.poll(STUCK):
                child.kill()
                what = "hang"
                break
            try:
                number, found, wrong = ours.recv()
            except EOFError:
                what = "crash"
                break
            outcomes, start = outcomes + found, number + 1
            failures += wrong
        child.join()
        if what:
            outcomes[what] += 1
            failures.append((start, f"{what}; exit code of its process: {child.exitcode}"))
            start += 1
    return outcomes, failures


def main() -> int:
    """Run the campaign; exit 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=1000, help="files a reader")
    parser.add_argument("--all", type=int, help="files in all, shared out among the readers")
    parser.add_argument("--start", type=int, default=0, help="number of the first file")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default=",".join(READERS))
    parser.add_argument("--keep", type=Path, help="where the files that failed are kept")
    asked = parser.parse_args()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    bad = 0
    for reader in asked.only.split(","):
        count = asked.files if asked.all is None else asked.all * SHARES[reader] // 100
        with tempfile.TemporaryDirectory() as name:
            begun = time.monotonic()
            outcomes, failures = _guarded(reader, asked.start, count, asked.seed, Path(name))
            print(f"{reader}: {dict(sorted(outcomes.items()))} in {time.monotonic() - begun:.0f} s", flush=True)
            for number, what in failures[:20]:
                print(f"--- {reader} {number}\n{what}", flush=True)
                if asked.keep is not None:
                    _guarded(reader, number, 1, asked.seed, Path(name))
                    for file in filter(Path.is_file, Path(name).iterdir()):
                        asked.keep.mkdir(parents=True, exist_ok=True)
                        (asked.keep / f"{reader}-{number}-{file.name}").write_bytes(file.read_bytes())
        bad += len(failures)
    return 1 if bad else 0


if __name__ == "__main__":
    raise SystemExit(main())
