"""The frame on its path in which a chain is written: the one with the fewest rotated offsets, then coordinates."""

from __future__ import annotations

import numpy as np

from pinbound.path.chain import Chain, are_parallel
from pinbound.tolerances import REDUCTION
from pinbound.typing import Array, Ints

__all__ = ["best_frame"]


def best_frame(chain: Chain, last_is_ancestor: bool) -> int:
    """Return the position of the frame with the fewest rotated offsets and, among these, the fewest coordinates.

    Among equal frames, an end of the chain that does not rotate in the ancestor's frame is chosen, and then the first.
    """
    used = np.any(chain.offsets, axis=1) | np.any(chain.slides, axis=(1, 2))
    turning = _coordinates_between(chain)[:, used]
    rotated, coordinates = np.count_nonzero(turning, axis=1).tolist(), np.sum(turning, axis=1).tolist()
    k = chain.rotations

    def cost(position: int) -> tuple[int, int, bool, int]:
        return rotated[position], coordinates[position], last_is_ancestor and position != k, position

    return min(range(k + 1), key=cost)


def _coordinates_between(chain: Chain) -> Ints:
    """Count the coordinates in the angle between any two positions, (k + 1, k + 1); parallel rotations are merged.

    Rotations form runs of parallel axes. The angle between positions in two runs is the rest of the first run, all runs
    in between, and the beginning of the last run. So only pairs within one run are summed one by one.
    """
    k, starts = chain.rotations, _runs(chain.axes)
    counts = np.zeros((k + 1, k + 1), dtype=np.int64)
    if not k:
        return counts
    ends = [*starts[1:], k]
    left, had, whole = np.zeros(k, dtype=np.int64), np.zeros(k, dtype=np.int64), [0]
    for start, end in zip(starts, ends, strict=True):
        turned = np.sign(chain.axes[start:end] @ chain.axes[start])[:, None] * chain.coefficients[start:end]
        for first in range(end - start):
            sums = np.cumsum(turned[first:], axis=0)
            counts[start + first, start + first + 1 : end + 1] = np.count_nonzero(np.abs(sums) > REDUCTION, axis=1)
        left[start:end], had[start:end] = counts[start:end, end], counts[start, start + 1 : end + 1]
        whole.append(whole[-1] + int(counts[start, end]))
    run = np.repeat(np.arange(len(starts)), np.diff([*starts, k]))
    before = np.array(whole)
    between = (left - before[run + 1])[:, None] + (before[run] + had)
    counts[:k, 1:] += np.where(run[:, None] < run, between, 0)
    return counts + counts.T


def _runs(axes: Array) -> list[int]:
    """Return the starts of runs of rotations about parallel axes."""
    starts: list[int] = []
    for position, axis in enumerate(axes):
        if not starts or not are_parallel(axes[starts[-1]], axis):
            starts.append(position)
    return starts
