"""The sets of an atlas as arrays of a file, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pinbound.freespace.pair_sets import AngleSet, BoxTree, PairSet
from pinbound.typing import AnyArray

__all__ = ["read_sets", "written_sets"]

_PARTS = {"numbers": np.float64, "codes": np.int8, "whole": np.uint32}
"""Arrays of a file, by type: each joins the arrays of all sets, and `counts` has their lengths."""

_COUNTS = {
    "angle": {"numbers": 6, "codes": 1, "whole": 0},
    "tree": {"numbers": 4, "codes": 2, "whole": 3},
}
"""Number of arrays of each type in a set."""


def written_sets(sets: Sequence[PairSet]) -> tuple[list[dict[str, Any]], dict[str, AnyArray]]:
    """Return the headers of sets, and the arrays."""
    parts = [_written(known) for known in sets]
    joined: dict[str, AnyArray] = {
        name: np.concatenate([np.empty(0, dtype=kind), *(array for one in parts for array in one[name])]).astype(kind)
        for name, kind in _PARTS.items()
    }
    counts = [len(array) for one in parts for name in _PARTS for array in one[name]]
    return [_header(known) for known in sets], {**joined, "counts": np.array(counts, dtype=np.int64)}


def read_sets(headers: Sequence[dict[str, Any]], arrays: Mapping[str, AnyArray]) -> list[PairSet]:
    """Return the sets that `written_sets` wrote."""
    at, counts, found = dict.fromkeys(_PARTS, 0), iter(arrays["counts"].tolist()), list[PairSet]()
    for header in headers:
        parts: dict[str, list[AnyArray]] = {name: [] for name in _PARTS}
        for name, many in _COUNTS[header["kind"]].items():
            for _ in range(many):
                size = next(counts)
                parts[name].append(arrays[name][at[name] : at[name] + size])
                at[name] += size
        found.append(_read(header, parts))
    return found


def _header(known: PairSet) -> dict[str, Any]:
    kind = "angle" if isinstance(known, AngleSet) else "tree"
    size = {"volume": known.volume, "free": known.free, "contact": known.contact, "work": known.work}
    return {"kind": kind, "slots": known.slots, **size}


def _written(known: PairSet) -> dict[str, Sequence[AnyArray]]:
    shared = [known.slot_free, known.slot_contact]
    if isinstance(known, AngleSet):
        numbers = [*shared, known.coefficients, known.low, known.high, known.edges]
        return {"numbers": numbers, "codes": [known.codes], "whole": []}
    assert isinstance(known, BoxTree)
    codes = [known.codes, np.packbits(known.members).view(np.int8)]
    whole = [known.touching, np.diff(known.first), known.listed]
    return {"numbers": [*shared, known.low, known.high], "codes": codes, "whole": whole}


def _read(header: dict[str, Any], parts: dict[str, list[AnyArray]]) -> PairSet:
    slots = int(header["slots"])
    numbers = parts["numbers"]
    size: dict[str, Any] = {name: header[name] for name in ("volume", "free", "contact", "work")}
    size |= {"slot_free": numbers[0], "slot_contact": numbers[1]}
    if header["kind"] == "angle":
        names = ("coefficients", "low", "high", "edges")
        return AngleSet(**size, **dict(zip(names, numbers[2:], strict=True)), codes=parts["codes"][0])
    touching, lengths, listed = parts["whole"]
    bits = np.unpackbits(parts["codes"][1].view(np.uint8))
    nodes = len(bits) // slots if slots else 0
    return BoxTree(
        **size,
        low=numbers[2],
        high=numbers[3],
        codes=parts["codes"][0],
        touching=touching.astype(np.intp),
        first=np.concatenate([[0], np.cumsum(lengths.astype(np.int64))]).astype(np.intp),
        listed=listed.astype(np.intp),
        members=bits[: nodes * slots].reshape(nodes, slots).astype(np.bool_),
    )
