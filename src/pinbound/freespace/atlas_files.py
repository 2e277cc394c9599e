"""load_atlas(): reads an atlas from its file, if it was proven about the same robot and the same marks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np

from pinbound.certificates.records import Reason
from pinbound.certificates.scope import covered
from pinbound.freespace.atlas_format import read_sets
from pinbound.freespace.atlas_records import AtlasGroup, PairAtlas
from pinbound.freespace.proven_files import ATLAS, read_file
from pinbound.robot.robot import Robot

__all__ = ["load_atlas"]


def load_atlas(robot: Robot, path: str | Path, boundaries: Sequence[str] | None = None) -> PairAtlas:
    """Return the atlas that `PairAtlas.save` wrote, if it was proven about the same robot and the same marks.

    The file holds a hash of coordinates, limits, paths and thresholds, and a hash of its own contents. The second hash
    detects a damaged file, but not a forged one: use only atlases from people whom you trust.

    Args:
        robot: The robot.
        path: The file.
        boundaries: Names of the boundaries that the atlas must be about; None: all boundaries of the robot.

    Raises:
        InputError: If the file is not an atlas or is damaged, or if the atlas was proven about another robot, other
            limits, other marks or other boundaries.
        OSError: If the file cannot be read.

    Example:
        >>> import tempfile
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pb.pair_atlas(robot).save(folder + "/atlas.npz")
        ...     again = pb.load_atlas(robot, path)
        >>> again.where(robot.home).name
        'FREE'
    """
    header, given, chosen = read_file(Path(path), ATLAS, robot, boundaries)
    known = read_sets(header["sets"], given)
    own, groups = iter(known), list[AtlasGroup]()
    said = cast(list[tuple[list[str], list[int], int | None]], header["groups"])
    for names, columns, shared in said:
        one = next(own) if shared is None else groups[shared].known
        coordinates = tuple(robot.coordinates[j] for j in columns)
        groups.append(AtlasGroup(tuple(names), coordinates, np.array(columns, dtype=np.intp), one, shared))
    return PairAtlas(
        robot=robot,
        boundaries=tuple(header["boundaries"]),
        coverage=covered(robot, chosen),
        groups=tuple(groups),
        window={name: (float(low), float(high)) for name, (low, high) in header["window"].items()},
        reason=None if header["reason"] is None else Reason[header["reason"]],
        digest=header["digest"],
        work=header["work"],
        seconds=header["seconds"],
    )
