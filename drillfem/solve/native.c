/* The compiled engine: kernels of the form compiler called element by element, and a direct solver for strings.

   A string of n elements of degree d has one block of nx + nv unknowns per node: the configuration x, and the velocity
   v. Its Jacobian is eliminated in three moves, each of them linear in n:

   1. The kinematic rows (those of x) are collocated at the nodes: they couple x and v of one node only,
      dx = P f_x + D dv. This leaves nv unknowns per node.
   2. The d - 1 inner nodes of an element are condensed onto its two vertices.
   3. What is left on the vertices is block tridiagonal.

   Pivots are sought inside the blocks. Small matrices are stored by columns. Nothing here allocates: all arrays belong
   to the caller. Rows of held unknowns are replaced by unit rows.

   Kernels of the cells may have lanes (lanes.py): they do LANES elements at once, whose numbers lie side by side. */

#include <math.h>
#include <stdint.h>
#include <string.h>

/* Since DOLFINx 0.10 kernels take a seventh argument; those that take six do not look at it. */
typedef void kernel(double *, const double *, const double *, const double *, const int *, const uint8_t *, void *);

#define INLINE static inline __attribute__((always_inline))

#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif

/* DECLARATIONS */
/* A coefficient of a form: `nodes` blocks per element, at `offset` among the numbers that kernels take. */
struct field {
    const double *values;
    const int32_t *dofs; /* (cells, nodes) */
    int32_t nodes, block, offset;
};

struct constant {
    const double *value;
    int32_t size;
};

/* One integral over one element, or over its facet. */
struct action {
    uintptr_t kernel;
    int32_t facet;
};

/* A compiled form on a mesh of intervals. */
struct form {
    int32_t cells, nodes, block;
    const int32_t *dofs;     /* (cells, nodes): nodes of the unknowns */
    const double *geometry;  /* (cells, 2, 3) */
    const struct field *fields;
    const struct constant *constants;
    int32_t n_fields, n_constants;
    const int32_t *first;    /* (cells + 1): the actions of a cell are first[c] .. first[c + 1] */
    const struct action *actions;
    double *w, *c;           /* work: coefficients of an element, all constants */
    const uintptr_t *lanes;  /* kernels with lanes, for integrals over all cells */
    int32_t n_lanes;
    int32_t width, entries;  /* numbers that it takes of an element, numbers that it makes */
    double *w_lanes, *x_lanes, *A_lanes; /* work, aligned for it */
};

/* A string whose Jacobian is factorised. Elements e count from the top; vertex e is the top of element e. */
struct solver {
    int32_t n, d, nx, nv;
    const int32_t *element;  /* (n): place in the string of a cell of the mesh */
    const int32_t *local;    /* (n, d + 1): its nodes, as the kernel counts them: top, bottom, inner ones */
    const int32_t *node;     /* (n, d + 1): the same, as the unknowns count them */
    const uint8_t *held;     /* (dofs): rows that are replaced */
    int32_t check;           /* whether to make sure that the kinematic rows are those of their nodes */
    double *P, *D;           /* (nodes, nx, nx), (nodes, nv, nx) */
    double *K;               /* (n, (d+1) nv, (d+1) nv): elements without x */
    double *B;               /* (n, (d+1) nx, (d+1) nv): what f_x does to the rows of v */
    double *I, *H, *G;       /* (n, ni, ni), (n, ni, 2 nv), (n, 2 nv, ni): inner inverse; couplings */
    double *S, *L, *U;       /* (n + 1, nv, nv), (n, nv, nv), (n, nv, nv) of the vertices */
    double *g, *z;           /* work: ((n + 1) nv), (n ni) */
};

/* The wall of a hole around a string: what `search` of drillfem.boreholes takes, and what it found last. */
struct wall {
    uintptr_t search;
    int32_t axes[3], n_axes; /* of a node's first unknowns */
    double *r;               /* (nodes, 3): where the nodes are */
    const int32_t *cells;
    const double *basis, *radius, *knots, *coefficients, *radius_at, *hole_radius, *friction_at, *friction;
    int64_t n_cells, per_cell, n_points, n_knots, n_radius, n_friction, width;
    double *p, *data;
    double found[4];
    double reach, retardation; /* distance from the wall within which it acts (or all); time of approach that adds to it */
    int32_t speed;             /* place of the velocity */
};

