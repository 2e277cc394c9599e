"""Attack on batches: values on degenerate poses, in every layout and type, against the oracle of `attack_limits`.

    python -m benchmarks.attack_batch --trials 200 --seed 0

A trial takes a random robot of `attack_limits` and rows that are degenerate on purpose: quarter turns, zeros, equal
angles, slides that bring marks together, far angles, rows that are not finite or too large for a type. Norms,
clearances, the smallest one, `free` and gradients (by differences of the oracle's distances) are compared, one by one
and in batches, strided, reversed, into buffers; buffers that share memory must be refused.

`attack_batch(rng)` returns "held", "none" or "WRONG: ..."; the exit code is 1 if anything is wrong.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import pinbound as pb
from benchmarks.attack_limits import Oracle, campaign, random_case

__all__ = ["attack_batch"]

TIGHT = 2e-9  # of the robot's length: what the oracle leaves where marks nearly meet
SINGLE = 4e-6
COMPILED = 0.1  # share of trials that compile, a second each


def degenerate_rows(oracle: Oracle, home: Any, rng: np.random.Generator) -> Any:
    """Return rows that are finite: degenerate, and random ones between."""
    turns = np.array([oracle.joints[i].kind == "revolute" for i in oracle.active])
    quarters = np.where(
        turns, rng.integers(-4, 5, (6, len(home))) * np.pi / 2, rng.choice([0.0, 0.3, -0.3], (6, len(home)))
    )
    same = np.repeat(rng.uniform(-3.0, 3.0, (3, 1)), len(home), axis=1)
    far = np.where(turns, rng.uniform(-1e4, 1e4, (2, len(home))), rng.uniform(-5.0, 5.0, (2, len(home))))
    near = home + rng.normal(size=(3, len(home))) * 1e-9
    return np.vstack((home, quarters, same, far, near, rng.uniform(-3.0, 3.0, (6, len(home)))))


def attack_batch(rng: np.random.Generator) -> str:
    """Return "held", "none" (no free home was found) or "WRONG: what"."""
    made = random_case(rng)
    if made is None:
        return "none"
    oracle, home, robot = made
    B, Q = robot.boundaries, degenerate_rows(oracle, home, rng)
    expected = np.array([[oracle.clearance(k, q) for k in range(len(B))] for q in Q])
    allowed = np.array([TIGHT * oracle.size(q) for q in Q])[:, None]
    backends = ("numpy", "compiled") if rng.random() < COMPILED else ("numpy",)
    for backend in backends:
        fault = _values(B, Q, expected, allowed, backend, rng) or _edges(B, Q, backend)
        if fault:
            return f"WRONG: {backend}: {fault}\n{oracle.urdf(home)}"
    fault = _one_by_one(B, Q, expected, allowed) or _slopes(oracle, B, Q[-6:])
    return f"WRONG: {fault}\n{oracle.urdf(home)}" if fault else "held"


def _values(B: Any, Q: Any, expected: Any, allowed: Any, backend: Any, rng: np.random.Generator) -> str:
    layouts = {
        "plain": Q,
        "reversed": Q[::-1],
        "every second column of a block": np.repeat(Q, 2, axis=1)[:, ::2],
        "Fortran": np.asfortranarray(Q),
    }
    for name, rows in layouts.items():
        right = expected[::-1] if name == "reversed" else expected
        room = allowed[::-1] if name == "reversed" else allowed
        found = B.clearances(rows, backend=backend, threads=int(rng.integers(1, 3)))
        if np.any(np.abs(found - right) > room):
            return f"clearances of {name} rows are off by {np.abs(found - right).max()}"
        least = B.smallest(rows, backend=backend)
        if np.any(np.abs(least.clearance - right.min(axis=1)) > room[:, 0]):
            return f"smallest of {name} rows"
        free, sure = B.free(rows, backend=backend), np.abs(right.min(axis=1)) > room[:, 0] + 2e-5
        if np.any(free[sure] & (right.min(axis=1)[sure] < 0.0)):
            return f"free of {name} rows says yes to a contact"
    out = np.full((len(Q), 2 * len(B)), 7.0)[:, ::2]
    B.clearances(Q, out=out, backend=backend)
    if np.any(np.abs(out - expected) > allowed):
        return "clearances into a strided buffer"
    near = np.abs(Q).max(axis=1) < 100.0
    single = B.clearances(Q[near], backend=backend, dtype=np.float32)
    if np.any(np.abs(single - expected[near]) > allowed[near] * (SINGLE / TIGHT)):
        return f"float32 is off by {np.abs(single - expected[near]).max()}"
    return ""


def _edges(B: Any, Q: Any, backend: Any) -> str:
    """Ask for rows that are no numbers, and with buffers that cannot be meant."""
    for value, dtype in ((np.nan, np.float64), (np.inf, np.float64), (1e39, np.float32), (-np.inf, np.float32)):
        rows = Q.copy()
        rows[1] = value
        least = B.smallest(rows, backend=backend, dtype=dtype)
        used = any(boundary.coordinates for boundary in B)
        if used and not (np.isnan(least.clearance[1]) and least.index[1] == -1):
            return f"smallest of {value} is {least.clearance[1]}"
        if not np.all(np.isfinite(np.delete(least.clearance, 1))):
            return f"a row of {value} spoils others"
    memory = np.zeros(Q.size + len(Q) * len(B))
    rows = memory[: Q.size].reshape(Q.shape)
    rows[:] = Q
    for start in (0, 1, Q.size - 1):
        try:
            B.norms(rows, out=memory[start : start + len(Q) * len(B)].reshape(len(Q), len(B)), backend=backend)
        except pb.DimensionError:
            continue
        return f"a buffer that shares memory from {start} on was taken"
    return ""


def _one_by_one(B: Any, Q: Any, expected: Any, allowed: Any) -> str:
    for q, right, room in zip(Q, expected, allowed, strict=True):
        for found in (B.clearances(q), np.array([boundary.clearance(q) for boundary in B])):
            if np.any(np.abs(found - right) > room):
                return f"clearances at {q.tolist()} are {found}, not {right}"
    return ""


def _slopes(oracle: Oracle, B: Any, Q: Any) -> str:
    """Compare gradients with central differences, where two widths agree and the distance is no rounding."""
    for q, gradients in zip(Q, B.gradients(Q), strict=True):
        for k, j in np.ndindex(len(B), len(q)):
            slopes = []
            for h in (1e-5, 2e-5):
                up, down = q.copy(), q.copy()
                up[j] += h
                down[j] -= h
                slopes.append((oracle.clearance(k, up) - oracle.clearance(k, down)) / (2 * h))
            apart = oracle.clearance(k, q) + B[k].threshold > 1e-3 or B[k].path.is_signed
            if apart and abs(slopes[0] - slopes[1]) < 1e-6 and not abs(gradients[k, j] - slopes[0]) < 1e-3:
                return f"gradient of {B[k].name} by {j} at {q.tolist()} is {gradients[k, j]}, not {slopes[0]}"
    return ""


if __name__ == "__main__":
    sys.exit(campaign(attack_batch, __doc__ or "\n"))
