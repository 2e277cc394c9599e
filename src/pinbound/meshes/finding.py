"""Finds the file of a mesh by its name: package://, file://, relative and absolute names."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

from pinbound.meshes.mesh import refuse
from pinbound.model.xacro_child import find_package

__all__ = ["find_mesh"]

_PACKAGES = "Give the folder that holds the package: package_dirs=[...], or --package-dir"
_LOOKED = "package_dirs, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, CMAKE_PREFIX_PATH and beside the file"


def find_mesh(filename: str, beside: str | Path, package_dirs: Sequence[str | Path] = ()) -> Path:
    """Return the file that a URDF names.

    For ``package://NAME/REST``, each of `package_dirs` is searched first for NAME/REST, as Pinocchio does. Then the
    package NAME is searched where ROS would find it. Other names are relative to the folder of the URDF. No file is
    ever fetched from a network.

    Args:
        filename: The name as written in the URDF.
        beside: The path of the URDF.
        package_dirs: Folders that are packages, or that hold packages.

    Raises:
        InputError: If there is no such file.
    """
    scheme, found, rest = filename.partition("://")
    scheme = scheme.lower() if found else ""
    if not found:
        rest = filename
    if scheme in ("", "file"):
        named = [rest] if scheme == "" else [rest, unquote(rest)]
        for path in (Path(beside).parent / one for one in named if "\0" not in one):
            if _is_file(path):
                return path
        where = "" if os.path.isabs(rest) else f" beside {Path(beside).name}"
        refuse(filename, f"there is no such file{where}", "Correct the name, or put the mesh there")
    if scheme not in ("package", "model"):
        remedy = "Nothing is read from a network: save the file, and name it by package://, file:// or a path"
        refuse(filename, f"the address starts with {scheme}://", remedy)
    package, _, inside = rest.partition("/")
    path = None if "\0" in rest else next(filter(_is_file, _places(package, inside, beside, package_dirs)), None)
    if path is not None:
        return path
    folder = None if "\0" in rest else find_package(package, [*map(str, package_dirs)], str(beside), os.environ)
    if folder is None:
        refuse(filename, f"there is no package {package!r} in {_LOOKED}", _PACKAGES)
    refuse(filename, f"the package {folder[0]} has no file {inside!r}", "Correct the name, or put the mesh there")


def _places(package: str, inside: str, beside: str | Path, package_dirs: Sequence[str | Path]) -> Iterator[Path]:
    listed = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    prefixes = [os.environ.get(key, "").split(os.pathsep) for key in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")]
    shares = [os.path.join(one, "share") for prefix in prefixes for one in prefix if one]
    for folder in (*package_dirs, *(one for one in listed if one), *shares):
        yield Path(folder) / package / inside
    found = find_package(package, [*map(str, package_dirs)], str(beside), os.environ)
    if found is not None:
        yield Path(found[0]) / inside


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