/* Newton's method for one stage of a step of a string without rock, as `BitCoupledNewton._iterate` states it. */
struct newton {
    const struct form *near, *off, *jacobian; /* residual by the wall and off it */
    const struct solver *solver;
    struct wall *wall;       /* or NULL */
    int32_t size, block, n_held;
    double *x, *u, *u_dot, *f, *y, *trusted;
    const double *x0, *rate, *known, *unit; /* unit (block): one over the tolerance */
    const int32_t *held;
    const double *target;    /* (n_held): speeds that are held */
    double *reaction, *shift;
    double factored, contraction;
    int32_t renew, iterations, factorisations, touching; /* whether the wall may act on the last state */
};

void assemble_vector(const struct form *form, double *out, int32_t size, const int32_t *some, int32_t n_some);
double assemble_scalar(const struct form *form);
int factorise(const struct solver *s, const struct form *form);
void solve(const struct solver *s, const double *b, double *y);
int lanes(void);
void stage(int32_t size, const double *x, const double *x0, double a, double b, const double *rate, double *u,
           double *u_dot);
int newton(struct newton *s, double a, double b, int with_rate, int with_known, int keep, int most, double slow,
           double stalled, int patience);
/* END */

int lanes(void)
{
    return LANES;
}

/* ---- forms ------------------------------------------------------------------------------------------------------ */

static void gather_constants(const struct form *f)
{
    double *c = f->c;
    for (int i = 0; i < f->n_constants; i++)
        for (int k = 0; k < f->constants[i].size; k++)
            *c++ = f->constants[i].value[k];
}

/* Coefficients of a cell, each `stride` numbers behind the last */
INLINE void gather(const struct form *f, int cell, double *w, const int stride)
{
    for (int i = 0; i < f->n_fields; i++) {
        const struct field *field = f->fields + i;
        const int block = field->block;
        double *to = w + field->offset * stride;
        const int32_t *dofs = field->dofs + cell * field->nodes;
        for (int k = 0; k < field->nodes; k++) {
            const double *from = field->values + (int64_t)dofs[k] * block;
            for (int j = 0; j < block; j++, to += stride)
                *to = from[j];
        }
    }
}

/* Adds to A what the integrals of a cell that have no lanes make of it */
static void run(const struct form *f, int cell, double *A)
{
    if (f->first[cell] == f->first[cell + 1])
        return;
    gather(f, cell, f->w, 1);
    for (int i = f->first[cell]; i < f->first[cell + 1]; i++) {
        const int facet = f->actions[i].facet;
        ((kernel *)f->actions[i].kernel)(A, f->w, f->c, f->geometry + 6 * cell, &facet, NULL, NULL);
    }
}

/* Cells cell .. cell + LANES - 1 into A_lanes; the last one stands in for those beyond it. Returns how many there are. */
static int run_lanes(const struct form *f, int cell)
{
    const int count = f->cells - cell < LANES ? f->cells - cell : LANES, facet = 0;
    for (int l = 0; l < LANES; l++) {
        const int of = cell + (l < count ? l : count - 1);
        gather(f, of, f->w_lanes + l, LANES);
        for (int k = 0; k < 6; k++)
            f->x_lanes[k * LANES + l] = f->geometry[6 * of + k];
    }
    memset(f->A_lanes, 0, sizeof(double) * f->entries * LANES);
    for (int i = 0; i < f->n_lanes; i++)
        ((kernel *)f->lanes[i])(f->A_lanes, f->w_lanes, f->c, f->x_lanes, &facet, NULL, NULL);
    return count;
}

/* Adds the vectors of `count` cells, which lie `stride` numbers apart in A */
INLINE void scatter(const struct form *f, int cell, int count, const double *A, const int stride, double *out)
{
    const int n = f->nodes, block = f->block;
    for (int l = 0; l < count; l++)
        for (int k = 0; k < n; k++) {
            double *to = out + (int64_t)f->dofs[(cell + l) * n + k] * block;
            const double *from = A + k * block * stride + l;
            for (int i = 0; i < block; i++)
                to[i] += from[i * stride];
        }
}

