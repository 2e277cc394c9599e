"""Every remedy in the message of a faulty file is followed here, and then the file is read.

Each entry makes one fault, finds the remedy in the message, does what it says, and must succeed. The remedies are
collected from the source: one that no entry follows, and that `NOT_FOLLOWED` does not name with a reason, fails.
"""

import ast
import importlib.util
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import pinbound as pb
from loop_texts import ANCHOR, five_bar, four_bar, loops, mjcf
from pinbound.batch import RandomSource, evaluation_of, open_source, run
from pinbound.cli import app
from pinbound.meshes import find_mesh, read_mesh
from pinbound.motion.history import read_motion

SOURCE = Path(pb.__file__).parent

CRANE = """<?xml version="1.0"?>
<robot name="crane" xmlns:pinbound="urn:pinbound:1">
  <link name="base"><inertial><mass value="1"/></inertial>
    <collision name="slab"><origin xyz="0 0 0" rpy="0 0 0"/><geometry><box size="0.1 0.1 0.1"/></geometry></collision>
    <collision name="sign"><geometry><mesh filename="sign.stl" scale="1 1 1"/></geometry></collision></link>
  <link name="boom"><collision name="tube"><geometry><cylinder radius="0.01" length="0.1"/></geometry></collision>
    <collision_checking><capsule name="tube"/></collision_checking></link>
  <link name="rod"/>
  <link name="hook"/>
  <joint name="lift" type="revolute"><parent link="base"/><child link="boom"/><origin xyz="0 0 0.2" rpy="0 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-1.5" upper="2" effort="10" velocity="1"/></joint>
  <joint name="lift_rod" type="revolute"><parent link="boom"/><child link="rod"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-4" upper="4" effort="10" velocity="1"/>
    <mimic joint="lift" multiplier="-1" offset="0"/></joint>
  <joint name="reach" type="prismatic"><parent link="rod"/><child link="hook"/><origin xyz="0.1 0 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.4" effort="10" velocity="1"/></joint>
  <pinbound:annotations contact_tolerance="2e-5">
    <pinbound:home lift="0.1"/>
    <pinbound:point name="p" link="base" xyz="1 0 0.9" radius="0.01"/>
    <pinbound:point name="s" link="hook" xyz="0 0 0"/>
    <pinbound:plane name="floor" link="base" xyz="0 0 -3" normal="0 0 1"/>
    <pinbound:line name="wire" link="hook" xyz="0 0 0.1" direction="0 1 0"/>
    <pinbound:sweep name="plate" link="hook" xyz="0 0 0" ways="0.1 0 0 0 0.1 0"/>
    <pinbound:boundary name="b" a="p" b="s"/>
    <pinbound:assumption>the rod is rigid</pinbound:assumption>
  </pinbound:annotations>
</robot>
"""
ASSUMED = "<pinbound:assumption>"
HOMELESS = CRANE.replace('<pinbound:home lift="0.1"/>', "")
SIDECAR = """contact_tolerance: 2.0e-5
home: {lift: 0.1}
points:
  - {name: p2, link: base, xyz: [1, 0, 0.9], radius: 0.01}
  - {name: s2, link: hook, xyz: [0, 0, 0]}
boundaries: [{name: b2, a: p2, b: s2, min_distance: 0.001}]
limits: [{joint: reach, lower: 0, upper: 0.3}]
followers: [{joint: lift_rod, primary: lift, multiplier: -1}]
left_out: [{a: base, b: boom, reason: neighbours}]
"""
FOUR_BAR = """<robot name="loop" xmlns:pinbound="urn:pinbound:1"><link name="g"/><link name="a"/><link name="b"/>
<link name="c"/>
<joint name="j1" type="revolute"><parent link="g"/><child link="a"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="j2" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 1 0"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="j3" type="revolute"><parent link="g"/><child link="c"/><origin xyz="2 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<pinbound:annotations><pinbound:closure name="loop" link_a="b" xyz_a="2 0 0" link_b="c" xyz_b="0 1 0" passive="j2 j3"/>
</pinbound:annotations></robot>"""

LOOSE, END = FOUR_BAR[: FOUR_BAR.index("<pinbound:closure")], "</pinbound:annotations></robot>"

Do = Callable[[Path], object]


@dataclass(frozen=True)
class Entry:
    """A fault, the remedy that its message gives (as in the source, a value is ``{}``), and the remedy followed."""

    remedy: str
    fault: Do
    mended: Do


LOOP = FOUR_BAR.replace(
    "</robot>",
    """<link name="d"/><link name="e"/>
<joint name="j4" type="revolute"><parent link="g"/><child link="d"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="j5" type="revolute"><parent link="d"/><child link="e"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>""",
)


def load(text: str, sidecar: str | None = None, name: str = "crane.urdf", kind: str = "yaml") -> Do:
    def done(folder: Path) -> object:
        (folder / name).write_text(text, encoding="utf-8")
        given = []
        if sidecar is not None:
            given = [folder / f"more.{kind}"]
            given[0].write_text(sidecar, encoding="utf-8")
        robot = pb.load(folder / name, annotations=given or None)
        return pb.propose_marks(robot)  # bodies are read when they are asked for

    return done


def only(text: str) -> Do:
    """Return a load and nothing else: marks are not proposed for robots with loops that are not parallelograms."""
    return lambda _: pb.load(text)


def urdf(remedy: str, old: str, bad: str, good: str | None = None, base: str = CRANE) -> Entry:
    """Return an entry in which `bad` in place of `old` is the fault, and `good` (else `old`) what the remedy says."""
    assert base.count(old) >= 1, old
    return Entry(remedy, load(base.replace(old, bad, 1)), load(base.replace(old, old if good is None else good, 1)))


def element(remedy: str, bad: str, good: str) -> Entry:
    """Return an entry in which `bad` is the fault as one more element of the annotations, and `good` what is right."""
    return urdf(remedy, ASSUMED, bad + ASSUMED, good + ASSUMED)


def yaml(remedy: str, old: str, bad: str, good: str | None = None) -> Entry:
    assert SIDECAR.count(old) >= 1, old
    mended = SIDECAR.replace(old, old if good is None else good, 1)
    return Entry(remedy, load(HOMELESS, SIDECAR.replace(old, bad, 1)), load(HOMELESS, mended))


def loop(
    remedy: str,
    bad: str = "",
    good: str = "",
    *,
    passive: tuple[str, str] = ("j2 j3", "j2 j3"),
    pin: tuple[str, str] = ("2 0 0", "2 0 0"),
    tolerance: float | None = None,
) -> Entry:
    """Return an entry of a parallelogram: more annotations, its passive joints and its pin, faulty and mended."""
    texts: list[str] = []
    for more, names, place in zip((bad, good), passive, pin, strict=True):
        end = f"{more}</pinbound:annotations>"
        one = LOOP.replace("</pinbound:annotations>", end).replace('passive="j2 j3"', f'passive="{names}"')
        texts.append(one.replace('xyz_a="2 0 0"', f'xyz_a="{place}"'))
    given = "" if tolerance is None else f'tolerance="{tolerance}" '
    return Entry(remedy, *(load(text.replace("passive=", f"{given}passive=")) for text in texts))


def xacro(remedy: str, bad: str, good: str) -> Entry:
    names = CRANE.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    texts = [names.replace("</robot>", text + "</robot>") for text in (bad, good)]
    return Entry(remedy, *(load(text, name="crane.urdf.xacro") for text in texts))


def crane(folder: Path) -> pb.Robot:
    (folder / "crane.urdf").write_text(CRANE)
    return pb.load(folder / "crane.urdf")


def motion(name: str, make: Callable[[Path], object]) -> Do:
    def done(folder: Path) -> object:
        make(folder / name)
        return read_motion(crane(folder), folder / name)

    return done


