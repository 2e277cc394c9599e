"""The source text of the proof over a polytope, for LLVM: boxes of pairs, halved until each is clear, or beyond a face.

It does the same as `freespace/proving.py`, box by box, the last one first: an affine lower bound, then a face that the
box lies beyond, or up to four faces weighed against the slope. Parts that must be cut off are returned to Python. It
reads the tables of `freespace/quick_proofs.py`. `docs/free-space.md`.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from pinbound.machine.compiled import KernelSource
from pinbound.machine.motion_source import put_part
from pinbound.tolerances import INFLATION

__all__ = ["BOUND", "COARSE", "PROOF_HEAD", "proof_source"]

PROOF_HEAD: Final = 8
"""At the head of a question: budget, size of the stack, number of boxes on it, faces, unit of rounding, margin, share
of the distance, the smallest box."""

_LANES: Final = 8
_WEIGHINGS: Final = 4
_NARROW: Final = 0.02
COARSE: Final = 0.25
"""Share of the change of a group's clearance over a box: a group with a larger error is left where it is not clear."""


@cache
def proof_source() -> KernelSource:
    """Return the source; it has the prototype of all kernels, with its tables in place of scratch."""
    text = put_part(put_part(_PROOF, "BOUND", BOUND), "WEIGH", _WEIGH)
    for name, value in (
        ("INFLATION", INFLATION),
        ("HEAD", PROOF_HEAD),
        ("WEIGHINGS", _WEIGHINGS),
        ("NARROW", _NARROW),
        ("COARSE", COARSE),
    ):
        text = text.replace(f"${name}", repr(value))
    return KernelSource(text, 0, _LANES)


BOUND: Final = """
threshold, error = w[data], w[data + 1]
coefficients = data + 2
axes = coefficients + k * n
offsets = axes + 3 * k
arms = offsets + 3 * k + 3
weights = arms + k
total, second, moved, third, down, bent_up = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
for i in range(k):
    phi, wide, c = 0.0, 0.0, coefficients + i * n
    for j in range(n):
        phi += w[c + j] * out[centre + j]
        wide += abs(w[c + j]) * out[half + j]
    out[cosines + i], out[sines + i] = math.cos(phi), math.sin(phi)
    out[paces + i] = wide
    before = total
    total += wide
    second += w[arms + i] * (total * total - before * before)
    third += w[arms + i] * (total * total * total - before * before * before)
    moved += w[arms + i] * wide
rx, ry, rz = w[offsets + 3 * k], w[offsets + 3 * k + 1], w[offsets + 3 * k + 2]
for back in range(k):
    i = k - 1 - back
    x, y, z = w[axes + 3 * i], w[axes + 3 * i + 1], w[axes + 3 * i + 2]
    cos, sin = out[cosines + i], out[sines + i]
    along = (x * rx + y * ry + z * rz) * (1.0 - cos)
    tx = rx * cos + along * x + sin * (y * rz - z * ry)
    ty = ry * cos + along * y + sin * (z * rx - x * rz)
    tz = rz * cos + along * z + sin * (x * ry - y * rx)
    out[tails + 3 * i], out[tails + 3 * i + 1], out[tails + 3 * i + 2] = tx, ty, tz
    rx, ry, rz = tx + w[offsets + 3 * i], ty + w[offsets + 3 * i + 1], tz + w[offsets + 3 * i + 2]
norm = math.sqrt(rx * rx + ry * ry + rz * rz)
rx, ry, rz = rx / norm, ry / norm, rz / norm
if not norm > 0.0:
    rx, ry, rz = 0.0, 0.0, 0.0
for j in range(n):
    out[slopes + j] = 0.0
for i in range(k):
    x, y, z, c = w[axes + 3 * i], w[axes + 3 * i + 1], w[axes + 3 * i + 2], coefficients + i * n
    tx, ty, tz = out[tails + 3 * i], out[tails + 3 * i + 1], out[tails + 3 * i + 2]
    rate = rx * (y * tz - z * ty) + ry * (z * tx - x * tz) + rz * (x * ty - y * tx)
    for j in range(n):
        out[slopes + j] += rate * w[c + j]
    px, py, pz = y * tz - z * ty, z * tx - x * tz, x * ty - y * tx
    out[crosses + 3 * i], out[crosses + 3 * i + 1] = ry * z - rz * y, rz * x - rx * z
    out[crosses + 3 * i + 2] = rx * y - ry * x
    cos, sin = out[cosines + i], 0.0 - out[sines + i]
    for a in range(i + 1):
        m = crosses + 3 * a
        ax, ay, az = out[m], out[m + 1], out[m + 2]
        bend = (ax * px + ay * py + az * pz) * out[paces + i] * out[paces + a]
        sunk = 0.5 * (0.0 - bend if bend < 0.0 else 0.0)
        down += sunk if a == i else abs(bend)
        bent_up += 0.5 * abs(bend) if a == i else abs(bend)
        along = (x * ax + y * ay + z * az) * (1.0 - cos)
        out[m] = ax * cos + along * x + sin * (y * az - z * ay)
        out[m + 1] = ay * cos + along * y + sin * (z * ax - x * az)
        out[m + 2] = az * cos + along * z + sin * (x * ay - y * ax)
    along = (x * rx + y * ry + z * rz) * (1.0 - cos)
    tx = rx * cos + along * x + sin * (y * rz - z * ry)
    ty = ry * cos + along * y + sin * (z * rx - x * rz)
    tz = rz * cos + along * z + sin * (x * ry - y * rx)
    rx, ry, rz = tx, ty, tz
linear = 0.0
for j in range(n):
    linear += abs(out[slopes + j]) * out[half + j]
cubic = third / 6.0 + error * total * total
third = cubic + down
rest = (0.5 * second if 0.5 * second < third else third) * $INFLATION + error * total
value = norm - threshold - error - extra
sunk = moved * $INFLATION + error * total
bent = rest + linear * $INFLATION
lower = value - (sunk if sunk < bent else bent)
"""
"""Clearance of a pair at the centre minus all rounding, its slope, the reduction over the box, the lower bound."""

