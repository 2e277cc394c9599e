/* Ten norms of MinervaBotV3 by hand: what the hardware allows, and the limit that the batch kernel is held against.
 *
 * One file, one robot, AVX-512 or whatever -march=native gives, one tile in L1, the geometry as arrays that the
 * benchmark fills in: r = p - R(phi) s with phi = q3, q2 or q3 - q2. Built without -ffast-math, which would set
 * flush-to-zero for the whole process.
 */
#include <math.h>
#include <stddef.h>

#define TILE 256
#define COUNT 10

static inline __attribute__((always_inline)) void sincos_(double x, double *sine, double *cosine) {
    /* Two-part reduction, good for |x| below about 1e4: less than the kernel does, as suits a lower limit. */
    double k = (x * 0.6366197723675814 + 6755399441055744.0) - 6755399441055744.0;
    double r = x - k * 1.5707963267948966;
    r = r - k * 6.123233995736766e-17;
    double z = r * r;
    double s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04
             + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    double c = 1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03
             + z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09
             + z * -1.13596475577881948265e-11)))));
    long long n = (long long)k;
    double a = (n & 1) ? c : s, b = (n & 1) ? s : c;
    *sine = (n & 2) ? -a : a;
    *cosine = ((n + 1) & 2) ? -b : b;
}

/* which[k]: 0 for q3, 1 for q2, 2 for q3 - q2; px, py: p in a basis in which s = (length, 0). */
void ten_norms(const double *restrict Q, double *restrict out, size_t count, const int *restrict which,
               const double *restrict px, const double *restrict py, const double *restrict length) {
    double c[3][TILE], s[3][TILE], q2[TILE], q3[TILE];
    for (size_t start = 0; start < count; start += TILE) {
        size_t n = count - start < TILE ? count - start : TILE;
        for (size_t i = 0; i < n; i++) { q2[i] = Q[3 * (start + i) + 1]; q3[i] = Q[3 * (start + i) + 2]; }
        for (size_t i = n; i < TILE; i++) { q2[i] = 0.0; q3[i] = 0.0; }
        for (size_t i = 0; i < TILE; i++) sincos_(q3[i], &s[0][i], &c[0][i]);
        for (size_t i = 0; i < TILE; i++) sincos_(q2[i], &s[1][i], &c[1][i]);
        for (size_t i = 0; i < TILE; i++) {
            c[2][i] = c[0][i] * c[1][i] + s[0][i] * s[1][i];
            s[2][i] = s[0][i] * c[1][i] - c[0][i] * s[1][i];
        }
        for (int k = 0; k < COUNT; k++) {
            const double *restrict cosine = c[which[k]], *restrict sine = s[which[k]];
            double x0 = px[k], y0 = py[k], l = length[k];
            double *restrict column = out + (size_t)k * count + start;
            for (size_t i = 0; i < n; i++) {
                double x = x0 - l * cosine[i], y = y0 - l * sine[i];
                column[i] = sqrt(x * x + y * y);
            }
        }
    }
}

void least_norm(const double *restrict Q, double *restrict out, size_t count, const int *restrict which,
                const double *restrict px, const double *restrict py, const double *restrict length) {
    double c[3][TILE], s[3][TILE], q2[TILE], q3[TILE], least[TILE];
    for (size_t start = 0; start < count; start += TILE) {
        size_t n = count - start < TILE ? count - start : TILE;
        for (size_t i = 0; i < n; i++) { q2[i] = Q[3 * (start + i) + 1]; q3[i] = Q[3 * (start + i) + 2]; }
        for (size_t i = n; i < TILE; i++) { q2[i] = 0.0; q3[i] = 0.0; }
        for (size_t i = 0; i < TILE; i++) sincos_(q3[i], &s[0][i], &c[0][i]);
        for (size_t i = 0; i < TILE; i++) sincos_(q2[i], &s[1][i], &c[1][i]);
        for (size_t i = 0; i < TILE; i++) {
            c[2][i] = c[0][i] * c[1][i] + s[0][i] * s[1][i];
            s[2][i] = s[0][i] * c[1][i] - c[0][i] * s[1][i];
            least[i] = INFINITY;
        }
        for (int k = 0; k < COUNT; k++) {
            const double *restrict cosine = c[which[k]], *restrict sine = s[which[k]];
            double x0 = px[k], y0 = py[k], l = length[k];
            for (size_t i = 0; i < TILE; i++) {
                double x = x0 - l * cosine[i], y = y0 - l * sine[i], square = x * x + y * y;
                least[i] = square < least[i] ? square : least[i];
            }
        }
        for (size_t i = 0; i < n; i++) out[start + i] = sqrt(least[i]);
    }
}
