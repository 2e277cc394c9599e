/* A yes or no for each configuration as VAMP works: rows in float32 lanes, links placed once, spheres of a link when a
 * larger ball around them comes near another, and no further once all lanes are in contact. No bound of rounding, no
 * joint limits, no second look in float64: a limit for `free`. Built and checked by `peers`.
 *
 * Node i: ups[i], the angle's column, the column of its rotation that stays (0 to 2), the sign of its axis, its step.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __AVX512F__
#define L 16
#else
#define L 8
#endif
typedef float lanes __attribute__((vector_size(4 * L)));
typedef int32_t ints __attribute__((vector_size(4 * L)));
#define MOST 512

typedef struct {
    int n, nodes, links, parts, groups;
    const int *up, *column, *kept;
    const float *sign, *step;
    const int *link_node, *part_node, *part_first, *part_last; /* parts[p]: spheres first to last of one link */
    const float *link_middle, *part_middle, *sphere, *radius;
    const int *group, *pair, *entry_first, *entry_last, *entry; /* group: link, link, pairs of parts from, to */
    const float *group_far, *pair_far;
} robot;

static int any(ints mask) {
#ifdef __AVX512F__
    return __builtin_ia32_ptestmd512((__v16si)mask, (__v16si)mask, (uint16_t)-1) != 0;
#else
    return !__builtin_ia32_ptestz256((__attribute__((vector_size(32))) long long)mask,
                                     (__attribute__((vector_size(32))) long long)mask);
#endif
}

static inline lanes pick(ints mask, lanes a, lanes b) { return (lanes)(((ints)a & mask) | ((ints)b & ~mask)); }

static inline void turn(lanes x, lanes *cosine, lanes *sine) {
    lanes k = (x * 0.63661975f + 12582912.0f) - 12582912.0f;
    lanes r = (x - k * 1.5703125f) - k * 4.8382673412561417e-04f;
    lanes z = r * r;
    lanes s = r + r * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
    lanes c = 1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
    ints turns = __builtin_convertvector(k, ints), odd = -(turns & 1);
    lanes a = pick(odd, c, s), b = pick(odd, s, c);
    *sine = (lanes)((ints)a ^ ((turns & 2) << 30));
    *cosine = (lanes)((ints)b ^ (((turns + 1) & 2) << 30));
}

static inline void place(const lanes *w, const float *x, lanes *to) {
    for (int i = 0; i < 3; i++) to[i] = w[4 * i + 3] + w[4 * i] * x[0] + w[4 * i + 1] * x[1] + w[4 * i + 2] * x[2];
}

static inline lanes square(const lanes *a, const lanes *b) {
    lanes x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

void free_rows(const robot *r, const double *Q, uint8_t *out, size_t count) {
    lanes w[64][12], link[64][3], part[128][3], sphere[MOST][3];
    int placed[128];
    for (int i = 0; i < 12; i++) w[0][i] = (lanes){0} + (float)(i % 5 == 0);
    for (size_t start = 0; start + L <= count; start += L) {
        for (int i = 1; i < r->nodes; i++) {
            lanes x, c, s;
            for (int l = 0; l < L; l++) x[l] = (float)Q[(start + l) * r->n + r->column[i]];
            turn(x, &c, &s);
            s *= r->sign[i];
            const lanes *up = w[r->up[i]];
            int a = r->kept[i], b = (a + 1) % 3, d = (a + 2) % 3;
            for (int j = 0; j < 12; j += 4) {
                const float *t = r->step + 3 * i;
                w[i][j + 3] = up[j + 3] + up[j] * t[0] + up[j + 1] * t[1] + up[j + 2] * t[2];
                w[i][j + a] = up[j + a];
                w[i][j + b] = up[j + b] * c + up[j + d] * s;
                w[i][j + d] = up[j + d] * c - up[j + b] * s;
            }
        }
        for (int i = 0; i < r->links; i++) place(w[r->link_node[i]], r->link_middle + 3 * i, link[i]);
        for (int p = 0; p < r->parts; p++) placed[p] = 0;
        ints hit = {0};
        for (int g = 0; g < r->groups && any(~hit); g++) {
            const int *one = r->group + 4 * g;
            if (!any((square(link[one[0]], link[one[1]]) < r->group_far[g]) & ~hit)) continue;
            for (int c = one[2]; c < one[3]; c++) {
                const int *two = r->pair + 2 * c;
                for (int side = 0; side < 2; side++) {
                    int p = two[side];
                    if (placed[p]) continue;
                    placed[p] = 1;
                    place(w[r->part_node[p]], r->part_middle + 3 * p, part[p]);
                    for (int i = r->part_first[p]; i < r->part_last[p]; i++)
                        place(w[r->part_node[p]], r->sphere + 3 * i, sphere[i]);
                }
                if (!any((square(part[two[0]], part[two[1]]) < r->pair_far[c]) & ~hit)) continue;
                for (int e = r->entry_first[c]; e < r->entry_last[c]; e++) {
                    int a = r->entry[2 * e], b = r->entry[2 * e + 1];
                    float t = r->radius[a] + r->radius[b];
                    hit |= square(sphere[a], sphere[b]) < t * t;
                }
            }
        }
        for (int l = 0; l < L; l++) out[start + l] = !hit[l];
    }
}