_WEIGH = """
constant = value - rest
for j in range(n):
    out[tilted + j] = out[slopes + j]
for turn in range($WEIGHINGS):
    worst, face = 0.0, -1
    for f in range(faces):
        a, beyond = $HEAD + 3 * n + f * (n + 1), 0.0 - Q[$HEAD + 3 * n + f * (n + 1) + n]
        for j in range(n):
            s = out[tilted + j]
            side = 1.0 if s > 0.0 else (-1.0 if s < 0.0 else 0.0)
            beyond += Q[a + j] * (out[centre + j] - side * out[half + j])
        face = f if beyond > worst else face
        worst = beyond if beyond > worst else worst
    if face < 0:
        break
    a = $HEAD + 3 * n + face * (n + 1)
    distance, chosen, most = Q[a + n], 0.0, -1e300
    for j in range(n):
        distance -= Q[a + j] * out[centre + j]
    for j in range(n):
        if Q[a + j] == 0.0:
            continue
        weight = 0.0 - out[tilted + j] / Q[a + j]
        if not weight > 0.0 or weight > 1e100:
            continue
        spread = 0.0
        for l in range(n):
            spread += abs(out[tilted + l] + weight * Q[a + l]) * out[half + l]
        x = constant - weight * distance - spread * $INFLATION
        chosen = weight if x > most else chosen
        most = x if x > most else most
    if not chosen > 0.0:
        break
    lost = 0.0
    for j in range(n):
        lost += (abs(out[tilted + j]) + chosen * abs(Q[a + j])) * Q[far + j]
        out[tilted + j] += chosen * Q[a + j]
    lost = lost * unit
    constant = constant - chosen * distance - lost
    lower = most - lost if most - lost > lower else lower
    if lower > 0.0:
        break
"""
"""A better lower bound over the part of the box in the polytope: faces weighed against the slope, the worst first."""

