"""Meshes in files: found by the names that URDFs give them, read within stated limits, never from the network.

The result is that of Pinocchio's loader: the transformations of a DAE's nodes are applied, its unit and its up-axis are
not (`docs/meshes.md`).
"""

from pinbound.meshes.finding import find_mesh
from pinbound.meshes.mesh import MOST_BYTES, MOST_TRIANGLES, Mesh, pieces
from pinbound.meshes.reading import SUFFIXES, read_mesh

__all__ = ["MOST_BYTES", "MOST_TRIANGLES", "SUFFIXES", "Mesh", "find_mesh", "pieces", "read_mesh"]
