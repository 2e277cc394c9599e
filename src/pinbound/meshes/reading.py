"""Reads a mesh from a file: first its size is checked, then the reader of its format is called."""

from __future__ import annotations

import stat
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pinbound.exceptions import MachineError, blames_the_path
from pinbound.meshes.dae import read_dae
from pinbound.meshes.mesh import MOST_BYTES, Mesh, checked, refuse, too_many
from pinbound.meshes.obj import read_obj
from pinbound.meshes.others import OTHERS, read_other
from pinbound.meshes.stl import read_stl, stl_triangles

__all__ = ["SUFFIXES", "read_mesh"]

SUFFIXES = (".stl", ".obj", ".dae", *OTHERS)
"""The endings of names of files that can be read, in capital or small letters."""

_POINTER = b"version https://git-lfs.github.com/"


def read_mesh(path: str | Path, scale: Sequence[float] = (1.0, 1.0, 1.0)) -> Mesh:
    r"""Read a mesh.

    Vertices are the numbers of the file times `scale`, in metres. In a DAE, the transformations of its nodes are
    applied. Its unit and its up-axis are not applied, as in Pinocchio's loader, and a note says so.

    Args:
        path: A file that ends in one of `SUFFIXES`.
        scale: Factors along x, y and z; a negative one mirrors.

    Raises:
        InputError: If the file is missing, empty, damaged, or holds more than `MOST_TRIANGLES` triangles or
            `MOST_BYTES` bytes. The error has one fault and its remedy.
        MachineError: If the machine fails while reading.

    Example:
        >>> import tempfile, pathlib
        >>> file = pathlib.Path(tempfile.mkdtemp()) / "corner.obj"
        >>> _ = file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        >>> read_mesh(file, scale=(1.0, -2.0, 1.0)).vertices[2].tolist()
        [0.0, -2.0, 0.0]
    """
    file = Path(path)
    source, suffix = str(path), file.suffix.lower()
    if suffix not in SUFFIXES:
        refuse(source, f"a file that ends in {suffix!r} is not read", f"Give one of: {', '.join(SUFFIXES)}")
    data = _bytes(file, source, suffix)
    if suffix == ".stl":
        vertices, triangles = read_stl(data, source)
        return checked(source, vertices, triangles, np.arange(len(triangles)), scale)
    if suffix == ".obj":
        vertices, triangles, polygons, notes = read_obj(data, source)
        return checked(source, vertices, triangles, polygons, scale, notes)
    if suffix == ".dae":
        vertices, triangles, polygons, notes = read_dae(data, source)
        return checked(source, vertices, triangles, polygons, scale, notes)
    vertices, triangles = read_other(data, suffix, source)
    return checked(source, vertices, triangles, np.arange(len(triangles)), scale)


def _bytes(file: Path, source: str, suffix: str) -> bytes:
    try:
        said = file.stat()
        if not stat.S_ISREG(said.st_mode):
            refuse(source, "is no file", "Name the file of a mesh")
        if not said.st_size:
            refuse(source, "is empty", "Export the mesh again")
        with file.open("rb") as stream:
            head = stream.read(84)
            stream.seek(0)
            if head.startswith(_POINTER):
                refuse(source, "is a pointer of Git LFS, not the mesh itself", "Run `git lfs pull` in its repository")
            if suffix == ".stl":
                too_many(source, stl_triangles(head, said.st_size) or 0)
            if said.st_size > MOST_BYTES:
                large = f"has {said.st_size / 2**20:.0f} MiB; up to {MOST_BYTES / 2**20:.0f} MiB are read"
                refuse(source, large, "Give a simpler mesh: collision bodies need some thousand triangles")
            return stream.read(MOST_BYTES)
    except (OSError, ValueError) as error:
        if isinstance(error, OSError) and not blames_the_path(error):
            raise MachineError(f"{source}: reading failed: {error.strerror}; try again once it can be read") from error
        if not isinstance(error, OSError) and type(error) is not ValueError:
            raise  # an InputError is also a ValueError
        refuse(source, f"cannot be read ({getattr(error, 'strerror', error)})", "Check the path and its permissions")
