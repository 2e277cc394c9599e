"""Files of proven results: NPZ with a header in JSON, and a hash of the whole content."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from pinbound.boundaries.boundary import Boundary
from pinbound.certificates.constraints import select
from pinbound.exceptions import InputError, Problem
from pinbound.freespace.digest import content_digest, robot_digest
from pinbound.robot.robot import Robot
from pinbound.tables.arrays import DAMAGE
from pinbound.tables.rules import pass_on
from pinbound.typing import AnyArray
from pinbound.units import several

__all__ = ["ATLAS", "COVER", "Sort", "read_file", "write_file"]


@dataclass(frozen=True)
class Sort:
    """A kind of file.

    Attributes:
        kind: The identifier in the file, with the version of its format.
        name: The name for people.
        made_by: The call that makes the content.
        arrays: Names of its arrays.
    """

    kind: str
    name: str
    made_by: str
    arrays: tuple[str, ...]

    def refused(self, path: Path, what: str) -> InputError:
        """Return the error that says why a file is refused."""
        return InputError([Problem(what, f"Make it again with {self.made_by} and .save(path)", str(path))])


COVER: Final = Sort(
    "pinbound cover 1",
    "cover",
    "pb.certified_cover(robot)",
    ("at", "boxes", "open", "share", "rows", "counts"),
)
ATLAS: Final = Sort(
    "pinbound atlas 1",
    "atlas",
    "pb.pair_atlas(robot)",
    ("numbers", "codes", "whole", "counts"),
)


def write_file(path: Path, sort: Sort, header: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> Path:
    """Write a header and arrays to a new file beside the path, and then rename it, so that no file is half replaced.

    Raises:
        OSError: If the file cannot be written.
    """
    text = json.dumps(dict(header))
    content = content_digest(text, *(arrays[name] for name in sort.arrays))
    texts = {"kind": np.array(sort.kind), "header": np.array(text), "content": np.array(content)}
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with beside.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **cast(Any, {**arrays, **texts}))
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
    return path


def read_file(
    path: Path, sort: Sort, robot: Robot, boundaries: Sequence[str] | None
) -> tuple[dict[str, Any], dict[str, AnyArray], tuple[Boundary, ...]]:
    """Return what `write_file` wrote, and the robot's boundaries that it was proven about.

    Args:
        path: The file.
        sort: The kind of file.
        robot: The robot.
        boundaries: Names of the boundaries that the proof must be about; None: all of the robot.

    Raises:
        InputError: If the file was not written by it, is damaged, or was proven about another robot, or other limits,
            marks or boundaries.
        OSError: If it cannot be read.
    """
    header, given = _contents(path, sort)
    names = header["boundaries"]
    missing = [name for name in names if name not in robot.boundaries.names]
    chosen = () if missing or not names else tuple(select(robot, names))
    if missing or robot_digest(robot, chosen) != header["digest"]:
        differ = f"whose limits or marks differ from those that {robot.name!r} has now"
        raise sort.refused(path, f"the {sort.name} is of {header['robot']!r} {differ}")
    wanted = robot.boundaries.names if boundaries is None else tuple(boundaries)
    if set(wanted) != set(names):
        apart = [f"it is not about {name!r}" for name in wanted if name not in names][:1]
        apart = apart or [f"it is also about {name!r}" for name in names if name not in wanted][:1]
        said = f"the {sort.name} is about {several(len(names), 'boundary')}, and {len(wanted)} are wanted: {apart[0]}"
        remedy = f"Make it again with {sort.made_by} and .save(path), or give boundaries={tuple(names)!r}"
        raise InputError([Problem(said, remedy, str(path))])
    return header, given, chosen


def _contents(path: Path, sort: Sort) -> tuple[dict[str, Any], dict[str, AnyArray]]:
    with path.open("rb") as stream:
        try:
            with np.load(stream, allow_pickle=False) as file:
                given: dict[str, AnyArray] = {name: file[name] for name in (*sort.arrays, "kind", "header", "content")}
            if str(given["kind"]) != sort.kind:
                raise KeyError("kind")
            text = str(given["header"])
            header: dict[str, Any] = json.loads(text)
        except (*DAMAGE, OSError) as error:
            pass_on(error)
            raise sort.refused(path, f"this is no {sort.name}, or one that is damaged") from error
    if content_digest(text, *(given[name] for name in sort.arrays)) != str(given["content"]):
        raise sort.refused(path, f"this {sort.name} is damaged: its contents are not those that were saved")
    return header, given