/* Overwrites out (size); of the cells `some` alone, unless n_some = 0 */
void assemble_vector(const struct form *f, double *out, int32_t size, const int32_t *some, int32_t n_some)
{
    const int cells = n_some ? n_some : f->cells;
    double b[f->entries];
    memset(out, 0, size * sizeof(double));
    gather_constants(f);
    for (int i = 0; f->n_lanes && i < cells; i += n_some ? 1 : LANES) {
        const int cell = n_some ? some[i] : i, count = run_lanes(f, cell);
        scatter(f, cell, n_some ? 1 : count, f->A_lanes, LANES, out);
    }
    for (int i = 0; i < cells; i++) {
        const int cell = n_some ? some[i] : i;
        if (f->first[cell] == f->first[cell + 1])
            continue;
        memset(b, 0, sizeof b);
        run(f, cell, b);
        scatter(f, cell, 1, b, 1, out);
    }
}

double assemble_scalar(const struct form *f)
{
    double sum = 0.0;
    gather_constants(f);
    for (int cell = 0; f->n_lanes && cell < f->cells; cell += LANES) {
        const int count = run_lanes(f, cell);
        for (int l = 0; l < count; l++)
            sum += f->A_lanes[l];
    }
    for (int cell = 0; cell < f->cells; cell++)
        run(f, cell, &sum);
    return sum;
}

/* ---- small dense matrices, by columns --------------------------------------------------------------------------- */

/* y (m) += sign A (m, n) x (n) */
INLINE void add_product(int m, int n, double sign, const double *restrict A, const double *restrict x,
                        double *restrict y)
{
    for (int j = 0; j < n; j++) {
        const double xj = sign * x[j];
        for (int i = 0; i < m; i++)
            y[i] += A[j * m + i] * xj;
    }
}

/* C (m, n) += sign A (m, k) B (k, n) */
INLINE void add_matrix_product(int m, int k, int n, double sign, const double *restrict A, const double *restrict B,
                               double *restrict C)
{
    for (int j = 0; j < n; j++)
        add_product(m, k, sign, A, B + j * k, C + j * m);
}

/* A (n, n) becomes its inverse, by Gauss-Jordan elimination with row pivots; numbers that are none where it has none */
INLINE void invert(const int n, double *A)
{
    int row[n];
    for (int k = 0; k < n; k++) {
        int p = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(A[k * n + i]) > fabs(A[k * n + p]))
                p = i;
        row[k] = p;
        if (p != k)
            for (int j = 0; j < n; j++) {
                const double a = A[j * n + k];
                A[j * n + k] = A[j * n + p];
                A[j * n + p] = a;
            }
        const double pivot = 1.0 / A[k * n + k];
        double column[n];
        memcpy(column, A + k * n, sizeof column);
        column[k] = 0.0;
        memset(A + k * n, 0, sizeof column);
        A[k * n + k] = 1.0;
        for (int j = 0; j < n; j++) {
            const double a = A[j * n + k] *= pivot;
            for (int i = 0; i < n; i++)
                A[j * n + i] -= column[i] * a;
        }
    }
    for (int k = n - 1; k >= 0; k--)
        if (row[k] != k)
            for (int i = 0; i < n; i++) {
                const double a = A[k * n + i];
                A[k * n + i] = A[row[k] * n + i];
                A[row[k] * n + i] = a;
            }
}

/* ---- factorisation ---------------------------------------------------------------------------------------------- */

/* Element matrix A (N, N, by rows) of element e: its rows of v in local order, K (nr, nr) and X (nr, nxe); P and D of its
   nodes gather what will be their J_xx and J_xv. */
