"""The meshes of a robot's bodies, each in the frame of its link, read when they are first asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pinbound.coverage.bodies import Body
from pinbound.exceptions import InputError

if TYPE_CHECKING:
    from pinbound.meshes import Mesh

__all__ = ["MeshSource"]


class MeshSource:
    r"""Finds and reads the meshes that a URDF names; each file once.

    Example:
        >>> import tempfile
        >>> import numpy as np
        >>> folder = Path(tempfile.mkdtemp())
        >>> _ = (folder / "tip.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        >>> up = np.array([0.0, 0.0, 1.0])
        >>> tip = Body("hand", 0, "mesh", (), np.eye(3), up, filename="tip.obj", scale=(2.0, 1.0, 1.0))
        >>> MeshSource(folder / "hand.urdf").of(tip).vertices.tolist()
        [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    """

    def __init__(self, beside: str | Path, package_dirs: Sequence[str | Path] = ()) -> None:
        """Take the URDF, and the folders in which `package://` is looked up."""
        self._beside, self._package_dirs = Path(beside), tuple(map(str, package_dirs))
        self._read: dict[tuple[str, tuple[float, float, float]], Mesh | InputError] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle without the meshes that were read."""
        return MeshSource, (self._beside, self._package_dirs)

    def of(self, body: Body) -> Mesh:
        """Return the mesh of a body in the frame of its link [m]: scaled, then placed by the body's origin.

        Raises:
            InputError: If there is no such file, or it is damaged or too large.
        """
        found = self._found(body)
        if isinstance(found, InputError):
            raise found
        return found.placed(body.rotation, body.translation)

    def path(self, body: Body) -> Path:
        """Return the file of a body's mesh.

        Raises:
            InputError: If there is no such file.
        """
        from pinbound.meshes import find_mesh

        return find_mesh(body.filename, self._beside, self._package_dirs)

    def fault(self, body: Body) -> str:
        """Return why the mesh of a body cannot be read, in one line; empty if it can be."""
        found = self._found(body)
        return str(found) if isinstance(found, InputError) else ""

    def notes(self, body: Body) -> tuple[str, ...]:
        """Return one sentence for each part of the file that was not used; none for a file that cannot be read."""
        found = self._found(body)
        return () if isinstance(found, InputError) else tuple(f"{body.filename}: {note}" for note in found.notes)

    def _found(self, body: Body) -> Mesh | InputError:
        from pinbound.meshes import find_mesh, read_mesh

        key = body.filename, body.scale
        if key not in self._read:
            try:
                self._read[key] = read_mesh(find_mesh(body.filename, self._beside, self._package_dirs), body.scale)
            except InputError as error:
                self._read[key] = error
        return self._read[key]
