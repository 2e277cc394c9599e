"""Files of meshes: the same vertices as Pinocchio's loader, and one error with a remedy for what is broken."""

import importlib.metadata
import io
import struct
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import pinbound as pb
from pinbound.coverage.bodies import collision_bodies
from pinbound.meshes import MOST_TRIANGLES, find_mesh, read_mesh
from pinbound.model.document import Document

SHARE = Path(str(importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = SHARE / "example-robot-data" / "robots"
CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
FLOAT32 = 2.0**-23  # relative: assimp keeps float32


def stl_bytes(corners: Any = CORNERS, faces: Any = FACES) -> bytes:
    records = (struct.pack("<12fH", 0.0, 0.0, 0.0, *np.asarray(corners)[list(face)].ravel(), 0) for face in faces)
    return b"solid or not".ljust(80) + struct.pack("<I", len(faces)) + b"".join(records)


def stl_text(faces: Any = FACES) -> str:
    rows = ["solid part one"]
    for face in faces:
        rows += ["facet normal 0 0 nan", " outer loop"]
        rows += [f"  vertex {' '.join(f'{x:e}' for x in CORNERS[i])}" for i in face]
        rows += [" endloop", "endfacet"]
    return "\n".join([*rows, "endsolid part one", ""])


OBJ = "# made by hand\no part\nv 0 0 0\nv 1 0 0 0.1 0.2 0.3\nv 0 4 0 2\nv 0 0 3\nvn 0 0 1\ns off\n"
OBJ_FACES = "f 1/1/1 3//1 2\nf -4 -3 -1\nf 1 \\\n4 3\nf 2 3 4\nl 1 2\n"


def dae(scene: str, asset: str = "", positions: str = " ".join(f"{x:g}" for x in CORNERS.ravel())) -> str:
    drawn = " ".join(f"{i} 0" for face in FACES for i in face)
    return f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{asset}</asset><library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="a" count="{len(positions.split())}">{positions}</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="n"><float_array id="b" count="3">0 0 1</float_array><technique_common>
<accessor source="#b" count="1" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="4"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>
<vcount>3 3 3 3</vcount><p>{drawn}</p></polylist></mesh></geometry></library_geometries>
<library_nodes><node id="again"><translate>0 0 5</translate><instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="s">{scene}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


PLAIN = '<node><instance_geometry url="#g"/></node>'
TURNED = (
    "<node><rotate>0 0 1 90</rotate><node><matrix>2 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1</matrix>"
    '<instance_geometry url="#g"/></node></node><node><scale>1 1 -1</scale><instance_node url="#again"/></node>'
)


def off() -> bytes:
    rows = [f"{len(CORNERS)} {len(FACES)} 0", *(" ".join(map(str, x)) for x in CORNERS.tolist())]
    return "\n".join(["OFF", *rows, *(f"3 {a} {b} {c}" for a, b, c in FACES), ""]).encode()


def ply() -> bytes:
    head = f"ply\nformat ascii 1.0\nelement vertex {len(CORNERS)}\nproperty float x\nproperty float y\n"
    head += f"property float z\nelement face {len(FACES)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [*(" ".join(map(str, x)) for x in CORNERS.tolist()), *(f"3 {a} {b} {c}" for a, b, c in FACES), ""]
    return (head + "\n".join(rows)).encode()


GOOD: dict[str, bytes] = {
    "binary.stl": stl_bytes(),
    "text.STL": stl_text().encode(),
    "part.obj": (OBJ + OBJ_FACES).encode(),
    "marked.obj": b"\xef\xbb\xbf" + (OBJ + OBJ_FACES).encode(),
    "part.dae": dae(PLAIN).encode(),
    "latin1.off": off().replace(b"OFF\n", b"OFF\n# aus K\xf6ln\n"),
    "latin1.ply": ply().replace(b"1.0\n", b"1.0\ncomment aus K\xf6ln\n", 1),
    "part.off": off(),
    "part.ply": ply(),
}


def written(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def apart(a: Any, b: Any) -> float:
    """Return the largest distance of a vertex of the one from the vertices of the other."""
    return max(float(np.max(cKDTree(one).query(two)[0])) for one, two in ((a, b), (b, a)))


@pytest.mark.parametrize("name", GOOD)
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (0.001, -2.0, 3.0)])
def test_formats_give_the_same_triangles(name: str, scale: tuple[float, float, float], tmp_path: Path) -> None:
    mesh = read_mesh(written(tmp_path, name, GOOD[name]), scale)
    wanted = {frozenset(map(tuple, (CORNERS[list(face)] * scale).tolist())) for face in FACES}
    assert {frozenset(map(tuple, mesh.vertices[row].tolist())) for row in mesh.triangles} == wanted
    assert sorted(mesh.polygons.tolist()) == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("quads.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 2\nf 1 2 3 4\nf 1 2 5\n"),
        ("part.obj", OBJ + "f 1//1 3//1 2//1\nf -4 -3 -1\n"),
        ("part.stl", stl_bytes()),
        ("text.stl", stl_text()),
        ("turned.dae", dae(TURNED)),
        ("inches.dae", dae(PLAIN, '<unit name="inch" meter="0.0254"/><up_axis>Y_UP</up_axis>')),
        ("part.ply", ply()),
        ("part.off", off()),
    ],
)
def test_pinocchios_loader_reads_the_same_vertices(name: str, data: bytes | str, tmp_path: Path) -> None:
    coal: Any = pytest.importorskip("coal")
    path, scale = written(tmp_path, name, data), np.array([1.0, -0.5, 2.0])
    theirs, ours = coal.MeshLoader().load(str(path), scale), read_mesh(path, scale.tolist())
    assert theirs.num_tris == len(ours.triangles)
    assert apart(np.array(theirs.vertices()), ours.vertices) <= FLOAT32 * np.abs(ours.vertices).max()