INLINE void split(const struct solver *s, int e, const double *restrict A, double *restrict K, double *restrict X,
                  const int nx, const int nv, const int d)
{
    const int size = nx + nv, nn = d + 1, N = nn * size, nr = nn * nv;
    const int32_t *local = s->local + e * nn, *node = s->node + e * nn;
    for (int a = 0; a < nn; a++) {
        const double *rows = A + local[a] * size * N, *own = rows + local[a] * size;
        double *P = s->P + node[a] * nx * nx, *D = s->D + node[a] * nv * nx;
        for (int i = 0; i < nx; i++) {
            for (int j = 0; j < nx; j++)
                P[j * nx + i] += own[i * N + j];
            for (int j = 0; j < nv; j++)
                D[j * nx + i] -= own[i * N + nx + j];
        }
        for (int b = 0; b < nn; b++) {
            const double *block = rows + nx * N + local[b] * size;
            double *to_X = X + b * nx * nr + a * nv, *to_K = K + b * nv * nr + a * nv;
            for (int j = 0; j < nx; j++)
                for (int i = 0; i < nv; i++)
                    to_X[j * nr + i] = block[i * N + j];
            for (int j = 0; j < nv; j++)
                for (int i = 0; i < nv; i++)
                    to_K[j * nr + i] = block[i * N + nx + j];
        }
    }
    for (int a = 0; a < 2; a++)
        for (int i = 0; i < nv; i++)
            if (s->held[node[a] * size + nx + i]) {
                const int r = a * nv + i;
                for (int j = 0; j < nn * nx; j++)
                    X[j * nr + r] = 0.0;
                for (int j = 0; j < nr; j++)
                    K[j * nr + r] = j == r ? 1.0 : 0.0;
            }
}

/* Largest entry of A that couples x of a node to other nodes, relative to those within nodes */
static double reach(const double *A, int nx, int nv, int d)
{
    const int size = nx + nv, N = (d + 1) * size;
    double own = 0.0, other = 0.0;
    for (int r = 0; r < N; r++)
        for (int c = 0; r % size < nx && c < N; c++) {
            const double much = fabs(A[r * N + c]);
            if (r / size == c / size)
                own = much > own ? much : own;
            else
                other = much > other ? much : other;
        }
    return own > 0.0 ? other / own : other;
}

