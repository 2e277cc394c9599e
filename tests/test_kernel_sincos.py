"""The kernel's sine and cosine: below 2 ulp over [-1e6, 1e6], worst arguments included, and libm beyond."""

import math
from typing import Any

import mpmath
import numpy as np
import pytest

from pinbound.kernel import vectorised
from pinbound.machine import sincos

numba = pytest.importorskip("numba")

ULP = 2.0
"""What is promised."""

FOUND = 1.25
"""What random arguments may show: 1.05 is found, and each rounding that the reduction carries, left out, shows 1.28."""


def compiled(text: str, dtype: Any) -> Any:
    """The loop body as a function of an array, lowered as in the kernel."""
    from pinbound.machine.lowering import loop_body

    statements = text.format(x="w[0, i]") + "w[1, i] = sine\nw[2, i] = cosine\n"
    tile = 1024
    body = loop_body(statements, tile, dtype is np.float32)
    pointer = numba.types.CPointer(numba.from_dtype(np.dtype(dtype)))

    @numba.cfunc(numba.void(pointer), error_model="numpy", fastmath={"contract"})
    def run(w: Any) -> None:
        for i in range(tile):
            body(w, i)

    def evaluate(X: Any) -> tuple[Any, Any]:
        S, C, w = np.empty_like(X), np.empty_like(X), np.zeros((3, tile), dtype=dtype)
        for start in range(0, len(X), tile):
            part = X[start : start + tile]
            w[0, : len(part)] = part
            run.ctypes(w.ctypes.data_as(run.ctypes.argtypes[0]))
            S[start : start + tile], C[start : start + tile] = w[1, : len(part)], w[2, : len(part)]
        return S, C

    return evaluate


@pytest.fixture(scope="module")
def double() -> Any:
    return compiled(sincos.SINCOS, np.float64)


def ulps(found: Any, exact: Any) -> float:
    """The largest error in units of the last place of the exact value."""
    unit = np.spacing(np.abs(exact.astype(np.float64)))
    return float(np.max(np.abs(found.astype(np.longdouble) - exact) / unit))


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="needs an extended long double")
@pytest.mark.parametrize("reach", [1e-8, 1e-3, 0.8, 3.0, 10.0, 1e3, 1e6])
def test_random_arguments_stay_below_two_ulp(reach: float, double: Any) -> None:
    X = np.random.default_rng(int(1 + reach)).uniform(-reach, reach, 200_000)
    S, C = double(X)
    assert ulps(S, np.sin(X.astype(np.longdouble))) < FOUND
    assert ulps(C, np.cos(X.astype(np.longdouble))) < FOUND


def test_the_neighbours_of_multiples_of_half_pi_stay_below_two_ulp(double: Any) -> None:
    """The doubles nearest to k pi/2, where reduction cancels most: all k of the continued fraction, and many others."""
    with mpmath.workprec(200):
        half = mpmath.pi / 2
        convergents, x, p, q = [], half, (1, 0), (0, 1)
        for _ in range(14):
            whole = int(mpmath.floor(x))
            p, q = (whole * p[0] + p[1], p[0]), (whole * q[0] + q[1], q[0])
            convergents.append(q[0])
            x = 1 / (x - whole)
        random = np.random.default_rng(3).integers(1, 636_619, 3000).tolist()
        factors = [m * k for k in [*convergents, *random] for m in (1, 2, 3) if m * k < 636_619]
        nearest = np.array([float(k * half) for k in factors])
        # the continued fraction finds the closest of all: scan every k, keep those whose nearest double is closest
        every = np.arange(1, 636_619)
        high, low = float(half), float(half - float(half))
        guess = every * high
        gap = np.abs(every.astype(np.longdouble) * np.longdouble(high) - guess + every * np.longdouble(low))
        closest = every[np.argsort(gap)[:500]]
        X = np.concatenate([nearest, [float(int(k) * half) for k in closest]])
        X = np.unique(np.concatenate([X, np.nextafter(X, 0), np.nextafter(X, 2e6), -X]))
        S, C = double(X)
        for x, s, c in zip(X.tolist(), S.tolist(), C.tolist(), strict=True):
            for found, exact in ((s, mpmath.sin(x)), (c, mpmath.cos(x))):
                error = abs(mpmath.mpf(found) - exact) / mpmath.mpf(math.ulp(float(exact)))
                assert error < ULP, (x, found, float(error))


def test_zero_keeps_its_value(double: Any) -> None:
    S, C = double(np.array([0.0, 1e-300, -5e-324]))
    assert S.tolist() == [0.0, 1e-300, -5e-324]
    assert C.tolist() == [1.0, 1.0, 1.0]


def test_single_precision_stays_below_two_units_of_one() -> None:
    X = np.random.default_rng(5).uniform(-sincos.REGULAR32, sincos.REGULAR32, 300_000).astype(np.float32)
    S, C = compiled(sincos.SINCOS32, np.float32)(X)
    unit = float(np.finfo(np.float32).eps)
    assert float(np.max(np.abs(S - np.sin(X.astype(np.float64))))) < unit
    assert float(np.max(np.abs(C - np.cos(X.astype(np.float64))))) < unit


@pytest.mark.parametrize("is_fast", [True, False])
def test_numpy_cosines_are_right_either_way(is_fast: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vectorised, "has_fast_tan", lambda: is_fast)
    X = np.concatenate([np.random.default_rng(6).uniform(-20, 20, 100_000), np.arange(-9, 10) * (np.pi / 2)])
    columns = vectorised._Columns(X[:, None])
    with np.errstate(all="ignore"):
        cos, sin = columns.turn((1.0,))
    assert float(np.max(np.abs(cos - np.cos(X)))) < 1e-15
    assert float(np.max(np.abs(sin - np.sin(X)))) < 1e-15
