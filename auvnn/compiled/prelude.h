/* What generated functions are written in: vectors of LANES doubles, and functions of them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#if defined(__AVX512F__)
#define WIDE 8
#elif defined(__AVX__)
#define WIDE 4
#else
#define WIDE 2
#endif

typedef double W __attribute__((vector_size(8 * WIDE)));
typedef long long WI __attribute__((vector_size(8 * WIDE)));

#if LANES == 1
typedef double V;
typedef int B;
#define TRUE 1
#define FALSE 0
#define EACH(expression) ({ V r_; { const int l = 0; (void)l; r_ = (expression); } r_; })
#define L(x) (x)
#define LANE(v, l) (v)
static inline V pick(B c, V a, V b) { return c ? a : b; }
static inline V v_abs(V a) { return fabs(a); }
#define AND(a, b) ((a) && (b))
#define OR(a, b) ((a) || (b))
#define NOT(a) (!(a))
#define SPREAD(x) (x)
#else
typedef double V __attribute__((vector_size(8 * LANES)));
typedef long long B __attribute__((vector_size(8 * LANES)));
#define TRUE ((B){0} == (B){0})
#define FALSE ((B){0} != (B){0})
#define EACH(expression) ({ V r_; for (int l = 0; l < LANES; l++) r_[l] = (expression); r_; })
#define L(x) ((x)[l])
#define LANE(v, l) ((v)[l])
static inline V pick(B c, V a, V b) { return (V)(((B)a & c) | ((B)b & ~c)); }
static inline V v_abs(V a) { return (V)((B)a & ((B){0} + 0x7fffffffffffffffLL)); }
#define AND(a, b) ((a) & (b))
#define OR(a, b) ((a) | (b))
#define NOT(a) (~(a))
#define SPREAD(x) ((V){0} + (x))
#endif

static inline V v_max(V a, V b) { return pick(OR(a > b, a != a), a, b); }
static inline V v_min(V a, V b) { return pick(OR(a < b, a != a), a, b); }
static inline V v_sqrt(V a) { return EACH(__builtin_sqrt(L(a))); }
static inline V v_floor(V a) { return EACH(__builtin_floor(L(a))); }
static inline V v_ceil(V a) { return EACH(__builtin_ceil(L(a))); }
static inline V v_pow(V a, V b) { return EACH(pow(L(a), L(b))); }
static inline V v_atan2(V a, V b) { return EACH(atan2(L(a), L(b))); }

/* tanh(x) = e / (e + 2) with e = exp(2 |x|) - 1, to about two units in the last place; beyond 22 it is one. */
static inline W wide_tanh(W x) {
    const WI sign = (WI)x & ((WI){0} + (long long)0x8000000000000000ULL);
    W z = (W)((WI)x ^ sign);
    const WI far = z > 22.0;
    const WI bad = z != z;
    z = (W)(((WI)z & ~far) | ((WI)((W){0} + 22.0) & far));
    z = z + z;
    const double magic = 0x1.8p52;
    W k = z * 0x1.71547652b82fep0 + magic;                 /* round(z / ln 2) in the low bits */
    const WI bits = (WI)k;
    k = k - magic;
    const W r = (z - k * 0x1.62e42fefa0000p-1) - k * 0x1.cf79abc9e3b3ap-40;
    /* exp(r) - 1 by its series, |r| < 0.347: the remainder is below 2e-17 r. Two halves run side by side. */
    const W r2 = r * r, r4 = r2 * r2, r8 = r4 * r4;
    const W a0 = 1.0 + r * (1.0 / 2), a1 = 1.0 / 6 + r * (1.0 / 24), a2 = 1.0 / 120 + r * (1.0 / 720),
            a3 = 1.0 / 5040 + r * (1.0 / 40320), a4 = 1.0 / 362880 + r * (1.0 / 3628800),
            a5 = 1.0 / 39916800 + r * (1.0 / 479001600), a6 = 1.0 / 6227020800.0 + r * (1.0 / 87178291200.0);
    const W p = r * ((a0 + r2 * a1) + r4 * (a2 + r2 * a3) + r8 * ((a4 + r2 * a5) + r4 * a6));
    const W two = (W)((bits + 1023) << 52);                /* 2^k: the low bits of `bits` hold k */
    const W e = two * p + (two - 1.0);
    W t = e / (e + 2.0);
    t = (W)(((WI)t & ~bad) | ((WI)x & bad));
    return (W)((WI)t | (sign & ~bad));
}

/* `count` doubles, in room that is a multiple of WIDE. */
static __attribute__((noinline)) void many_tanh(const double *in, double *out, int count) {
    for (int i = 0; i < count; i += WIDE) {
        W x;
        memcpy(&x, in + i, sizeof x);
        x = wide_tanh(x);
        memcpy(out + i, &x, sizeof x);
    }
}

#define MANY(name) \
    static __attribute__((noinline, unused)) void many_##name(const double *in, double *out, int count) { \
        for (int i = 0; i < count; i++) out[i] = name(in[i]); \
    }
MANY(exp)
MANY(expm1)
MANY(log)
MANY(log1p)
MANY(sin)
MANY(cos)
MANY(tan)
MANY(atan)
MANY(asin)
MANY(acos)
MANY(sinh)
MANY(cosh)
MANY(erf)

/* Gauss-Jordan with row exchange; a singular matrix gives infinity or NaN. */
static __attribute__((unused)) void invert(double *a, double *out, int n) {
    for (int i = 0; i < n * n; i++) out[i] = i / n == i % n;
    for (int c = 0; c < n; c++) {
        int best = c;
        for (int r = c + 1; r < n; r++)
            if (fabs(a[r * n + c]) > fabs(a[best * n + c])) best = r;
        for (int j = 0; j < n && best != c; j++) {
            double t = a[c * n + j]; a[c * n + j] = a[best * n + j]; a[best * n + j] = t;
            t = out[c * n + j]; out[c * n + j] = out[best * n + j]; out[best * n + j] = t;
        }
        const double pivot = a[c * n + c];
        for (int j = 0; j < n; j++) { a[c * n + j] /= pivot; out[c * n + j] /= pivot; }
        for (int r = 0; r < n; r++) {
            const double f = a[r * n + c];
            if (r == c || f == 0.0) continue;
            for (int j = 0; j < n; j++) { a[r * n + j] -= f * a[c * n + j]; out[r * n + j] -= f * out[c * n + j]; }
        }
    }
}