INLINE int factorise_sized(const struct solver *s, const struct form *f, const int nx, const int nv, const int d)
{
    const int n = s->n, size = nx + nv, nn = d + 1, N = nn * size, nr = nn * nv, nxe = nn * nx, ne = 2 * nv;
    const int ni = nr - ne, nodes = n * d + 1;
    double A[LANES][N * N], X[nr * nxe], inner[ne * ni + 1];
    gather_constants(f);
    memset(s->P, 0, sizeof(double) * nodes * nx * nx);
    memset(s->D, 0, sizeof(double) * nodes * nv * nx);
    memset(s->S, 0, sizeof(double) * (n + 1) * nv * nv);
    for (int cell = 0; cell < f->cells; cell += LANES) {
        const int count = f->n_lanes ? run_lanes(f, cell) : f->cells - cell < LANES ? f->cells - cell : LANES;
        if (f->n_lanes)
            for (int k = 0; k < N * N; k++)
                for (int l = 0; l < LANES; l++)
                    A[l][k] = f->A_lanes[k * LANES + l];
        else
            memset(A, 0, sizeof A);
        for (int l = 0; l < count; l++) {
            const int e = s->element[cell + l];
            run(f, cell + l, A[l]);
            if (s->check && reach(A[l], nx, nv, d) > 1e-9)
                return 1;
            split(s, e, A[l], s->K + (int64_t)e * nr * nr, s->B + (int64_t)e * nr * nxe, nx, nv, d);
        }
    }
    for (int k = 0; k < nodes; k++) {
        double old[nx * nv], *D = s->D + k * nv * nx;
        invert(nx, s->P + k * nx * nx);
        for (int i = 0; i < nx * nv; i++) {
            old[i] = D[i];
            D[i] = 0.0;
        }
        add_matrix_product(nx, nx, nv, 1.0, s->P + k * nx * nx, old, D);
    }
    for (int e = 0; e < n; e++) {
        const int32_t *node = s->node + e * nn;
        double *K = s->K + (int64_t)e * nr * nr, *B = s->B + (int64_t)e * nr * nxe;
        /* without x: K += X D, and B = X P */
        memcpy(X, B, sizeof X);
        memset(B, 0, sizeof X);
        for (int b = 0; b < nn; b++) {
            add_matrix_product(nr, nx, nv, 1.0, X + b * nx * nr, s->D + node[b] * nv * nx, K + b * nv * nr);
            add_matrix_product(nr, nx, nx, 1.0, X + b * nx * nr, s->P + node[b] * nx * nx, B + b * nx * nr);
        }
        /* without inner nodes: I their inverse, H = K_vi, G = I K_iv, and K_vv -= H G */
        double *I = s->I + (int64_t)e * ni * ni, *H = s->H + (int64_t)e * ni * ne, *G = s->G + (int64_t)e * ne * ni;
        for (int j = 0; j < ni; j++) {
            memcpy(H + j * ne, K + (ne + j) * nr, ne * sizeof(double));
            memcpy(I + j * ni, K + (ne + j) * nr + ne, ni * sizeof(double));
        }
        for (int j = 0; j < ne; j++)
            memcpy(inner + j * ni, K + j * nr + ne, ni * sizeof(double));
        invert(ni, I);
        memset(G, 0, sizeof(double) * ne * ni);
        add_matrix_product(ni, ni, ne, 1.0, I, inner, G);
        double *S = s->S + (int64_t)e * nv * nv, *L = s->L + (int64_t)e * nv * nv, *U = s->U + (int64_t)e * nv * nv;
        for (int j = 0; j < ne; j++) {
            double column[ne];
            memcpy(column, K + j * nr, sizeof column);
            add_product(ne, ni, -1.0, H, G + j * ni, column);
            double *top = j < nv ? S + j * nv : U + (j - nv) * nv, *bottom = j < nv ? L + j * nv : S + j * nv;
            for (int i = 0; i < nv; i++) {
                top[i] = column[i] + (j < nv ? top[i] : 0.0);
                bottom[i] = column[nv + i] + (j < nv ? 0.0 : bottom[i]);
            }
        }
    }
    /* S becomes the inverse of its pivot block, L = L S^-1 */
    for (int e = 0; e <= n; e++) {
        double *S = s->S + (int64_t)e * nv * nv, *L = s->L + (int64_t)e * nv * nv, old[nv * nv];
        invert(nv, S);
        if (e == n)
            break;
        memcpy(old, L, sizeof old);
        memset(L, 0, sizeof old);
        add_matrix_product(nv, nv, nv, 1.0, old, S, L);
        add_matrix_product(nv, nv, nv, -1.0, L, s->U + (int64_t)e * nv * nv, S + nv * nv);
    }
    return 0;
}

/* Loops of known length are several times as fast. */
#define DISPATCH(sized, ...)                    \
    if (s->nx == 7 && s->nv == 6 && s->d == 3)  \
        return sized(__VA_ARGS__, 7, 6, 3);     \
    if (s->nx == 7 && s->nv == 6 && s->d == 2)  \
        return sized(__VA_ARGS__, 7, 6, 2);     \
    if (s->nx == 3 && s->nv == 3 && s->d == 3)  \
        return sized(__VA_ARGS__, 3, 3, 3);     \
    if (s->nx == 2 && s->nv == 2 && s->d == 3)  \
        return sized(__VA_ARGS__, 2, 2, 3);     \
    return sized(__VA_ARGS__, s->nx, s->nv, s->d);

/* Returns 0, or 1 where the kinematic rows reach beyond their nodes, so that this elimination does not apply. */
int factorise(const struct solver *s, const struct form *f)
{
    DISPATCH(factorise_sized, s, f)
}

/* ---- solution --------------------------------------------------------------------------------------------------- */

