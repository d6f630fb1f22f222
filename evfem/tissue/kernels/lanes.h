/* Vectors of LANES numbers, one of each cell; the arrays are laid out so by
   `evfem.tissue.kernels.blocks`. */

#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define LANES 8
#define FAR 0.028 /* of z^2: |ln J| about 1/3, where its series becomes too short */
#define INLINE static inline __attribute__((always_inline))

typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef lanes stored __attribute__((aligned(8))); /* as numpy's arrays are */

/* The numbers in the lanes of a vector in memory. */
INLINE double *item(lanes *vector) { return (double *)vector; }

INLINE double sum(lanes values) {
    double total = 0.0;
    for (int i = 0; i < LANES; i++) total += values[i];
    return total;
}

/* ln J = 2 artanh(z), z = e / (2 + e), by its series; exactly where |ln J| > 1/3. nan if J < 0. */
INLINE lanes log_of_volume(lanes e) {
    lanes z = e / (2.0 + e), s = z * z, p = s / 21.0 + 1.0 / 19.0;
    p = p * s + 1.0 / 17.0;
    p = p * s + 1.0 / 15.0;
    p = p * s + 1.0 / 13.0;
    p = p * s + 1.0 / 11.0;
    p = p * s + 1.0 / 9.0;
    p = p * s + 1.0 / 7.0;
    p = p * s + 1.0 / 5.0;
    p = p * s + 1.0 / 3.0;
    lanes log_J = 2.0 * z * (p * s + 1.0);
    double far = 0.0;
    for (int i = 0; i < LANES; i++) far = e[i] > -1.0 && s[i] < far ? far : e[i] > -1.0 ? s[i] : 1.0;
    if (!(far <= FAR))
        for (int i = 0; i < LANES; i++) log_J[i] = log1p(e[i]);
    return log_J;
}

INLINE int any(lanes values) {
    for (int i = 0; i < LANES; i++)
        if (values[i] != 0.0) return 1;
    return 0;
}
