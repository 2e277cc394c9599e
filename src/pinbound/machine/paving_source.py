"""The source text of a round of paving, for LLVM: boxes, each with the pairs not yet proven clear in it, groups first.

It does the same as `freespace/held.py`, box by box. A node that is clear in the whole box is dropped. A pair that is in
contact in the whole box ends the box. A group that is too coarse is replaced by its halves. The other nodes are kept
for the halves of the box. It reads the tables of `freespace/quick_proofs.py`. `docs/free-space.md`.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from pinbound.machine.compiled import KernelSource
from pinbound.machine.motion_source import put_part
from pinbound.machine.proof_source import BOUND, COARSE
from pinbound.tolerances import INFLATION

__all__ = ["PAVING_HEAD", "PAVING_RESULT", "paving_source"]

PAVING_HEAD: Final = 2
"""At the head of a question: the positions of the boxes, and of the lists of nodes."""

PAVING_RESULT: Final = 5
"""Data of a box in the answer: 0 clear, 1 in contact, 2 open; start and length of its list, the coordinate in which to
halve it (if in contact, the pair that is in contact), the least lower bound."""

_LANES: Final = 8


@cache
def paving_source() -> KernelSource:
    """Return the source; it has the prototype of all kernels, with its tables in place of scratch."""
    text = put_part(put_part(_PAVING, "BOUND", BOUND), "UPPER", _UPPER)
    for name, value in (("INFLATION", INFLATION), ("HEAD", PAVING_HEAD), ("RESULT", PAVING_RESULT), ("COARSE", COARSE)):
        text = text.replace(f"${name}", repr(value))
    return KernelSource(text, 0, _LANES)


_UPPER = """
both = cubic + bent_up
both = (0.5 * second if 0.5 * second < both else both) * $INFLATION + error * total
far, aside = norm + linear * $INFLATION, moved * $INFLATION
most = math.sqrt(far * far + aside * aside) * $INFLATION + both
far = norm + aside + error * total
upper = (far if far < most else most) - threshold + error
"""
"""An upper bound of the clearance of a pair over the box, after its lower bound."""

_PAVING = """
n, nodes, pairs, most_turns = np.int64(w[0]), np.int64(w[1]), np.int64(w[2]), np.int64(w[3])
centre, half, slopes = 8, 8 + n, 8 + 2 * n
cosines = 8 + 3 * n
sines = cosines + most_turns
paces = sines + most_turns
tails = paces + most_turns
crosses = tails + 3 * most_turns
todo = crosses + 3 * most_turns
results = todo + row
kept = results + $RESULT * count
size, bounded, filled = 2 * n + 2, 0, 0
for b in range(count):
    entry = np.int64(Q[0]) + size * (column + b)
    for j in range(n):
        low, high = Q[entry + j], Q[entry + n + j]
        x = 0.5 * (low + high)
        up, down = high - x, x - low
        out[centre + j] = x
        out[half + j] = (up if up > down else down) * $INFLATION + Q[$HEAD + j]
    list, length = np.int64(Q[1]) + np.int64(Q[entry + 2 * n]), np.int64(Q[entry + 2 * n + 1])
    result, first, status, least, across = results + $RESULT * b, filled, 0, math.inf, 0
    place, stacked = 0, 0
    while place < length or stacked > 0:
        node = 0
        if stacked > 0:
            stacked -= 1
            node = np.int64(out[todo + stacked])
        else:
            node = np.int64(Q[list + place])
            place += 1
        item = nodes + 4 * node
        pair, extra, first_half = np.int64(w[item]), w[item + 1], np.int64(w[item + 2])
        data, k = np.int64(w[pairs + 2 * pair]), np.int64(w[pairs + 2 * pair + 1])
        bounded += 1
        @BOUND
        if lower > 0.0:
            continue
        if first_half < 0:
            @UPPER
            if upper < 0.0:
                status, across = 1, node
                break
        else:
            reach = rest + linear
            if extra >= reach or value + reach <= 0.0 or (value <= 0.0 and extra >= $COARSE * reach):
                out[todo + stacked] = w[item + 2]
                stacked += 1
                if w[item + 3] >= 0.0:
                    out[todo + stacked] = w[item + 3]
                    stacked += 1
                continue
        out[kept + filled] = node
        if lower < least:
            least = lower
            out[kept + filled] = out[kept + first]
            out[kept + first] = node
            across, longest, is_steep = 0, -1.0, 1 if value > 0.0 and linear >= rest else 0
            for j in range(n):
                x = (abs(out[slopes + j]) if is_steep > 0 else w[weights + j]) * out[half + j]
                across = j if x > longest else across
                longest = x if x > longest else longest
        filled += 1
        status = 2
    if status < 2:
        filled = first
    out[result], out[result + 1], out[result + 2] = status, first, filled - first
    out[result + 3], out[result + 4] = across, least
return bounded
"""
"""`count` boxes from `column` on; `row` is the space for the requested nodes."""
