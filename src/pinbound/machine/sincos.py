"""Branch-free sine and cosine, as loop bodies that LLVM vectorises.

With `k = rint(x 2/pi)` and pi/2 = p1 + p2 + p3 + p4, the first three of at most 33 bits, k p_i is exact for
|k| < 2^20. `x - k p1` is exact, and each further subtraction keeps its rounding (Dekker's fast two-sum; where its
condition |a| >= |b| does not hold, the difference is exact anyway, `docs/kernel.md`). So `r + e = x - k pi/2` has a
relative error below 2^-76, also next to multiples of pi/2. On |r| <= pi/4 the minimax polynomials of fdlibm (Sun
Microsystems, 1993) are used. The quadrant is read from the low bits of `x 2/pi + 1.5 2^52`. The caller reduces
arguments beyond `REGULAR` by libm. `tests/test_kernel_sincos.py` shows an error below 2 ulp on [-1e6, 1e6].
"""

from __future__ import annotations

from typing import Final

__all__ = ["REGULAR", "REGULAR32", "SINCOS", "SINCOS32"]

REGULAR: Final = 1.6e6
"""The largest |x| for which k < 2^20."""

REGULAR32: Final = 3000.0
"""The largest |x| for which the products of the float32 reduction are exact, k < 2^11."""

SINCOS: Final = """\
x = {x}
m = x * 0.6366197723675814 + 6755399441055744.0
low = bits(m)
k = m - 6755399441055744.0
t = x - k * 1.5707963267341256
u = k * 6.077100506303966e-11
a = t - u
e = (t - a) - u
u = k * 2.0222662487111665e-21
r = a - u
e = (e + ((a - r) - u)) - k * 8.4784276603689e-32
z = r * r
p = -1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04
    + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))))
s = r + ((z * r) * p + e)
p = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05
    + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))
c = 1.0 - (0.5 * z - ((z * z) * p - r * e))
odd = (low & 1) != 0
a = pick(odd, c, s)
b = pick(odd, s, c)
sine = real(bits(a) ^ ((low & 2) << 62))
cosine = real(bits(b) ^ (((low + 1) & 2) << 62))
"""

SINCOS32: Final = """\
x = {x}
k = (x * F(0.63661975) + F(12582912.0)) - F(12582912.0)
r = ((x - k * F(1.5703125)) - k * F(4.8351287841796875e-04)) - k * F(3.1385570764541626e-07)
r = r - k * F(6.0770999344e-11)
z = r * r
sin = r + r * z * (F(-1.6666654611e-1) + z * (F(8.3321608736e-3) + z * F(-1.9515295891e-4)))
cos = F(1.0) - F(0.5) * z + z * z * (
    F(4.166664568298827e-2) + z * (F(-1.388731625493765e-3) + z * F(2.443315711809948e-5)))
h = (k * F(0.5) - F(0.25) + F(12582912.0)) - F(12582912.0)
odd = k - F(2.0) * h
g = (h * F(0.5) - F(0.25) + F(12582912.0)) - F(12582912.0)
sign = F(1.0) - F(2.0) * (h - F(2.0) * g)
sine = sign * pick(odd > F(0.5), cos, sin)
cosine = (sign - F(2.0) * odd * sign) * pick(odd > F(0.5), sin, cos)
"""
