"""Hulls of meshes: `mesh="package://..."` of a hull is read here, and gives the vertices of its hull."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pinbound.annotations.shapes import extreme_vertices
from pinbound.exceptions import InputError
from pinbound.geometry.rotations import rpy_matrix
from pinbound.typing import Array
from pinbound.values import read_only

if TYPE_CHECKING:
    from pinbound.annotations.records import RawItem

__all__ = ["HullFiles", "mesh_vertices"]

Vector = tuple[float, float, float]


class HullFiles:
    r"""Finds and reads the meshes that hulls name; each file is read once, with each scale.

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> _ = (folder / "tip.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0.2 0.2 0\nf 1 2 3\nf 1 2 4\n")
        >>> HullFiles(folder / "hand.urdf").vertices("tip.obj", scale=(2.0, 1.0, 1.0), xyz=(0.0, 0.0, 0.5)).tolist()
        [[0.0, 0.0, 0.5], [2.0, 0.0, 0.5], [0.0, 1.0, 0.5]]
    """

    def __init__(self, beside: str | Path = "annotations", package_dirs: Sequence[str | Path] = ()) -> None:
        """Store the file in whose folder relative names are searched, and the folders of packages."""
        self._beside, self._package_dirs = Path(beside), tuple(map(str, package_dirs))
        self._read: dict[tuple[str, Vector, str], Array] = {}
        self._said: dict[str, None] = {}

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each file that was read, and for each part that was not used."""
        return tuple(self._said)

    def vertices(
        self,
        mesh: str,
        scale: Vector = (1.0, 1.0, 1.0),
        xyz: Vector = (0.0, 0.0, 0.0),
        rpy: Vector = (0.0, 0.0, 0.0),
        folder: str = "",
    ) -> Array:
        """Return the extreme vertices (k, 3) of a mesh in the frame of its link [m].

        Args:
            mesh: A name in the form of a URDF.
            scale: Factors along x, y and z; a negative factor mirrors.
            xyz: Position of the mesh's origin [m].
            rpy: Roll, pitch, yaw of the mesh [rad], as in a URDF's `<origin>`.
            folder: The folder in which relative names are searched, if it is not the folder of `beside`.

        Raises:
            InputError: If the file does not exist, is damaged, or is too large.
        """
        from pinbound.meshes import find_mesh, read_mesh

        key = mesh, scale, folder
        if key not in self._read:
            beside = Path(folder) / "annotations" if folder else self._beside
            found = read_mesh(find_mesh(mesh, beside, self._package_dirs), scale)
            extreme = extreme_vertices(found.vertices)
            self._read[key] = read_only(extreme)
            self._said[f"{mesh}: {len(extreme)} of {len(found.vertices)} vertices make its hull"] = None
            self._said.update({f"{mesh}: {note}": None for note in found.notes})
        return self._read[key] @ rpy_matrix(rpy).T + np.array(xyz)


def mesh_vertices(
    item: RawItem,
    files: HullFiles,
    vector: Callable[[str], Vector | None],
    fault: Callable[[str, str], None],
) -> Array | None:
    """Return the vertices (k, 3) of a hull whose `mesh` names a file [m]; None after a fault.

    Args:
        item: The hull as written.
        files: Reads the mesh.
        vector: Returns a field's three numbers, or reports why this is not possible.
        fault: Receives the fault and its remedy.
    """
    name = item.fields.get("name")
    placed = {key: vector(key) for key in ("scale", "xyz", "rpy") if key in item.fields}
    given = {key: numbers for key, numbers in placed.items() if numbers is not None}
    if len(given) < len(placed):
        return None
    if 0.0 in given.get("scale", ()):
        fault(f"scale of hull {name!r} is {item.fields['scale']!r}", "Give factors other than zero")
        return None
    try:
        return files.vertices(str(item.fields["mesh"]).strip(), folder=item.folder, **given)
    except InputError as error:
        for one in error.problems:
            fault(f"the mesh of hull {name!r} cannot be read: {one.source}: {one.message}", one.remedy)
        return None
