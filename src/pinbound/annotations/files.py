"""Annotation files of four formats: a sidecar, an SRDF, a `robot.yaml`, an MJCF model."""

from __future__ import annotations

from pathlib import Path

from pinbound.annotations.gepetto import Found, is_gepetto, read_gepetto
from pinbound.annotations.sidecar import read_node, sidecar_items
from pinbound.annotations.srdf import read_srdf
from pinbound.exceptions import Problems
from pinbound.model.document import Document, parse_file

__all__ = ["read_annotation_file"]


def read_annotation_file(path: Path, problems: Problems, document: Document | None = None) -> Found:
    """Return the raw items of an annotation file, and notes about the parts that were not used.

    A file that ends in `.srdf` is an SRDF, one in `.xml` or `.mjcf` an MJCF model. Any other is YAML: Gepetto's
    `robot.yaml` if it has `closed_loop` or `name_mot`, else a sidecar.

    Args:
        path: The file.
        problems: Collects the faults.
        document: The URDF that the file annotates; None: not known, so files that need it are faults.
    """
    suffix = path.suffix.lower()
    if suffix == ".srdf":
        srdf = read_srdf(path, problems, None if document is None else document.root)
        return Found(srdf.items, srdf.notes)
    if suffix in (".xml", ".mjcf"):
        from pinbound.annotations.mjcf import read_mjcf  # late: few robots come with one

        return read_mjcf(parse_file(path), path.name, problems, document)
    node = read_node(path, problems)
    if node is None:
        return Found(())
    if is_gepetto(node):
        return read_gepetto(node, path.name, problems, None if document is None else document.root)
    return Found(tuple(sidecar_items(node, path, problems)))
