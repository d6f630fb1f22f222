/* The numerical part of cholesky.c in REAL numbers; names by OF. */

typedef struct {
    void (*potrf)(char *, int *, REAL *, int *, int *);
    void (*trsm)(char *, char *, char *, char *, int *, int *, REAL *, REAL *, int *, REAL *, int *);
    void (*syrk)(char *, char *, int *, int *, REAL *, REAL *, int *, REAL *, REAL *, int *);
    void (*gemv)(char *, int *, int *, REAL *, REAL *, int *, REAL *, int *, REAL *, REAL *, int *);
    void (*trsv)(char *, char *, char *, int *, REAL *, int *, REAL *, int *);
} OF(algebra);

/* Add the update matrix of a child to the panel and the update matrix of its parent. */
static void OF(extend)(const plan *p, const supernode *child, const REAL *from, const supernode *s, REAL *panel) {
    int t = child->below, end = s->first + s->width, height = s->width + s->below;
    for (int j = 0; j < t; j++, from += t) {
        int column = child->rows[j], inside = column < end;
        int64_t begin = inside ? (int64_t)height * (column - s->first) : (int64_t)s->below * p->local[column];
        REAL *to = (inside ? panel : (REAL *)p->update) + begin;
        for (int i = j; i < t; i++) {
            int row = child->rows[i];
            to[!inside ? p->local[row] : row < end ? row - s->first : s->width + p->local[row]] += from[i];
        }
    }
}

/* Entries of the matrix and update matrices of the children, in a supernode's panel and update matrix. */
static REAL *OF(assemble)(plan *p, const supernode *s, const double *values, REAL *top, int *waiting) {
    int k = s->width, t = s->below, height = k + t;
    REAL *panel = (REAL *)p->panels + s->at;
    memset(panel, 0, (size_t)k * height * sizeof(REAL));
    memset(p->update, 0, (size_t)t * t * sizeof(REAL));
    for (int i = 0; i < t; i++) p->local[s->rows[i]] = i;
    for (int j = 0; j < k; j++, panel += height)
        for (int64_t e = p->begin[s->first + j]; e < p->begin[s->first + j + 1]; e++) {
            int row = p->row[e] - s->first;
            panel[row < k ? row : k + p->local[p->row[e]]] = (REAL)values[p->source[e]];
        }
    for (int c = 0; c < s->children; c++) {
        const supernode *child = p->nodes + p->waiting[--*waiting];
        top -= (int64_t)child->below * child->below;
        OF(extend)(p, child, top, s, (REAL *)p->panels + s->at);
    }
    return top;
}

/* Factorise; S (m, m), its lower triangle by columns. 0 if the interior is not positive definite. */
static int OF(factorise)(plan *p, const double *values, REAL *S) {
    int m = p->size - p->inner, waiting = 0, failed = 0;
    REAL one = 1, minus = -1, *top = p->stack;
    OF(algebra) with;
    memcpy(&with, p->addresses, sizeof with);
    memset(S, 0, (size_t)m * m * sizeof(REAL));
    for (int j = 0; j < m; j++)
        for (int64_t e = p->begin[p->inner + j]; e < p->begin[p->inner + j + 1]; e++)
            S[(int64_t)m * j + p->row[e] - p->inner] = (REAL)values[p->source[e]];
    for (int n = 0; n < p->count; n++) {
        const supernode *s = p->nodes + n;
        int k = s->width, t = s->below, height = k + t;
        REAL *panel = (REAL *)p->panels + s->at, *update = p->update;
        top = OF(assemble)(p, s, values, top, &waiting);
        with.potrf("L", &k, panel, &height, &failed);
        if (failed) return 0;
        if (!t) continue;
        with.trsm("R", "L", "T", "N", &t, &k, &one, panel, &height, panel + k, &height);
        with.syrk("L", "N", &t, &k, &minus, panel + k, &height, &one, update, &t);
        if (s->rows[0] < p->inner) {
            memcpy(top, update, (size_t)t * t * sizeof(REAL));
            top += (int64_t)t * t, p->waiting[waiting++] = n;
        } else
            for (int j = 0; j < t; j++)
                for (int i = j; i < t; i++)
                    S[(int64_t)m * (s->rows[j] - p->inner) + s->rows[i] - p->inner] += update[(int64_t)t * j + i];
    }
    return 1;
}

/* Solve with L, or with its transpose; the kept unknowns get, or give, what B does. */
static void OF(solve)(plan *p, int transposed, double *solution) {
    REAL one = 1, zero = 0, minus = -1, *line = p->line, *vector = p->vector;
    int step = 1;
    OF(algebra) with;
    memcpy(&with, p->addresses, sizeof with);
    for (int i = 0; i < p->size; i++) vector[i] = (REAL)solution[p->order[i]];
    for (int n = 0; n < p->count; n++) {
        const supernode *s = p->nodes + (transposed ? p->count - 1 - n : n);
        int k = s->width, t = s->below, height = k + t;
        REAL *panel = (REAL *)p->panels + s->at, *x = vector + s->first;
        if (transposed) {
            for (int i = 0; i < t; i++) line[i] = vector[s->rows[i]];
            if (t) with.gemv("T", &t, &k, &minus, panel + k, &height, line, &step, &one, x, &step);
            with.trsv("L", "T", "N", &k, panel, &height, x, &step);
        } else {
            with.trsv("L", "N", "N", &k, panel, &height, x, &step);
            if (t) with.gemv("N", &t, &k, &one, panel + k, &height, x, &step, &zero, line, &step);
            for (int i = 0; i < t; i++) vector[s->rows[i]] -= line[i];
        }
    }
    for (int i = 0; i < p->size; i++) solution[p->order[i]] = vector[i];
}