@pytest.mark.parametrize(
    "urdf",
    [
        "panda_description/urdf/panda.urdf",
        "talos_data/robots/talos_left_arm.urdf",
        "ur_description/urdf/ur5_robot.urdf",
        "hyq_description/robots/hyq_no_sensors.urdf",
    ],
)
def test_bodies_of_public_robots_lie_where_pinocchio_has_them(urdf: str) -> None:
    pin: Any = pytest.importorskip("pinocchio")
    path = ROBOTS / urdf
    if not path.exists():
        pytest.skip(f"this release of example-robot-data has no {urdf}")
    robot = pb.load(path, package_dirs=[SHARE])
    model = pin.buildModelFromUrdf(str(path))
    geometry = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=[str(SHARE)])
    compared = 0
    for body in collision_bodies(robot):
        name = f"{body.link}_{body.index}"
        if body.shape != "mesh" or body.source != "collision" or not geometry.existGeometryName(name):
            continue
        theirs = geometry.geometryObjects[geometry.getGeometryId(name)]
        place = model.frames[theirs.parentFrame].placement.inverse() * theirs.placement
        vertices = np.array(theirs.geometry.vertices()) @ place.rotation.T + place.translation
        ours = robot.meshes.of(body).vertices
        assert apart(vertices, ours) <= 4 * FLOAT32 * max(1.0, np.abs(ours).max())
        compared += 1
    assert compared >= 4


def test_polygons_are_kept_together(tmp_path: Path) -> None:
    mesh = read_mesh(
        written(tmp_path, "five.obj", "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 1 2 0\nv 0 1 0\nf 1 2 3 4 5\nf 1 2 3\n")
    )
    assert mesh.polygons.tolist() == [0, 0, 0, 1]
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2]]


def test_what_is_not_applied_of_a_dae_is_said(tmp_path: Path) -> None:
    asset = '<unit name="mm" meter="0.001"/><up_axis>Y_UP</up_axis>'
    mesh = read_mesh(written(tmp_path, "mm.dae", dae(PLAIN, asset)))
    assert mesh.notes == ("its unit of 0.001 m and its Y_UP are not applied, as in Pinocchio",)
    assert np.abs(mesh.vertices).max() == 3.0
    assert read_mesh(written(tmp_path, "m.dae", dae(PLAIN, "<up_axis>Z_UP</up_axis>"))).notes == ()


