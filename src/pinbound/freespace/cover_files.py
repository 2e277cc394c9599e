"""load_cover(): reads a cover from its file, if it was proven about the same robot and the same marks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from pinbound.certificates.records import Reason
from pinbound.certificates.scope import covered
from pinbound.freespace.cover_records import NUMBERS, TEXTS, ConvexSet, FreeCover
from pinbound.freespace.proven_files import COVER, read_file
from pinbound.robot.robot import Robot

__all__ = ["load_cover"]


def load_cover(robot: Robot, path: str | Path, boundaries: Sequence[str] | None = None) -> FreeCover:
    """Return the cover that `FreeCover.save` wrote, if it was proven about the same robot and the same marks.

    The file holds a hash of coordinates, limits, paths and thresholds, and a hash of its own contents. The second hash
    detects a damaged file, but not a forged one: use only covers from people whom you trust.

    Args:
        robot: The robot.
        path: The file.
        boundaries: Names of the boundaries that the cover must be about; None: all boundaries of the robot.

    Raises:
        InputError: If the file is not a cover or is damaged, or if the cover was proven about another robot, other
            limits, other marks or other boundaries.
        OSError: If the file cannot be read.

    Example:
        >>> import tempfile
        >>> import pinbound as pb
        >>> robot = pb.load("minervabot_v3")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pb.certified_cover(robot).save(folder + "/cover.npz")
        ...     again = pb.load_cover(robot, path)
        >>> again.contains(robot.home)
        True
    """
    header, given, chosen = read_file(Path(path), COVER, robot, boundaries)
    k, rows = len(header["coordinates"]), given["rows"]
    parts = np.split(rows, np.cumsum(given["counts"])[:-1]) if len(given["counts"]) else []
    reason = None if header["reason"] is None else Reason[header["reason"]]
    texts = {name: _tuples(header[name]) for name in TEXTS}
    numbers = {name: header[name] for name in NUMBERS}
    return FreeCover(
        **cast(Any, texts | numbers),
        at=given["at"],
        coverage=covered(robot, chosen),
        boxes=given["boxes"],
        open=given["open"],
        share=given["share"],
        polytopes=tuple(ConvexSet(one[:, :k], one[:, k]) for one in parts),
        reason=reason,
    )


def _tuples(value: Any) -> Any:
    return tuple(cast(Any, value)) if isinstance(value, list) else value
