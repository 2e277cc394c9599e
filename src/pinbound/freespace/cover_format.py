"""The file of a cover: NPZ with a header in JSON, and a hash of all that it holds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from pinbound.exceptions import InputError, Problem
from pinbound.freespace.digest import content_digest
from pinbound.tables.arrays import DAMAGE
from pinbound.tables.rules import pass_on
from pinbound.typing import AnyArray

__all__ = ["read_file", "refused", "write_file"]

_KIND = "pinbound cover 1"
_ARRAYS = ("at", "boxes", "open", "share", "rows", "counts")


def write_file(path: Path, header: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> Path:
    """Write a header and arrays.

    Raises:
        OSError: If the file cannot be written.
    """
    text = json.dumps(dict(header))
    content = content_digest(text, *(arrays[name] for name in _ARRAYS))
    texts = {"kind": np.array(_KIND), "header": np.array(text), "content": np.array(content)}
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **cast(Any, {**arrays, **texts}))
    return path


def read_file(path: Path) -> tuple[dict[str, Any], dict[str, AnyArray]]:
    """Return what `write_file` wrote.

    Raises:
        InputError: If the file is none that it wrote, or is damaged.
        OSError: If it cannot be read.
    """
    with path.open("rb") as stream:
        try:
            with np.load(stream, allow_pickle=False) as file:
                given: dict[str, AnyArray] = {name: file[name] for name in (*_ARRAYS, "kind", "header", "content")}
            if str(given["kind"]) != _KIND:
                raise KeyError("kind")
            text = str(given["header"])
            header: dict[str, Any] = json.loads(text)
        except (*DAMAGE, OSError) as error:
            pass_on(error)
            raise refused(path, "this is no cover, or one that is damaged") from error
    if content_digest(text, *(given[name] for name in _ARRAYS)) != str(given["content"]):
        raise refused(path, "this cover is damaged: its contents are not those that were saved")
    return header, given


def refused(path: Path, what: str) -> InputError:
    """Return the error that says why a file is not taken."""
    return InputError([Problem(what, "Make it again with pb.certified_cover(robot) and .save(path)", str(path))])