_PROOF = """
n, nodes, pairs = np.int64(w[0]), np.int64(w[1]), np.int64(w[2])
most_turns = np.int64(w[3])
budget, room, filled, faces = Q[0], np.int64(Q[1]), np.int64(Q[2]), np.int64(Q[3])
unit, margin, share, smallest = Q[4], Q[5], Q[6], Q[7]
seed, far = $HEAD, $HEAD + n
centre, half, slopes, tilted = 8, 8 + n, 8 + 2 * n, 8 + 3 * n
cosines = 8 + 4 * n
sines = cosines + most_turns
paces = sines + most_turns
tails = paces + most_turns
crosses = tails + 3 * most_turns
queue = crosses + 3 * most_turns
size, boxes, stop = 1 + 2 * n, 0, 0
while filled > 0:
    if boxes >= budget or filled + 2 > room:
        stop = 2
        break
    entry = queue + size * (filled - 1)
    node = nodes + 4 * np.int64(out[entry])
    pair, extra = np.int64(w[node]), w[node + 1]
    data, k = np.int64(w[pairs + 2 * pair]), np.int64(w[pairs + 2 * pair + 1])
    for j in range(n):
        low, high = out[entry + 1 + j], out[entry + 1 + n + j]
        x = 0.5 * (low + high)
        up, down = high - x, x - low
        out[centre + j], out[half + j] = x, (up if up > down else down) * $INFLATION
    boxes += 1
    @BOUND
    if lower > 0.0:
        filled -= 1
        continue
    is_beyond = 0
    for f in range(faces):
        a, least = $HEAD + 3 * n + f * (n + 1), 0.0 - Q[$HEAD + 3 * n + f * (n + 1) + n]
        for j in range(n):
            least += Q[a + j] * out[centre + j] - abs(Q[a + j]) * out[half + j]
        if least > 0.0:
            is_beyond = 1
            break
    if is_beyond > 0:
        filled -= 1
        continue
    @WEIGH
    if lower > 0.0:
        filled -= 1
        continue
    first_half = np.int64(w[node + 2])
    if first_half >= 0:
        reach = rest
        for j in range(n):
            reach += abs(out[slopes + j]) * out[half + j]
        if extra >= reach or (value <= 0.0 and extra >= $COARSE * reach):
            out[entry] = w[node + 2]
            if w[node + 3] >= 0.0:
                other = queue + size * filled
                for j in range(2 * n):
                    out[other + 1 + j] = out[entry + 1 + j]
                out[other] = w[node + 3]
                filled += 1
            continue
    else:
        steep, away, distance, extent, widest = 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(n):
            x, s, h = out[centre + j] - Q[seed + j], out[slopes + j], out[half + j]
            own = 1.0 if w[weights + j] > 0.0 else 0.0
            steep += s * s
            away -= s * x
            distance += own * x * x
            extent += own * h * h
            h = own * h
            widest = h if h > widest else widest
        steep, distance, extent = math.sqrt(steep), math.sqrt(distance), math.sqrt(extent)
        x = margin * steep
        x = x if x < share * away else share * away
        is_ripe = rest <= 0.25 * x and value <= rest + 0.25 * x
        is_small = (value <= rest and extent <= $NARROW * distance) or extent <= 0.1 * $NARROW * distance
        is_close = is_small and away <= $NARROW * distance * steep
        if is_ripe or is_close or widest < smallest:
            stop = 1
            break
    across, longest = 0, -1.0
    for j in range(n):
        x = w[weights + j] * out[half + j]
        across = j if x > longest else across
        longest = x if x > longest else longest
    other = queue + size * filled
    for j in range(size):
        out[other + j] = out[entry + j]
    middle = 0.5 * (out[entry + 1 + across] + out[entry + 1 + n + across])
    if Q[seed + across] < middle:
        out[entry + 1 + across], out[other + 1 + n + across] = middle, middle
    else:
        out[entry + 1 + n + across], out[other + 1 + across] = middle, middle
    filled += 1
out[0], out[1] = stop, filled
return boxes
"""
"""The loop over the stack; it stops at a box that a face must cut off (1), or if budget or memory is spent (2)."""