def test_names_lead_to_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "ros" / "arm_description"
    (package / "meshes").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>arm_description</name></package>")
    file = written(package / "meshes", "tip of it.obj", OBJ + OBJ_FACES)
    urdf = tmp_path / "elsewhere" / "arm.urdf"
    urdf.parent.mkdir()
    address = "package://arm_description/meshes/tip of it.obj"
    for given in (tmp_path / "ros", package, tmp_path):
        assert find_mesh(address, urdf, [given]).samefile(file)
    for variable, value in (("ROS_PACKAGE_PATH", tmp_path / "ros"), ("AMENT_PREFIX_PATH", tmp_path / "install")):
        if variable == "AMENT_PREFIX_PATH":
            (tmp_path / "install").mkdir()
            (tmp_path / "install" / "share").symlink_to(tmp_path / "ros")
        with monkeypatch.context() as patch:
            patch.setenv(variable, str(value))
            assert find_mesh(address, urdf).samefile(file)
    assert find_mesh(address, package / "urdf" / "arm.urdf").samefile(file)
    for name in (
        f"file://{file}",
        f"file://{str(file).replace(' ', '%20')}",
        str(file),
        "../ros/arm_description/meshes/tip of it.obj",
    ):
        assert find_mesh(name, urdf).samefile(file)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("http://example.org/a.stl", "Nothing is read from a network"),
        ("https://example.org/a.stl", "Nothing is read from a network"),
        ("ftp://example.org/a.stl", "Nothing is read from a network"),
        ("package://nowhere/a.stl", "there is no package 'nowhere'"),
        ("a.stl", "there is no such file beside arm.urdf"),
        ("file:///no/such/a.stl", "there is no such file"),
        ("a\0.stl", "there is no such file"),
        ("package://a\0/b.stl", "there is no package"),
    ],
)
def test_names_that_lead_nowhere(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(pb.InputError, match=said):
        find_mesh(name, tmp_path / "arm.urdf")


def zipped(entries: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return stream.getvalue()


def bomb() -> bytes:
    """Return an archive of 60 KB that says that it unpacks to 60 MB, twenty times."""
    one = zipped({"3D/3dmodel.model": b"\0" * 60_000_000})
    stream = io.BytesIO(one)
    with zipfile.ZipFile(stream, "a") as archive:
        entry = archive.infolist()[0]
        for number in range(20):
            again = zipfile.ZipInfo(f"{number}.model")
            again.compress_type, again.CRC = entry.compress_type, entry.CRC
            again.compress_size, again.file_size, again.header_offset = entry.compress_size, entry.file_size, 0
            archive.filelist.append(again)
            archive.NameToInfo[again.filename] = again
        archive._didModify = True  # type: ignore[attr-defined]
    return stream.getvalue()


LOOP = '<node id="m"><instance_node url="#m"/></node>'
ENTITY = b'<!DOCTYPE COLLADA [<!ENTITY a "1 1 1">]>'
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"a" * 64 + b"\nsize 12345\n"

BAD: dict[str, tuple[bytes | str, str]] = {
    "nothing.stl": (b"", "is empty"),
    "short.stl": (stl_bytes()[:-1], "take 284 bytes, and has 283"),
    "long.stl": (stl_bytes() + b"\0", "take 284 bytes, and has 285"),
    "empty.stl": (stl_bytes(faces=()), "holds no triangle"),
    "nan.stl": (stl_bytes(np.where(CORNERS == 3.0, np.nan, CORNERS)), "not finite"),
    "million.stl": (b"x".ljust(80) + struct.pack("<I", 10_000_000), "take 500000084 bytes|has 10000000 triangles"),
    "cut.STL": (stl_text()[:-60], "expected a facet"),
    "between.stl": (stl_text().rpartition("endsolid")[0], "no 'endsolid' stands behind its last facet"),
    "word.stl": (stl_text().replace("facet", "fazet", 1), "is not an STL|expected a facet"),
    "late.stl": (stl_text().replace("vertex 1", "vertx 1", 1), "line 2: expected a facet"),
    "number.stl": (stl_text().replace("1.000000e+00", "1.0e+0O", 1), "not a number"),
    "under.stl": (stl_text().replace("1.000000e+00", "1_0", 1), "not a number"),
    "far.stl": (stl_text().replace("1.000000e+00", "1e12", 1), "from the origin of the mesh"),
    "text.stl": (b"hello", "is not an STL"),
    "nothing.obj": (OBJ, "holds no triangle"),
    "word.obj": (OBJ + "g part\nfc 1 2 3\n", "line 10: the line starts with 'fc'"),
    "index.obj": (OBJ + "f 1 2 5\n", "'5' of a polygon is none of the 4 vertices"),
    "zero.obj": (OBJ + "f 0 1 2\n", "'0' of a polygon"),
    "vertex.obj": (OBJ + "v 1 2\n", "is not a vertex"),
    "infinite.obj": (OBJ + "v 1 2 inf\nf 1 2 5\n", "not finite"),
    "surface.obj": (OBJ + "surf 0 1 0 1\n", "free-form surface"),
    "cut.dae": (dae(PLAIN)[:-30], "is no XML"),
    "other.dae": ("<robot/>", "is not a COLLADA file"),
    "unplaced.dae": (dae(""), "holds no triangle"),
    "loop.dae": (dae(LOOP), "nests nodes deeper"),
    "missing.dae": (dae(PLAIN.replace("#g", "#h")), "which is no <geometry>"),
    "short.dae": (dae(PLAIN, positions="0 0 0 1 0 0"), "reaches beyond its numbers"),
    "nan.dae": (dae(PLAIN).replace(">0 0 0 1", ">0 0 nan 1", 1), "not finite"),
    "number.dae": (dae(PLAIN).replace(">0 0 0 1", ">0 0 x 1", 1), "not a number"),
    "lines.dae": (dae(PLAIN).replace("polylist", "lines"), "holds no triangle"),
    "vcount.dae": (dae(PLAIN).replace("3 3 3 3", "3 3 3 4"), "corners, not"),
    "entity.dae": (ENTITY + dae(PLAIN).split("?>")[1].encode(), "declares a document type"),
    "many.ply": (ply().replace(b"face 4", b"face 40000000"), "has 40000000 triangles"),
    "cut.ply": (ply()[:-20], "is cut off"),
    "cut.off": (off()[:-10], "is cut off"),
    "text.glb": (b"glTF", "is not a GLB file"),
    "text.3mf": (b"PK", "is no archive"),
    "bomb.3mf": (bomb(), "unpacks to"),
    "pointer.stl": (POINTER, "pointer of Git LFS.*git lfs pull"),
    "pointer.dae": (POINTER, "pointer of Git LFS"),
    "part.fbx": (b"x", "ends in '.fbx' is not read"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_broken_file_is_one_clear_error(name: str, tmp_path: Path) -> None:
    data, said = BAD[name]
    path = written(tmp_path, name, data)
    with pytest.raises(pb.InputError, match=said) as caught:
        read_mesh(path)
    (problem,) = caught.value.problems
    assert problem.source == str(path)
    assert problem.remedy


@pytest.mark.parametrize("damage", ["ends early", "is encrypted", "has an unknown compression"])
def test_an_archive_whose_entry_cannot_be_unpacked_is_one_error(damage: str, tmp_path: Path) -> None:
    """The directory at the end of the archive says more bytes than there are, or what this reader cannot do."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("part.dae", dae(PLAIN))
        if damage == "is encrypted":
            archive.infolist()[0].flag_bits |= 1
        elif damage == "has an unknown compression":
            archive.infolist()[0].compress_type = 77
        else:
            archive.infolist()[0].compress_size += 10_000
            archive.infolist()[0].file_size += 10_000
    data = packed.getvalue()
    if damage == "is encrypted":
        data = data[:6] + b"\x01" + data[7:]
    with pytest.raises(pb.InputError, match=r"is no ZAE file that can be read|is no archive"):
        read_mesh(written(tmp_path, "part.zae", data))


@pytest.mark.parametrize("installed", [True, False])
def test_text_that_is_not_utf8_is_damaged_whatever_guesses_its_encoding(
    installed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """trimesh guesses encodings by a library that it does not require."""
    if not installed:
        monkeypatch.setitem(sys.modules, "charset_normalizer", None)
    text = b'{"asset": "\xa3"}'.ljust(20)
    head = b"glTF" + struct.pack("<II", 2, 20 + len(text)) + struct.pack("<I", len(text)) + b"JSON"
    with pytest.raises(pb.InputError, match="is no GLB file that can be read"):
        read_mesh(written(tmp_path, "text.glb", head + text))


def test_a_module_that_a_format_needs_is_said_with_what_to_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import trimesh

    def without(*_: Any, **__: Any) -> None:
        raise ModuleNotFoundError("No module named 'networkx'", name="networkx")

    monkeypatch.setattr(trimesh, "load_scene", without)
    with pytest.raises(pb.UnsupportedError, match=r"a mesh in OFF needs networkx.*pip install 'pinbound\[meshes\]'"):
        read_mesh(written(tmp_path, "part.off", off()))


def test_what_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "folder.stl").mkdir()
    for name in ("folder.stl", "absent.stl"):
        with pytest.raises(pb.InputError):
            read_mesh(tmp_path / name)


def test_too_many_triangles_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.stl"
    with path.open("wb") as stream:  # a sparse file: it takes no disk, and must take no memory
        stream.write(b"x".ljust(80) + struct.pack("<I", MOST_TRIANGLES + 1))
        stream.truncate(84 + 50 * (MOST_TRIANGLES + 1))
    with pytest.raises(pb.InputError, match="has 1000001 triangles; up to 1000000 are read"):
        read_mesh(path)
    with (tmp_path / "huge.obj").open("wb") as stream:
        stream.truncate(2 * 2**30)
    with pytest.raises(pb.InputError, match="has 2048 MiB; up to 512 MiB"):
        read_mesh(tmp_path / "huge.obj")


def test_a_robot_reads_no_mesh_before_it_is_asked(tmp_path: Path) -> None:
    body = '<collision><geometry><mesh filename="no.stl"/></geometry></collision>'
    text = f'<robot name="r"><link name="a">{body}</link></robot>'
    robot = pb.load(written(tmp_path, "r.urdf", text))
    (body,) = collision_bodies(robot)
    assert isinstance(robot.document, Document)
    assert "no.stl: there is no such file beside r.urdf" in robot.meshes.fault(body)
    with pytest.raises(pb.InputError):
        robot.meshes.of(body)


def test_polygons_that_have_lost_corners_are_told(tmp_path: Path) -> None:
    """A file that is cut off within its last polygon ends in what could be a line."""
    whole = written(tmp_path, "whole.obj", OBJ + "f 1 2 3\nf 1 3 4\n")
    assert not read_mesh(whole).notes
    mesh = read_mesh(written(tmp_path, "cut.obj", OBJ + "f 1 2 3\nf 1 3"))
    assert len(mesh.triangles) == 1
    assert mesh.notes == ("polygons of fewer than three corners are not used (1)",)


def test_numbers_that_do_not_fit_give_an_error_and_no_warning(tmp_path: Path) -> None:
    """A signalling NaN of a binary STL, and an index of a PLY that no int32 holds."""
    record = struct.pack("<12f", *[0.0] * 12)[:-4] + (0x7FA00000).to_bytes(4, "little") + bytes(2)
    (tmp_path / "nan.stl").write_bytes(bytes(80) + (1).to_bytes(4, "little") + record)
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "index.ply").write_text(head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 99999999999\n")
    for name in ("nan.stl", "index.ply"):
        with pytest.raises(pb.InputError):
            read_mesh(tmp_path / name)