INLINE void solve_sized(const struct solver *s, const double *restrict b, double *restrict y, const int nx, const int nv,
                        const int d)
{
    const int n = s->n, size = nx + nv, nn = d + 1, nr = nn * nv, nxe = nn * nx, ne = 2 * nv, ni = nr - ne;
    double *restrict g = s->g, *restrict z = s->z;
    memset(g, 0, sizeof(double) * (n + 1) * nv);
    for (int e = 0; e < n; e++) {
        const int32_t *node = s->node + e * nn;
        const int last = e == n - 1; /* the bottom vertex belongs to the next element, if there is one */
        double t[nr], f_x[nxe];
        for (int a = 0; a < nn; a++) {
            const double *from = b + node[a] * size;
            for (int i = 0; i < nx; i++)
                f_x[a * nx + i] = from[i];
            for (int i = 0; i < nv; i++)
                t[a * nv + i] = a == 1 && !last ? 0.0 : from[nx + i];
        }
        add_product(nr, nxe, -1.0, s->B + (int64_t)e * nr * nxe, f_x, t);
        double *ze = z + e * ni;
        for (int i = 0; i < ni; i++)
            ze[i] = 0.0;
        add_product(ni, ni, 1.0, s->I + (int64_t)e * ni * ni, t + ne, ze);
        add_product(ne, ni, -1.0, s->H + (int64_t)e * ni * ne, ze, t);
        for (int i = 0; i < ne; i++)
            g[e * nv + i] += t[i];
    }
    for (int e = 0; e < n; e++)
        add_product(nv, nv, -1.0, s->L + (int64_t)e * nv * nv, g + e * nv, g + (e + 1) * nv);
    for (int e = n; e >= 0; e--) {
        double *ge = g + e * nv, t[nv];
        if (e < n)
            add_product(nv, nv, -1.0, s->U + (int64_t)e * nv * nv, ge + nv, ge);
        for (int i = 0; i < nv; i++)
            t[i] = 0.0;
        add_product(nv, nv, 1.0, s->S + (int64_t)e * nv * nv, ge, t);
        for (int i = 0; i < nv; i++)
            ge[i] = t[i];
    }
    for (int e = 0; e < n; e++) {
        double *ze = z + e * ni;
        add_product(ni, ne, -1.0, s->G + (int64_t)e * ne * ni, g + e * nv, ze);
        for (int a = e == 0 ? 0 : 1; a < nn; a++) {
            const int node = s->node[e * nn + a];
            const double *restrict f_x = b + node * size, *restrict v = a < 2 ? g + (e + a) * nv : ze + (a - 2) * nv;
            double *to = y + node * size, t[nx];
            for (int i = 0; i < nx; i++)
                t[i] = 0.0;
            add_product(nx, nx, 1.0, s->P + node * nx * nx, f_x, t);
            add_product(nx, nv, 1.0, s->D + node * nv * nx, v, t);
            for (int i = 0; i < nx; i++)
                to[i] = t[i];
            for (int i = 0; i < nv; i++)
                to[nx + i] = v[i];
        }
    }
}

/* y = J^-1 b; y may not be b */
void solve(const struct solver *s, const double *b, double *y)
{
    DISPATCH(solve_sized, s, b, y)
}

/* ---- steps ------------------------------------------------------------------------------------------------------ */

/* State and rate of a stage: u = x0 + a (x - x0) and u-dot = b (x - x0) + rate; rate may be NULL (0) */
void stage(int32_t size, const double *x, const double *x0, double a, double b, const double *rate, double *u,
           double *u_dot)
{
    for (int i = 0; i < size; i++) {
        const double change = x[i] - x0[i];
        u[i] = a == 1.0 ? x[i] : x0[i] + a * change;
        u_dot[i] = b * change + (rate ? rate[i] : 0.0);
    }
}

typedef void search(const double *, int64_t, const int32_t *, int64_t, int64_t, const double *, int64_t, const double *,
                    const double *, int64_t, const double *, const double *, const double *, int64_t, const double *,
                    const double *, int64_t, double *, double *, int64_t, double *);