def rows(name: str, make: Callable[[Path], object]) -> Do:
    def done(folder: Path) -> object:
        make(folder / name)
        source = open_source(folder / name, ("lift", "reach"))
        return [block for _, block in source.chunks(10, range(-(-source.rows // 10)))]

    return done


def text(words: str | bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(words.encode() if isinstance(words, str) else words)


def csv(remedy: str, bad: str | bytes, good: str = "lift,reach\n0,0.1\n") -> Entry:
    return Entry(remedy, motion("m.csv", text(bad)), motion("m.csv", text(good)))


def parquet(**columns: Any) -> Callable[[Path], object]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    return lambda path: pq.write_table(pa.table(columns), path)


def damaged(make: Callable[[Path], object], at: int) -> Callable[[Path], object]:
    def done(path: Path) -> None:
        make(path)
        data = bytearray(path.read_bytes())
        data[at] ^= 0xFF
        path.write_bytes(data)

    return done


def archive(**columns: Any) -> Callable[[Path], object]:
    return lambda path: np.savez(path, **columns)


def array(values: Any, cut: int = 0) -> Callable[[Path], object]:
    def done(path: Path) -> None:
        with path.open("wb") as stream:
            np.save(stream, np.asarray(values))
        path.write_bytes(path.read_bytes()[: path.stat().st_size - cut])

    return done


def wrong_size(path: Path) -> None:
    """Write an archive whose entry is longer than its header says."""
    import io
    import zipfile

    stream = io.BytesIO()
    np.save(stream, np.zeros(2))
    with zipfile.ZipFile(path, "w") as made:
        made.writestr("lift.npy", stream.getvalue() + b"12345678")


def job(folder: Path, rows: int = 10, out: str = "out", **options: Any) -> object:
    evaluation = evaluation_of(crane(folder), ("verdict",), backend="numpy")
    return run(evaluation, RandomSource(rows, 1, (-1.0, 0.0), (1.0, 0.4)), folder / out, **options)


def prepared(prepare: Callable[[Path], object], then: Do) -> Do:
    def done(folder: Path) -> object:
        prepare(folder)
        return then(folder)

    return done


def another_job(folder: Path) -> None:
    job(folder, rows=11)


def locked(folder: Path) -> object:
    """Run a job while another process holds its folder; here the other one is this process."""
    import fcntl

    (folder / "out").mkdir(exist_ok=True)
    with (folder / "out" / ".pinbound.lock").open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        return job(folder)


def commands(remedy: str, bad: str, good: str) -> Entry:
    """Return an entry of two command lines; CRANE in them is the robot's file, HERE the folder."""

    def run_line(line: str) -> Do:
        def done(folder: Path) -> object:
            crane(folder)
            words = [word.replace("HERE", str(folder)) for word in line.split(" ")]
            words = [str(folder / "crane.urdf") if word == "CRANE" else word for word in words]
            result = CliRunner().invoke(app, words)
            if result.exit_code == 2:
                raise SaidError(result.output)
            assert result.exit_code in (0, 1), result.output
            return result

        return done

    return Entry(remedy, run_line(bad), run_line(good))


class SaidError(Exception):
    """What a command printed before it ended with exit code 2."""


JOB = "batch CRANE --random 5 --out HERE/o"
LETTERS = "Use letters, digits and signs; no control or formatting characters"
METRES = "Write {} in metres"
BROKEN = "Write the name on one line, with spaces"
HINT = "name_hint()"
MEANT = "Did you mean {}?"
BY_HAND = "Expand it with xacro yourself and load the .urdf"


CORNER = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
DAE = """<COLLADA><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a">0 0 0 1 0 0 0 1 0</float_array>
<technique_common><accessor source="#a" count="3" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles><input semantic="VERTEX" source="#v"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def mesh(name: str, text: str | None, named: str = "") -> Do:
    """Write the file of a mesh (a folder of that name for None), and find and read it by the name that a URDF gives."""

    def done(folder: Path) -> object:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if text is None:
            path.mkdir()
            return read_mesh(path)
        with path.open("wb") as stream:
            stream.write(text.encode())
            stream.truncate(2**30 if text == "huge" else stream.tell())
        return read_mesh(find_mesh(named or name, folder / "arm.urdf", [folder]))

    return done


def mesh_entries() -> Iterator[Entry]:
    good = mesh("tip.obj", CORNER)
    yield Entry("Export the mesh again", mesh("tip.obj", CORNER + "f 1 2 4\n"), good)
    yield Entry("Export the surface as triangles", mesh("tip.obj", "v 0 0 0\n"), good)
    yield Entry("Give a simpler mesh: collision bodies need some thousand triangles", mesh("tip.obj", "huge"), good)
    pointer = "version https://git-lfs.github.com/spec/v1"
    yield Entry("Run `git lfs pull` in its repository", mesh("tip.obj", pointer), good)
    far = mesh("tip.obj", CORNER.replace("1 0 0", "1e12 0 0"))
    yield Entry("Give metres, or a scale; bodies reach up to {} m", far, good)
    yield Entry("Give one of: {}", mesh("tip.fbx", CORNER), good)
    yield Entry("Name the file of a mesh", mesh("folder.obj", None), good)
    yield Entry("Check the path and its permissions", lambda folder: read_mesh(folder / "no.obj"), good)
    yield Entry("Remove the <!DOCTYPE ...>", mesh("a.dae", "<!DOCTYPE COLLADA []>" + DAE), mesh("a.dae", DAE))
    inside = mesh("arm/tip.obj", CORNER, "package://arm/tip.obj")
    yield Entry("Correct the name, or put the mesh there", mesh("arm/tip.obj", CORNER, "package://arm/top.obj"), inside)
    package = "Give the folder that holds the package: package_dirs=[...], or --package-dir"
    yield Entry(package, mesh("arm/tip.obj", CORNER, "package://hand/tip.obj"), inside)
    yield Entry(
        "Correct it, or leave such bodies uncovered: --skip-missing, skip_missing=True",
        lambda folder: pb.propose_marks(crane(folder), skip_missing=False),
        lambda folder: pb.propose_marks(crane(folder), skip_missing=True),
    )
    network = "Nothing is read from a network: save the file, and name it by package://, file:// or a path"
    yield Entry(network, mesh("tip.obj", CORNER, "http://localhost/tip.obj"), good)


def entries() -> Iterator[Entry]:  # noqa: PLR0915 - a table, one row a remedy
    """Yield them by the module that says the remedy."""
    # urdf
    yield urdf("A URDF starts with <robot>", CRANE, "<model/>")
    yield urdf("Check that the file is the robot's URDF, and complete", CRANE, '<robot name="r"/>')
    yield urdf("Name it", '<link name="rod"/>', '<link name="rod"/><link/>', '<link name="rod"/>')
    yield urdf(LETTERS, '<pinbound:point name="s"', '<pinbound:point name="s\u202e"')
    yield urdf(LETTERS, '<link name="rod"/>', '<link name="rod\u200b"/>')
    yield urdf("Rename one", '<link name="rod"/>', '<link name="rod"/><link name="rod"/>')
    yield urdf("{}Valid types: {}", 'type="revolute"', 'type="hinge"')
    yield urdf("Name its link", '<parent link="base"/>', "<parent/>")
    yield urdf("Write finite numbers", 'lower="-1.5"', 'lower="low"')
    yield urdf("Write <axis xyz=...>", '<axis xyz="0 1 0"/>', "<axis/>")
    yield urdf("Give the axis a direction", 'xyz="0 1 0"/>', 'xyz="0 0 0"/>')
    limit = '<limit lower="0" upper="0.4" effort="10" velocity="1"/>'
    yield urdf("Give lower and upper, in the URDF or as `limits` in the annotations", limit, "")
    turning = '<limit lower="-1.5" upper="2" effort="10" velocity="1"/>'
    yield urdf("{}; or make it continuous", turning, "")
    bare = CRANE.replace(turning, "", 1)
    more = bare.replace('name="lift" type="revolute"', 'name="lift" type="continuous"')
    yield Entry("{}; or make it continuous", load(bare), load(more))
    annotated = '<pinbound:limit joint="reach" lower="0" upper="0.4"/></pinbound:annotations>'
    without = CRANE.replace(limit, "")
    given = without.replace("</pinbound:annotations>", annotated)
    yield Entry("Give lower and upper, in the URDF or as `limits` in the annotations", load(without), load(given))
    yield urdf("Give {}", 'lower="-1.5" upper="2"', 'lower="0.1"', 'lower="0.1" upper="2"')
    yield urdf("Swap them", 'lower="-1.5" upper="2"', 'lower="2" upper="-1.5"', 'lower="-1.5" upper="2"')
    yield urdf("Name the joint it follows", '<mimic joint="lift"', "<mimic")
    yield urdf(HINT, '<parent link="base"/>', '<parent link="bose"/>')
    # kinematics
    yield urdf(HINT, '<mimic joint="lift"', '<mimic joint="lif"')
    cycle = 'joint name="lift" type="revolute"><mimic joint="lift_rod"/>'
    yield urdf("Remove the <mimic> of one joint of the cycle", 'joint name="lift" type="revolute">', cycle)
    two = '<joint name="two" type="fixed"><parent link="base"/><child link="hook"/></joint><pinbound:annotations '
    closed = '<pinbound:closure name="c" link_a="base" xyz_a="0 0 0" link_b="boom" xyz_b="0 0 -0.2"/>'
    tree = "A URDF is a tree: keep one, and write the other as <pinbound:closure>"
    yield urdf(tree, "<pinbound:annotations ", two)
    still = CRANE.replace('xyz="0 0 0.2" rpy="0 0 0"', 'xyz="0 0 0" rpy="0 0 0"')
    said = still.replace("<pinbound:point", closed.replace("0 0 -0.2", "0 0 0") + "<pinbound:point", 1)
    doubled = still.replace("<pinbound:annotations ", two.replace('"hook"', '"boom"'))
    yield Entry(tree, load(doubled), load(said))
    apart = '<joint name="last" type="fixed"><parent link="base"/><child link="loose"/></joint>'
    yield urdf(
        "Connect all links by joints into one tree",
        '<link name="rod"/>',
        '<link name="loose"/><link name="rod"/>',
        '<link name="loose"/>' + apart + '<link name="rod"/>',
    )
    ring = '<link name="u"/><link name="v"/><joint name="x" type="fixed"><parent link="u"/><child link="v"/></joint>'
    ring += '<joint name="y" type="fixed"><parent link="v"/><child link="u"/></joint><link name="rod"/>'
    cut = ring.replace('<parent link="v"/><child link="u"/>', '<parent link="base"/><child link="u"/>')
    yield urdf("Cut the cycle", '<link name="rod"/>', ring, cut)
    # vocabulary
    yield urdf(MEANT, "upper=", "uper=")
    yield urdf("Did you mean <{}>?", "<axis", "<axes")
    yield urdf("Write it as an attribute: {}", '<axis xyz="0 1 0"/>', "<axis>0 1 0</axis>")
    yield urdf('Write it as an attribute: {}="..."', '<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"><xyz>0 1 0</xyz></axis>')
    yield urdf("Write it as an element: <{} .../>", "<joint name", '<joint axis="0 1 0" name')
    yield urdf("Keep one: some readers take the first, some the last", "<axis", '<axis xyz="0 1 0"/><axis')
    shapes = '<box size="0.1 0.1 0.1"/>'
    each = f'{shapes}</geometry></collision><collision><geometry><sphere radius="1"/>'
    yield urdf("Give each its own <collision>", shapes, f'{shapes}<sphere radius="1"/>', each)
    out = "Write it inside a <pinbound:annotations> directly below <robot>"
    yield urdf(out, 'name="rod"/>', 'name="rod" pinbound:radius="1"/>')
    yield urdf("Remove the prefix, or the attribute", '<axis xyz="0 1 0"', '<axis xmlns:p="urn:p" p:xyz="0 1 0"')
    yield urdf("Put it below <robot>", '<link name="rod"/>', '<group><link name="rod"><visual/></link></group>')
    yield urdf("Put it below <robot>", '<link name="rod"/>', '<link name="rod"><link name="x"/></link>')
    name = "Name the file .urdf.xacro, or expand it with xacro"
    plain = CRANE.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ').replace(
        "</robot>", '<xacro:if value="0"/></robot>'
    )
    yield Entry(name, load(plain), load(plain, name="crane.urdf.xacro"))
    yield urdf("Write <{}> without a prefix and without xmlns, or remove it", "<axis", '<axis xmlns="urn:x"')
    # bodies
    yield urdf("Write one", '</link>\n  <link name="rod"', '<collision_checking/></link>\n  <link name="rod"')
    yield urdf("Name the cylinder that is a capsule", '<capsule name="tube"/>', "<capsule/>")
    yield urdf(HINT, '<capsule name="tube"/>', '<capsule name="tub"/>')
    yield urdf("Give it one with a shape, or remove the body", "<geometry>" + shapes + "</geometry>", "")
    yield urdf("Give it one of: {}", shapes, "")
    yield urdf(HINT, shapes, '<bocks size="1 1 1"/>')
    yield urdf("Give factors other than zero", 'scale="1 1 1"', 'scale="1 0 1"')
    yield urdf(METRES, 'size="0.1 0.1 0.1"', 'size="0.1 0.1"')
    yield urdf("Write {} in metres, not negative", 'radius="0.01" length', 'radius="-0.01" length')
    yield urdf('Write {}="..." as an attribute', 'filename="sign.stl" ', "")
    yield urdf("Write three numbers in metres", '<origin xyz="0 0 0"', '<origin xyz="1e300 0 0"')
    yield urdf("Write three finite numbers", '<origin xyz="0 0 0"', '<origin xyz="0 0"')
    yield urdf("Move it directly into a <geometry>, or remove it", '<collision name="slab">', f"<collision>{shapes}")
    # documents
    yield urdf(BROKEN, 'name="rod"', 'name="the\nrod"', 'name="rod"')
    dtd = "Remove it: pinbound resolves no entities, neither internal nor external ones"
    yield urdf(dtd, "<robot ", "<!DOCTYPE robot []><robot ")
    closing = "Correct the XML; every element must be closed, every prefix declared, its encoding be the declared one"
    yield urdf(closing, '<link name="rod"/>', '<link name="rod">')
    yield urdf("Save it as UTF-8", '<?xml version="1.0"?>', '<?xml version="1.0" encoding="gbk"?>')
    yield from mesh_entries()
    where = "Give the path of a .urdf or .xacro file, or one of: {}"
    yield Entry(where, lambda folder: pb.load(folder / "no.urdf"), lambda folder: pb.load("minervabot_v3"))
    yield Entry(
        "Valid: {}",
        lambda folder: pb.load(crane(folder).document.path, trust="nobody"),
        lambda folder: pb.load(crane(folder).document.path, trust="urdf-only"),
    )
    plainly = "leave them out"
    yield Entry(
        plainly,
        lambda folder: pb.load(crane(folder).document.path, xacro_args={"a": "1"}),
        lambda folder: pb.load(crane(folder).document.path),
    )
    trusted = "Expand it yourself in a safe place, or trust it: trust='xacro', --trust xacro"

    def as_xacro(folder: Path) -> Path:
        return Path(shutil.copy(crane(folder).document.path, folder / "crane.urdf.xacro"))

    yield Entry(
        trusted,
        lambda folder: pb.load(as_xacro(folder), trust="urdf-only"),
        lambda folder: pb.load(as_xacro(folder), trust="xacro"),
    )
    # xacro
    yield xacro("Correct the xacro file or its arguments", '<link name="${nowhere}"/>', "")
    find = '<xacro:include filename="$(find toolbox)/t.xacro"/></robot>'
    with_find = CRANE.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    with_find = with_find.replace("</robot>", find)

    def packaged(folder: Path) -> object:
        box = folder / "elsewhere" / "toolbox"
        box.mkdir(parents=True)
        (box / "package.xml").write_text("<package><name>toolbox</name></package>")
        (box / "t.xacro").write_text("<robot/>")
        return pb.load(folder / "crane.urdf.xacro", package_dirs=[folder / "elsewhere"])

    yield Entry(
        "Give the folder that holds the package: package_dirs=[...], or --package-dir",
        load(with_find, name="crane.urdf.xacro"),
        packaged,
    )
    yield Entry(
        HINT,
        lambda folder: pb.load(as_xacro(folder), xacro_args={"upp": "1"}),
        lambda folder: pb.load(as_xacro(folder)),
    )
    # annotations
    yield urdf('Write xmlns:pinbound="{}", which this version reads', "urn:pinbound:1", "urn:pinbound:9")
    yield urdf(
        "Move it into a <pinbound:annotations> directly below <robot>",
        "</robot>",
        "<pinbound:home/></robot>",
        "</robot>",
    )
    yield urdf(HINT, "<pinbound:point", "<pinbound:dot")
    yield urdf("Remove it", '<pinbound:home lift="0.1"/>', '<pinbound:home lift="0.1"><a/></pinbound:home>')
    yield urdf("Use attributes", '<pinbound:home lift="0.1"/>', "<pinbound:home>0.1</pinbound:home>")
    yield yaml("Write plain numbers in metres and radians", "lower: 0", "lower: !degrees 0")
    yield yaml("Correct the YAML", "home: {", "home: {{")
    yield yaml("Write the values out", "home: {lift: 0.1}", "home: &h {lift: 0.1}\nleft_out: *h")
    yield yaml("A sidecar holds lists of mappings of numbers and names", "[1, 0, 0.9]", "[" * 40 + "1" + "]" * 40)
    yield yaml(HINT, "points:", "pionts:")
    yield yaml("Write a number, a name, or one list of numbers", "xyz: [0, 0, 0]", "xyz: {z: 0}")
    old, row = "left_out: [", "hulls: [{{name: h, link: hook, vertices: [[0, 0, 0], [1, 0{}]]}}]\nleft_out: ["
    yield yaml("Give three numbers for each", old, row.format(""), row.format(", 0"))
    yield yaml("Write [ ... ]", "limits: [{joint: reach, lower: 0, upper: 0.3}]", "limits: {joint: reach}")
    yield yaml("Write {key: value}", "home: {lift: 0.1}", "home: [0.1]")
    yield yaml("Keep one", "lower: 0,", "lower: 0, lower: 0,")
    yield Entry(
        "Check the path and its permissions",
        lambda folder: pb.load(crane(folder).document.path, annotations=folder / "no.yaml"),
        lambda folder: pb.load(crane(folder).document.path),
    )
    balls = '<robot name="crane"><link_sphere_approximation link="base"><sphere center="9 0 0" radius="1"/>'
    balls += "</link_sphere_approximation></robot>"
    srdf = "Give an SRDF that holds one of them"
    yield Entry(srdf, load(CRANE, "<robot/>", kind="srdf"), load(CRANE, balls, kind="srdf"))
    # validation
    yield yaml("Keep one (the first is on line {})", "2.0e-5", "3.0e-5")
    yield yaml("Rename one, or remove it", "name: s2", "name: p2", "name: s2")
    yield yaml(HINT, "radius: 0.01", "radios: 0.01")
    yield yaml("It needs {}", "name: p2, link: base,", "name: p2,")
    yield yaml("Write finite numbers, metres or radians", "radius: 0.01", "radius: wide")
    yield yaml("Give a length in metres, zero or more", "radius: 0.01", "radius: -1")
    octal = "Write {} or {}, without the zero in front; put a name in quotes"
    yield yaml(octal, "radius: 0.01", "radius: 010")
    yield yaml(HINT, "link: base", "link: bass")
    yield urdf("Give a vector of any length but zero", 'normal="0 0 1"', 'normal="0 0 0"')
    yield urdf("Give three numbers for each way (edge vector), up to {} ways", 'ways="0.1 0 0 0 0.1 0"', 'ways="0.1 0"')
    yield urdf("Leave it out", 'ways="0.1 0 0 0 0.1 0"', 'ways="0.1 0 0 0 0 0"', 'ways="0.1 0 0"')
    yield urdf("Name marks of two different links", 'name="s" link="hook"', 'name="s" link="base"')
    yield urdf(
        "Make one of the two marks a point, a segment or a body", 'a="p" b="s"', 'a="floor" b="wire"', 'a="floor" b="s"'
    )
    hull = '<pinbound:hull name="h" link="hook" vertices="{}"/>'.format
    corners = "0 0 0 0.1 0 0 0 0.1 0"
    yield element("Give three numbers for each vertex, up to {} vertices", hull("0 0 0 1"), hull(corners))
    yield element("Give metres; lengths up to {} m can be measured", hull("0 0 0 1e80 0 0"), hull(corners))
    of_mesh = '<pinbound:hull name="h" link="hook" {}/>'.format
    both = of_mesh(f'vertices="{corners}" mesh="tip.obj"')
    yield element("Keep one of the two: a mesh has its own vertices", both, hull(corners))
    box = '<pinbound:box name="h" link="hook" xyz="0 0 0" rpy="0 0 0" size="{}"/>'.format
    yield element("Give lengths in metres, zero or more", box("0.1 -0.1 0.1"), box("0.1 0.1 0.1"))
    tube = '<pinbound:cylinder name="h" link="hook" xyz_a="0 0 0" xyz_b="{}" radius="0.1"/>'.format
    yield element("Give metres", tube("0 0 1e80"), tube("0 0 0.1"))
    yield element("Give its two ends", tube("0 0 0"), tube("0 0 0.1"))
    yield urdf("Write true or false", 'a="p" b="s"', 'a="p" b="s" stop="yes"', 'a="p" b="s" stop="false"')
    yield urdf(
        "A stop is two points of radius 0, without min_distance, whose lever arms align at contact. Give it "
        "such points, or "
        "remove stop: other boundaries are in contact where their distance is the threshold",
        'a="p" b="s"',
        'a="p" b="s" stop="true"',
    )
    yield urdf("Name two links", 'link_b="c"', 'link_b="b"', base=FOUR_BAR)
    spaced = FOUR_BAR.replace('"j2"', '"j 2"').replace('"j3"', '"j"').replace('passive="j2 j3"', 'passive="j 2 j"')
    spaced = spaced.replace('"j1"', '"2"')
    closure = "closures: [{name: loop, link_a: b, xyz_a: [2, 0, 0], link_b: c, xyz_b: [0, 1, 0], passive: [j 2, j]}]"
    start, end = spaced.index("<pinbound:closure"), spaced.index("</pinbound:annotations>")
    listed = spaced[:start] + spaced[end:]
    yield Entry("Name the joints in a list, in a YAML sidecar", load(spaced), load(listed, closure))
    rule = '<pinbound:rule name="{}" coefficients="{}" upper="{}">{}</pinbound:rule>'.format
    yield element(
        "Give it a name of its own, e.g. 'coupling'", rule("lift", "lift: 1", 1, ""), rule("r", "lift: 1", 1, "")
    )
    yield element("Rename one of them", rule("b", "lift: 1", 1, ""), rule("r", "lift: 1", 1, ""))
    cancels = "lift: 1, lift_rod: 1"  # the rod turns back by what the boom turns
    yield element("Correct its coefficients, or remove it", rule("r", cancels, 1, ""), rule("r", "lift: 1", 1, ""))
    never, sometimes = (f'<pinbound:where coefficients="{c}" lower="1"/>' for c in (cancels, "lift: 1"))
    yield element(
        "Correct the condition, or remove the rule",
        rule("r", "reach: 1", 0.2, never),
        rule("r", "reach: 1", 0.2, sometimes),
    )
    whole = CRANE.replace('home lift="0.1"', 'home lift="0.1" reach="0"')
    held = rule("r", "lift: 1", 0.05, '<pinbound:where coefficients="reach: 1" upper="0.1"/>') + ASSUMED
    yield urdf(
        "Choose a home that keeps the rule; angles are in radians",
        'home lift="0.1"',
        'home lift="0.1"',
        'home lift="0.01"',
        base=whole.replace(ASSUMED, held),
    )
    one = "rules: [{name: r, coefficients: {lift: 1}, upper: 1, where: WHERE}]"
    yield Entry(
        "Write [{...}]",
        load(CRANE, one.replace("WHERE", "{coefficients: {reach: 1}, upper: 0.1}")),
        load(CRANE, one.replace("WHERE", "[{coefficients: {reach: 1}, upper: 0.1}]")),
    )
    axis = '<pinbound:axis name="{}" instead_of="{}" coefficients="{}"/>'.format
    yield element("Give it a name of its own", axis("lift", "lift", "lift: 1"), axis("up", "lift", "lift: 1"))
    yield element("Add angles only", axis("up", "lift", "lift: 1, reach: 1"), axis("up", "lift", "lift: 1"))
    yield element(
        "Let each axis replace a different joint",
        axis("up", "lift", "lift: 1") + axis("down", "lift", "lift: -1"),
        axis("up", "lift", "lift: 1") + axis("out", "reach", "reach: -1"),
    )
    yield Entry(
        "Give each axis a coefficient of the joint that it replaces (instead_of)",
        load(LOOSE + axis("x", "j1", "j1: 1, j2: 1") + axis("y", "j2", "j1: 1, j2: 1") + END),
        load(LOOSE + axis("x", "j1", "j1: 1, j2: 1") + axis("y", "j2", "j2: 1") + END),
    )
    homes = 'home lift="0.1"'
    up = axis("up", "lift", "lift: 2")
    both = CRANE.replace(ASSUMED, up + ASSUMED)
    yield urdf("Leave {} or {} out", homes, 'home lift="0.1" up="0.3"', 'home up="0.3"', base=both)
    yield yaml("Swap them", "lower: 0, upper: 0.3", "lower: 0.3, upper: 0", "lower: 0, upper: 0.3")
    yield yaml("Name two links", "{a: base, b: boom", "{a: base, b: base")
    # loading
    yield urdf("Choose a home inside all limits; angles are in radians", 'home lift="0.1"', 'home lift="45"')
    limits = 'lower="-4" upper="4"'
    yield urdf(
        "Correct the limits, or the multipliers and offsets of mimic joints",
        limits,
        'lower="3" upper="4"',
        base=HOMELESS,
    )
    yield urdf(HINT, 'home lift="0.1"', 'home lft="0.1"')
    free = "Choose a free home, or correct the points and distances of this boundary"
    yield urdf(free, 'b="s"/>', 'b="s" min_distance="2"/>')
    off, pose = '<pinbound:home j1="0.2" j2="-0.200005" j3="0.2"/>', '<pinbound:home j1="0.2" j2="-0.2" j3="0.2"/>'
    yield loop("Give {} the value {}", off, pose, tolerance=1e-5)
    metres = "Give metres; lengths up to {} m can be measured"
    yield urdf(metres, 'name="s" link="hook" xyz="0 0 0"', 'name="s" link="hook" xyz="1e155 0 0"')
    # stops
    stop = 'name="s" link="hook" xyz="0 0 0"'
    turned = CRANE.replace('xyz="1 0 0.9" radius="0.01"', 'xyz="0 0 0.7"').replace(stop, 'name="s" link="{}" xyz="{}"')
    declared = turned.replace('a="p" b="s"', 'a="p" b="s" stop="true"')
    arms = load(declared.format("boom", "0.5 0 0"))
    mend = "Correct the two points, or remove stop: as they are they never touch"
    yield Entry(mend, load(declared.format("boom", "0.3 0 0")), arms)
    yield Entry(mend, load(declared.format("boom", "0.3 0 0")), load(turned.format("boom", "0.3 0 0")))
    pivot = (
        "A stop is the alignment of two lever arms about one pivot. Remove stop, and give a point a "
        "radius or a min_distance"
    )
    distance = turned.replace('b="s"', 'b="s" min_distance="0.01"')
    yield Entry(pivot, load(declared.format("hook", "0 0 0")), load(distance.format("hook", "0 0 0")))
    fixed = (
        '<link name="bolt"/><joint name="weld" type="fixed"><parent link="base"/><child link="bolt"/></joint></robot>'
    )
    welded = declared.replace("</robot>", fixed)
    take = "Name points of two links with a revolute joint between them"
    yield Entry(take, load(welded.format("bolt", "0.5 0 0")), load(welded.format("boom", "0.5 0 0")))
    # loops
    yield loop("Let home name an assembled pose of {}", '<pinbound:home j1="0" j2="0.5"/>', '<pinbound:home j1="0"/>')
    flat = LOOP.replace('xyz="0 1 0"/><axis', 'xyz="1 0 0"/><axis').replace('xyz_b="0 1 0"', 'xyz_b="1 0 0"')
    posed = '<pinbound:home j1="0.5" j2="-0.5" j3="0.5"/>'
    named = flat.replace("</pinbound:annotations>", posed + "</pinbound:annotations>")
    yield Entry("Let home name a pose of {} in which it is not flat", load(flat), load(named))
    yield loop("Joints of the loop: {}", passive=("j4 j5", "j2 j3"))
    rounded = "{} (metres), and its effect on the links' places is added to the distances kept"
    unequal = LOOP.replace('xyz_a="2 0 0"', 'xyz_a="2.00001 0 0"')
    tolerated = unequal.replace("passive=", 'tolerance="2e-5" passive=')
    yield Entry(rounded, load(unequal), load(tolerated))
    yield Entry(rounded, load(unequal), load(LOOP))
    wide = tolerated.replace('lower="-1" upper="1"', 'lower="-2" upper="2"', 1)
    yield Entry("Give it equal sides, or limit {} ({} deg from flat)", load(wide), load(tolerated))
    yield Entry("Give it equal sides, or limit {} ({} deg from flat)", load(wide), load(wide.replace("2.00001", "2")))
    other = LOOP.replace('xyz_b="0 1 0"', 'xyz_b="0 1.5 0"').replace('lower="-3" upper="3"', 'lower="-9" upper="9"')
    posed = other.replace("</pinbound:annotations>", "{}</pinbound:annotations>")
    far, straight = '<pinbound:home j1="1.6"/>', '<pinbound:home j2="0" j3="1.5707963267948966"/>'
    wide = posed.replace('lower="-1" upper="1"', 'lower="-4" upper="4"', 1).replace('xyz="2 0 0"', 'xyz="3 0 0"')
    yield Entry("Let home name a pose in which it closes", only(wide.format(far)), only(wide.format("")))
    one, two = only(posed.format(straight)), only(posed.format('<pinbound:home j2="0.5" j3="0.5"/>'))
    yield Entry("Let home name values of {} (roughly) in the assembly that is meant", one, two)
    single = other.replace('passive="j2 j3"', 'passive="j2"')
    again = 'Name two other joints of the loop, passive="...", or couple its joints by <mimic>'
    yield Entry(again, only(single), only(other))
    counted = "Remove the axes, or couple the loop by <mimic>"
    axis = '<pinbound:axis name="k" instead_of="j1" coefficients="j1: 1, j4: 1"/>'
    yield Entry(counted, only(posed.format(axis)), only(posed.format("")))
    floating = LOOP.replace('name="j3" type="revolute"', 'name="j3" type="floating"').replace('"j2 j3"', '"j2"')
    yield Entry("Close the loop over single joints", load(floating), load(LOOP))
    led = LOOP.replace('name="j5" type="revolute">', 'name="j5" type="revolute"><mimic joint="j4"/>')
    yield Entry("Free joints: {}", load(led.replace('"j2 j3"', '"j5 j2"')), load(led))
    coupled = LOOP.replace(
        'name="j2" type="revolute">', 'name="j2" type="revolute"><mimic joint="j1" multiplier="-1"/>'
    )
    coupled = coupled.replace('name="j3" type="revolute">', 'name="j3" type="revolute"><mimic joint="j1"/>')
    coupled = coupled.replace('passive="j2 j3"', "")
    pins = "Correct xyz_a or xyz_b of the pin (in the frame of its link), or the joints' origins"
    yield Entry(pins, load(coupled.replace('xyz_a="2 0 0"', 'xyz_a="2.5 0 0"')), load(coupled))
    mimic = "Couple the joints of the loop by <mimic>, or correct its pins"
    yield loop(mimic, pin=("2 0 0.1", "2 0 0"))
    # tables
    yield csv("Give a line of column names, then one line per configuration", "")
    yield csv("Save it as comma-separated text in UTF-8", "lift,reach\n0,0.1\n".encode("utf-16"))
    yield csv("Save it as comma-separated text", "lift;reach\n0;0.1\n")
    yield csv("Give a number", "lift,reach\n0,wide\n")
    yield csv("Give one cell per column", "lift,reach\n0\n")
    yield csv("Keep one of each", "lift,reach,lift\n0,0.1,0\n")
    yield csv("Give a line of column names first", "0,0\n0,0.1\n")
    yield csv("Give at least one configuration", "lift,reach\n")
    yield csv(HINT, "lift,reech\n0,0.1\n")
    yield csv("Give one column per coordinate: {}", "lift\n0\n")
    yield csv("Give finite numbers", "lift,reach\n0,nan\n")
    yield csv("Sort the rows, one for each time", "time,lift,reach\n1,0,0\n0,0,0\n", "time,lift,reach\n0,0,0\n1,0,0\n")
    follows = "It should be {}; leave the column out, or correct it"
    yield csv(follows, "lift,reach,lift_rod\n0.5,0,0\n", "lift,reach,lift_rod\n0.5,0,-0.5\n")
    yield csv(follows, "lift,reach,lift_rod\n0.5,0,0\n", "lift,reach\n0.5,0\n")
    yield Entry("Give a {} file", motion("m.txt", text("")), motion("m.csv", text("lift,reach\n0,0\n")))
    good = np.array([[0.0, 0.1], [0.5, 0.2]])
    whole = motion("m.npy", array(good))
    yield Entry("Save it with numpy.save", motion("m.npy", text("no")), whole)
    shape = "Give numbers (N, {}), the columns being: {}"
    yield Entry(shape, motion("m.npy", array(good[:, :1])), whole)
    yield Entry("Copy it again, whole", motion("m.npy", array(good, cut=8)), whole)
    named = motion("m.npz", archive(lift=good[:, 0], reach=good[:, 1]))
    yield Entry("Call it .npy, or write it with numpy.savez", motion("m.npz", array(good)), whole)
    yield Entry("Call it .npy, or write it with numpy.savez", motion("m.npz", array(good)), named)
    yield Entry("Write it with numpy.savez(file, time=t, q1=..., ...)", motion("m.npz", text("no")), named)
    yield Entry("Give one value per configuration", motion("m.npz", archive(lift=[0.0], reach=[0.0, 0.1])), named)
    yield Entry("Give one array of numbers (N,) per column", motion("m.npz", archive(lift=good)), named)
    yield Entry("Write the archive again", motion("m.npz", wrong_size), named)
    yield Entry("Give one column per coordinate", motion("m.npz", archive()), named)
    numbers = motion("m.parquet", parquet(lift=[0.0], reach=[0.1]))
    yield Entry("Store it as float64", motion("m.parquet", parquet(lift=["0"], reach=[0.1])), numbers)
    yield Entry("Write it again", motion("m.parquet", damaged(parquet(lift=[0.0], reach=[0.1]), -1)), numbers)
    heads = "Name the columns as the coordinates"
    yield Entry(heads, rows("q.csv", text("a,b\n0,0\n")), rows("q.csv", text("lift,reach\n0,0\n")))
    # batches
    elsewhere = "Give another folder"
    yield Entry(elsewhere, prepared(lambda f: (f / "out").write_text(""), job), lambda f: job(f, out="new"))
    yield Entry(
        elsewhere,
        prepared(lambda f: (f / "out" / ".pinbound.lock").mkdir(parents=True), job),
        lambda f: job(f, out="new"),
    )
    yield Entry("Wait for it, or give another folder", locked, job)
    yield Entry("Wait for it, or give another folder", locked, lambda f: job(f, out="new"))
    yield Entry("Give 1 or more of both", lambda f: job(f, chunk_rows=0), job)
    few = "Give fewer rows, or more rows per file (--chunk-rows)"
    yield Entry(few, lambda f: job(f, rows=10**9, chunk_rows=1), lambda f: job(f, rows=20, chunk_rows=10))

    def spoilt(folder: Path) -> None:
        (folder / "out").mkdir()
        (folder / "out" / "manifest.json").write_text("[]")

    yield Entry("Give an empty folder", prepared(spoilt, job), lambda f: job(f, out="new"))

    def older(folder: Path) -> None:
        (folder / "out").mkdir()
        (folder / "out" / "manifest.json").write_text('{"format": 1, "job": {}}')

    yield Entry(elsewhere, prepared(older, job), lambda f: job(f, out="new"))
    same = "Give the same options, or another folder"
    yield Entry(same, prepared(another_job, job), lambda f: job(f, rows=11))
    yield Entry(same, prepared(another_job, job), lambda f: job(f, out="new"))

    def others(folder: Path) -> None:
        (folder / "out").mkdir()
        (folder / "out" / "thesis.tex").write_text("mine")

    empty = "Give an empty folder, or that of the same job"
    yield Entry(empty, prepared(others, job), lambda f: job(f, out="new"))
    changed = "Give the file that the job began with, or start a new job in another folder"

    def changing(folder: Path) -> object:
        path = folder / "q.csv"
        path.write_text("lift,reach\n0,0\n")
        source = open_source(path, ("lift", "reach"))
        path.write_text("lift,reach\n0,0.1\n0,0\n")
        return run(evaluation_of(crane(folder), ("verdict",), backend="numpy"), source, folder / "out")

    def again(folder: Path) -> object:
        (folder / "q.csv").write_text("lift,reach\n0,0\n")
        source = open_source(folder / "q.csv", ("lift", "reach"))
        return run(evaluation_of(crane(folder), ("verdict",), backend="numpy"), source, folder / "out")

    yield Entry(changed, changing, again)
    address = "Write it whole, e.g. tcp://127.0.0.1:8786"
    if importlib.util.find_spec("distributed"):
        yield Entry(address, lambda f: job(f, scheduler="localhost"), answered)
    # commands
    yield commands("Give one of --in, --grid, --random, --sobol", "batch CRANE --out HERE/o", JOB)
    yield commands("Give from 1 to 10^15", JOB.replace(" 5 ", " 1" + "0" * 20 + " "), JOB)
    ends = "Write FROM:TO, two finite numbers, FROM <= TO"
    grid = "batch CRANE --out HERE/o --grid lift=0:1:"
    yield commands(ends, JOB + " --within lift=1:0", JOB + " --within lift=0:1")
    yield commands("Write {}", JOB + " --within lift=0", JOB + " --within lift=0:1")
    yield commands("Remove it, or give --random or --sobol", f"{grid}3 --within lift=0:1", grid + "3")
    yield commands("Keep one", "limits CRANE --at lift=0,lift=1", "limits CRANE --at lift=0")
    yield commands("Coordinates: {}", JOB + " --within lft=0:1", JOB + " --within lift=0:1")
    yield commands("Write NAME=FROM:TO:COUNT, COUNT from 1 to 10^15", grid + "few", grid + "3")
    yield commands(
        "Remove it, or give another name",
        "mark CRANE --out HERE/crane.urdf",
        "mark CRANE --skip-missing --out HERE/n.yaml",
    )
    written = "export minervabot_v3 json --out HERE"
    yield commands("Give the name of a file", written, written + "/not/yet/there/a.json")
    yield commands("Write NAME=NUMBER, NAME one of: {}", "limits CRANE --at lft=1", "limits CRANE --at lift=0")
    window = "Write NAME=LOWER..UPPER, e.g. q1=-1..1, NAME one of: {}"
    yield commands(window, "region CRANE --window lift=1", "region CRANE --window lift=-1..1")
    cross = "crosscheck CRANE --samples 3 --levels points"
    way = "plan minervabot_v3 --start q2=0 --goal q2=20,q3=20 --deg --out HERE/a"
    yield commands("Let it end in .csv", way + ".txt", way + ".csv")
    yield commands("Let it end in .png or .svg", cross + ",region --out HERE/a.txt", cross + ",region --out HERE/a.png")
    yield commands("Add it to --levels", cross + " --out HERE/a.png", cross + ",region --out HERE/a.png")
    yield commands(window, cross + ",region --window lift=1", cross + ",region --window lift=-1..1")
    yield commands(
        "Write e.g. --xacro-arg bridge=as_printed",
        "info minervabot_v3 --xacro-arg bridge",
        "info minervabot_v3 --xacro-arg bridge=as_printed",
    )
    table = "export minervabot_v3 table --format csv --out HERE/t.csv"
    joints = table + " --target q2 --dependent q3"
    yield commands("Give --target and --dependent, of {}", table, joints)
    box = "Give its box, e.g. --within {}=-3.14:3.14"
    endless = CRANE.replace('name="lift" type="revolute"', 'name="lift" type="continuous"')

    def turning_job(more: tuple[str, ...]) -> Do:
        def done(folder: Path) -> object:
            (folder / "turning.urdf").write_text(endless)
            words = ["batch", str(folder / "turning.urdf"), "--random", "5", "--out", str(folder / "o"), *more]
            result = CliRunner().invoke(app, words)
            if result.exit_code:
                raise SaidError(result.output)
            return result

        return done

    yield Entry(box, turning_job(()), turning_job(("--within", "lift=-3.14:3.14")))
    seconds = "Set it to a number of seconds, or unset it"

    def timed(value: str | None) -> Do:
        def done(folder: Path) -> object:
            with pytest.MonkeyPatch.context() as patch:
                if value is None:
                    patch.delenv("PINBOUND_XACRO_SECONDS", raising=False)
                else:
                    patch.setenv("PINBOUND_XACRO_SECONDS", value)
                return pb.load(as_xacro(folder))

        return done

    yield Entry(seconds, timed("soon"), timed("60"))
    yield Entry(seconds, timed("soon"), timed(None))
    # files that change, and files that are large

    def shrinking(folder: Path) -> object:
        from pinbound.tables import open_table

        array(good)(folder / "m.npy")
        table = open_table(folder / "m.npy", ("lift", "reach"))
        array(good, cut=8)(folder / "m.npy")
        return list(table.blocks(("lift", "reach")))

    yield Entry("Give it whole again", shrinking, whole)

    def torn(folder: Path) -> object:
        from pinbound.tables import open_table

        archive(lift=good[:, 0], reach=good[:, 1])(folder / "m.npz")
        table = open_table(folder / "m.npz")
        text("no")(folder / "m.npz")
        return list(table.blocks(("lift", "reach")))

    yield Entry("Write it again with numpy.savez", torn, named)

    def covered(name: str) -> Do:
        def done(folder: Path) -> object:
            pb.certified_cover(pb.load(name), limits_only=True).save(folder / "c.npz")
            return pb.load_cover(pb.load("palletizers/dobot_mg400"), folder / "c.npz", ())

        return done

    again = "Make it again with {} and .save(path)"
    yield Entry(again, covered("minervabot_v3"), covered("palletizers/dobot_mg400"))

    def paved(name: str, few: bool = True) -> Do:
        def done(folder: Path) -> object:
            robot = pb.load(name)
            path = pb.pair_atlas(robot, robot.boundaries.names[:1]).save(folder / "a.npz")
            other = pb.load("palletizer")
            return pb.load_atlas(other, path, other.boundaries.names[:1] if few else None)

        return done

    yield Entry(again, paved("minervabot_v3"), paved("palletizer"))
    yield Entry(f"{again}, or give boundaries={{}}", paved("palletizer", few=False), paved("palletizer"))
    large = "Split the file, or evaluate it with `pinbound batch`, which reads in parts"

    def few_cells(then: Do) -> Do:
        def done(folder: Path) -> object:
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("pinbound.tables.table.MOST_CELLS", 3)
                return then(folder)

        return done

    yield Entry(large, few_cells(whole), few_cells(motion("m.npy", array(good[:1]))))
    yield Entry(large, few_cells(whole), few_cells(rows("m.npy", array(good))))


def answered(folder: Path) -> object:
    """Give the address whole, of a scheduler that is there."""
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False}
    with distributed.LocalCluster(**options, dashboard_address=":0") as made:  # any port: others may run beside
        return job(folder, scheduler=made.scheduler_address)


def beside(name: str, text: str, robot: str | None = None) -> Do:
    """Return a load of a five-bar with a file beside it that says its loop."""

    def done(folder: Path) -> object:
        (folder / name).write_text(text)
        return pb.load(five_bar('type="fixed"') if robot is None else robot, annotations=folder / name)

    return done


def alone(name: str, text: str) -> Do:
    """Return a reading of a file of annotations without a robot."""

    def done(folder: Path) -> object:
        (folder / name).write_text(text)
        return pb.Annotations.load(folder / name)

    return done


def loop_files() -> Iterator[Entry]:
    """Yield what is wrong with a robot.yaml, an MJCF model or a weld, and what to do."""
    good, here = loops("3d"), "robot.yaml"
    right = beside(here, good)
    yield Entry("Load both: pinbound.load('robot.urdf', annotations='robot.yaml')", alone(here, good), right)
    for remedy, bad in {
        "Give each pair of closed_loop its type, 3d or 6d": loops("3d', '3d"),
        "Name two frames: [frame_a, frame_b]": good.replace("'loop_B', ", ""),
        "Write 3d (a pin) or 6d (a weld)": loops("planar"),
        "Give each joint its type": loops("3d", "joint_name: ['free_l']\n"),
        "Write [...]": good.replace("['3d']", "3d"),
        "Remove it from joint_name if the one axis of the URDF is right; else it cannot be loaded": loops(
            "3d", "joint_name: ['free_l']\njoint_type: ['SPHERICAL']\n"
        ),
    }.items():
        yield Entry(remedy, beside(here, bad), right)
    twice = five_bar('type="fixed"').replace('name="loop_B_frame"', 'name="crank_l"')
    named = beside(here, good.replace("loop_B", "crank_l"), twice)
    yield Entry("Give one of them another name in the URDF", named, right)

    here, good = "robot.xml", mjcf(ANCHOR)
    right = beside(here, good)
    yield Entry("Load both: pinbound.load('robot.urdf', annotations='robot.xml')", alone(here, good), right)
    weld, away = ANCHOR + '<weld body1="rod_l" body2="rod_r"/>', "remove it from the file that you give here"
    for remedy, bad in {
        "Give an MJCF model, a sidecar or an SRDF": "<robot/>",
        "Save the model as one file (MuJoCo: mj_saveLastXML)": good.replace("</mujoco>", "<include/></mujoco>"),
        "Save the model as one file": good.replace("</worldbody>", "<replicate/></worldbody>"),
        "Save it with a new MuJoCo": good.replace("<default>", '<compiler coordinate="global"/><default>', 1),
        "Name two bodies": good.replace('body2="rod_r"', 'body2="rod_l"'),
        "Give one of the two": good.replace("anchor", "anker"),
        "Give the MJCF that was made from this URDF, or write the closure in a sidecar (pinbound.yaml)": good.replace(
            "0.1 0.2", "0.1 0.3"
        ),
        "pinbound reads <connect> and linear <joint>. {}": mjcf(weld),
        f"Write this coupling in a sidecar, and {away}": mjcf(ANCHOR + '<joint joint1="motor_r"/>'),
        "Write finite numbers": good.replace("0.1 0.2", "0.1 two"),
        "Keep one": good.replace('"rod_r" pos', '"rod_r" zaxis="0 0 1" quat="1 0 0 0" pos'),
        "Give a direction": good.replace('"rod_r" pos', '"rod_r" zaxis="0 0 0" pos'),
        "Give two directions": good.replace('"rod_r" pos', '"rod_r" xyaxes="1 0 0 1 0 0" pos'),
    }.items():
        yield Entry(remedy, beside(here, bad), right)
    hung = mjcf('<connect body1="rod_l" anchor="0.2 0.25 0"/>').replace('"base">', '"base"><freejoint/>')
    yield Entry("Name two bodies of the robot", beside(here, hung), right)

    weld = FOUR_BAR.replace("passive=", 'weld="true" passive=')
    tilted = weld.replace('<origin xyz="2 0 0"/>', '<origin xyz="2 0 0" rpy="1 0 0"/>')
    remedy = "Give the pin alone (of type 3d, or without weld), or couple the joints of the loop by <mimic>"
    yield Entry(remedy, only(tilted), only(FOUR_BAR))
    both = FOUR_BAR.replace("passive=", 'active="j2" passive=')
    yield Entry("Name it once", only(both), only(FOUR_BAR))
    mark = "closures: [{{name: c, link_a: {}, xyz_a: [{}, 0, 0], link_b: {}, xyz_b: [0, 0, 0], weld: true, {}}}]".format
    every = "active: [motor_l, free_l, motor_r, free_r, loop_A]"
    held = [
        beside("c.yaml", mark("ball", 0, "loop_B", one), five_bar()) for one in (every, "active: [motor_l, motor_r]")
    ]
    yield Entry("Leave one out of active and passive", *held)
    uneven = [beside("c.yaml", mark("fore", one, "bar", "active: [lean]"), four_bar()) for one in (0.2000001, 0.2)]
    yield Entry("Give closure {} equal sides, or {} the pin alone (without weld)", *uneven)
    spatial = FOUR_BAR.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>', 1)
    coupled = LOOSE.replace('<limit lower="-3"', '<mimic joint="j1" multiplier="-1"/><limit lower="-3"', 1) + END
    remedy = "Couple its joints by <mimic> if they are proportional; else a robot with this loop cannot be loaded"
    yield Entry(remedy, only(spatial), only(coupled))


ENTRIES = [*entries(), *loop_files()]


@pytest.mark.parametrize("entry", ENTRIES, ids=[f"{i}: {one.remedy[:40]}" for i, one in enumerate(ENTRIES)])
def test_a_remedy_that_is_followed_helps(entry: Entry, tmp_path: Path) -> None:
    with pytest.raises((pb.PinboundError, SaidError)) as caught:
        entry.fault(tmp_path)
    if isinstance(caught.value, pb.InputError):
        said = [problem.remedy for problem in caught.value.problems]
    else:
        said = [str(caught.value)]
    found = re.compile(pattern(entry.remedy), re.DOTALL)
    if isinstance(caught.value, pb.InputError):
        assert any(map(found.match, said)), said
    else:
        assert any(map(found.search, said)), said
    entry.mended(tmp_path)


def pattern(template: str) -> str:
    """Return the pattern of a remedy: where the source puts a value, anything stands."""
    if template == HINT:
        return r"(Did you mean .*\? )?Valid: .*|There is none"
    return ".*".join(re.escape(part) for part in template.split("{}"))


POSITIONS = {"Problem": 1, "add": 1, "_fault": 1, "refusal": 2, "bad": 2, "_bad": 2, "Refusal": 1, "refuse": 2}
"""Where each function that says a fault takes its remedy."""

BEFORE = "`load` refuses such a file before, with a remedy that is followed here"
LOOPS = "it takes a linkage of several loops, and a change of its geometry"
NOT_FOLLOWED: dict[str, str] = {
    "Give each shape a body of its own": BEFORE,
    "Keep one of each in a body": BEFORE,
    "Write xyz and rpy only": BEFORE,
    BY_HAND: "it is for Pythons that do not know their own program",
    "Correct the URDF": "Pinocchio's own words come before it; no file is known that gets so far",
    "Write the file so that all readers agree; if it already is plain URDF, report this as a bug of pinbound": (
        "every file that is known to be read differently is refused before, with the word that is wrong"
    ),
    "": "no message: a loop that is exact says nothing",
    "Give it equal sides": "said where no limit helps; equal sides are followed with the limit's remedy",
    "Give the prismatic joint limits": "a slide has limits, or `load` refuses it before",
    "Couple two joints of the loop, or leave them free": LOOPS,
    "Name other passive joints": LOOPS,
    "Give these loops equal sides": LOOPS,
    "Give them equal sides": LOOPS,
    "Give closure {} equal sides, or couple loop {} by <mimic>": LOOPS,
    "Choose other points": "the refusal before it says which ones",
}
"""Remedies that no entry follows, and why."""


def templates() -> dict[str, str]:
    """Return every remedy of the source with the place of one that says it."""
    found: dict[str, str] = {}
    for path in sorted(SOURCE.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        known = assigned(tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                at = POSITIONS.get(node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", ""))
                of_set = isinstance(node.func, ast.Attribute) and node.func.attr == "add"
                if at is None or len(node.args) <= at or (of_set and "problems" not in ast.unparse(node.func)):
                    continue
                for one in said_by(node.args[at], known):
                    found.setdefault(one, f"{path.relative_to(SOURCE)}, line {node.lineno}")
            elif isinstance(node, ast.FunctionDef) and node.name in ("stop_fault", "_limit_remedy", "_remedy"):
                for inner in ast.walk(node):
                    if isinstance(inner, ast.Return) and inner.value is not None:
                        last = inner.value.elts[-1] if isinstance(inner.value, ast.Tuple) else inner.value
                        for one in said_by(last, known):
                            found.setdefault(one, f"{path.relative_to(SOURCE)}, line {inner.lineno}")
    return found


def assigned(tree: ast.Module) -> dict[str, list[ast.expr]]:
    known: dict[str, list[ast.expr]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            known.setdefault(node.targets[0].id, []).append(node.value)
    return known


def said_by(node: ast.expr, known: dict[str, list[ast.expr]]) -> Iterator[str]:
    """Yield the texts that an expression may be; what is computed elsewhere is collected there."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        parts = [str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values]
        yield "".join(parts)
    elif isinstance(node, ast.IfExp):
        yield from said_by(node.body, known)
        yield from said_by(node.orelse, known)
    elif isinstance(node, ast.Name):
        for value in known.get(node.id, []):
            yield from said_by(value, known)
    elif isinstance(node, ast.Call) and ast.unparse(node.func) == "name_hint":
        yield HINT


def test_every_remedy_is_followed_or_its_reason_is_given() -> None:
    """A message with a new remedy fails here until an entry follows it."""
    in_source, followed = templates(), {entry.remedy for entry in ENTRIES}
    assert len(in_source) > 100
    forgotten = {one: place for one, place in in_source.items() if one not in followed | set(NOT_FOLLOWED)}
    assert not forgotten
    assert not (followed | set(NOT_FOLLOWED)) - set(in_source), "no message says these any more"
    assert not followed & set(NOT_FOLLOWED)