/* Closest points of a state; 0 where one is lost, or beyond the ends of the hole */
static int look(struct wall *w, int size, int block, const double *u)
{
    const int nodes = size / block;
    for (int i = 0; i < nodes; i++)
        for (int k = 0; k < w->n_axes; k++)
            w->r[3 * i + w->axes[k]] = u[i * block + k];
    ((search *)w->search)(w->r, nodes, w->cells, w->n_cells, w->per_cell, w->basis, w->n_points, w->radius, w->knots,
                          w->n_knots, w->coefficients, w->radius_at, w->hole_radius, w->n_radius, w->friction_at,
                          w->friction, w->n_friction, w->p, w->data, w->width, w->found);
    return w->found[1] == 0 && w->found[2] > 0.0 && w->found[3] < w->knots[w->n_knots - 1];
}

/* Whether the wall may act on any point of the state that was looked at last */
static int touches(const struct wall *w, int size, int block, const double *u)
{
    double reach = w->reach;
    if (w->retardation != 0.0) {
        double fastest = 0.0;
        for (int i = 0; i < size; i += block)
            for (int k = w->speed; k < w->speed + 3 && k < block; k++)
                if (!(fabs(u[i + k]) <= fastest))
                    fastest = fabs(u[i + k]);
        reach += w->retardation * fastest * 2;
    }
    return !(w->found[0] > reach);
}

enum { CONVERGED = 1, SLOW, NOT_A_NUMBER, OUTSIDE, NOT_LOCAL };

int newton(struct newton *s, double a, double b, int with_rate, int with_known, int keep, int most, double slow,
           double stalled, int patience)
{
    const int size = s->size, block = s->block;
    double previous = INFINITY;
    int renew_after = 0, first = 1, outcome = SLOW;
    memcpy(s->trusted, s->x, size * sizeof(double));
    for (int iteration = 0; iteration < most; iteration++) {
        stage(size, s->x, s->x0, a, b, with_rate ? s->rate : NULL, s->u, s->u_dot);
        if (s->wall && !look(s->wall, size, block, s->u))
            return OUTSIDE;
        const int near = s->touching = s->wall && touches(s->wall, size, block, s->u);
        assemble_vector(near ? s->near : s->off, s->f, size, NULL, 0);
        for (int k = 0; k < s->n_held; k++) {
            const int row = s->held[k];
            s->reaction[k] = s->f[row];
            s->f[row] = s->u[row] - s->target[k];
        }
        if (a != 1.0)
            for (int i = 0; i < size; i++)
                s->f[i] *= 1 / a;
        if (with_known)
            for (int i = 0; i < size; i++)
                s->f[i] -= s->known[i];
        const double shift = b / a;
        if (iteration == 0 && fabs(shift - s->factored) > 1e-10 * shift)
            s->renew = 1;
        const int fresh = s->renew || !keep;
        if (fresh) {
            *s->shift = shift;
            if (factorise(s->solver, s->jacobian))
                return NOT_LOCAL;
            s->factored = shift;
            s->renew = 0;
            s->factorisations++;
            s->contraction = 1.0;
        }
        solve(s->solver, s->f, s->y);
        double worst = 0.0;
        for (int i = 0; i < size; i += block)
            for (int k = 0; k < block; k++) {
                s->x[i + k] -= s->y[i + k];
                const double change = fabs(s->y[i + k]) * s->unit[k];
                if (!(change <= worst)) /* also catches nan */
                    worst = change;
            }
        s->iterations++;
        if (!isfinite(worst)) {
            outcome = NOT_A_NUMBER;
            break;
        }
        if (!first) {
            if (worst > 1.0) {
                s->contraction = worst / previous;
                if (!fresh && s->contraction > stalled) {
                    memcpy(s->x, s->trusted, size * sizeof(double));
                    keep = 0;
                    first = 1;
                    continue;
                }
                s->renew = s->contraction > stalled || worst * pow(s->contraction, patience) > 1.0;
                renew_after = renew_after || s->contraction > slow;
            } else if (worst / previous < s->contraction)
                s->contraction = worst / previous;
        }
        if (worst < 1.0) {
            outcome = CONVERGED;
            break;
        }
        if (fresh || !first)
            memcpy(s->trusted, s->x, size * sizeof(double));
        previous = worst;
        first = 0;
    }
    s->renew = s->renew || renew_after;
    return outcome;
}
