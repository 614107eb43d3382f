/* Explicit Runge-Kutta over held inputs, and its discrete adjoint, for the functions that come before this text:
   prologue, rate, rate_back, project, project_back. LANES trajectories run side by side in one vector V. */

typedef struct {
    long batch, rows, parts;            /* trajectories, rows of the log, equal steps per interval */
    const double *y0;                   /* (batch, NY) */
    const double *mean, *slope;         /* thrust over a step: average, and rise of its line or NULL */
    long drive_batch, drive_row, drive_part; /* strides of both, in doubles */
    const double *row;                  /* (.., rows, NROW): inputs held over the interval */
    long row_batch;
    const double *time;                 /* (.., rows) */
    long time_batch;
    const double *p;                    /* (NP) */
} Problem;

static V *room(long count) {
    void *place = NULL;
    if (posix_memalign(&place, 64, (size_t)(count > 0 ? count : 1) * sizeof(V))) return NULL;
    memset(place, 0, (size_t)(count > 0 ? count : 1) * sizeof(V));
    return place;
}

/* One number of each lane's trajectory; the last trajectory stands in for those that are not there. */
static inline V gather(const double *from, long stride, long first, long batch) {
#if LANES == 1
    (void)batch;
    return from[first * stride];
#else
    V v;
    if (!stride) return (V){0} + from[0];
    if (first + LANES <= batch) {
        from += first * stride;
        for (int l = 0; l < LANES; l++) v[l] = from[l * stride];
        return v;
    }
    for (int l = 0; l < LANES; l++) {
        long at = first + l < batch ? first + l : batch - 1;
        v[l] = from[at * stride];
    }
    return v;
#endif
}

static inline int lanes_of(long first, long batch) {
    return batch - first < LANES ? (int)(batch - first) : LANES;
}

/* The inputs of an interval: of the rows that are held, the numbers that count. */
static void hold(const Problem *q, long first, long k, V *u) {
    for (int n = 0; n < ROWS_USED; n++) {
        const int i = ROW_USED[n];
        u[NDRIVE + i] = gather(q->row + k * NROW + i, q->row_batch, first, q->batch);
    }
}

static void drive(const Problem *q, long first, long k, long part, V *mean, V *slope) {
    long at = k * q->drive_row + part * q->drive_part;
    for (int i = 0; i < NDRIVE; i++) {
        mean[i] = gather(q->mean + at + i, q->drive_batch, first, q->batch);
        if (q->slope) slope[i] = gather(q->slope + at + i, q->drive_batch, first, q->batch);
    }
}

static inline void at_stage(int s, const V *mean, const V *slope, int sloped, V begin, V h, V *u) {
    for (int i = 0; i < NDRIVE; i++) u[i] = sloped ? mean[i] + (STAGE[s] - 0.5) * slope[i] : mean[i];
    u[NDRIVE + NROW] = begin + STAGE[s] * h;
}

/* One step from y; leaves where each stage was evaluated in `places` and the state before projection in `raw`. */
static void step(const V *y, const V *mean, const V *slope, int sloped, V begin, V h, V *u, const double *p,
                 const double *b, V *places, V *raw, V *next) {
    V slopes[NY], total[NY];
    for (int s = 0; s < STAGES; s++) {
        V *at = places + s * NY;
        for (int i = 0; i < NY; i++) at[i] = s ? y[i] + (STAGE[s] * h) * slopes[i] : y[i];
        at_stage(s, mean, slope, sloped, begin, h, u);
        rate(at, u, p, b, slopes);
        for (int i = 0; i < NY; i++) total[i] = s ? total[i] + WEIGHT[s] * slopes[i] : WEIGHT[s] * slopes[i];
    }
    for (int i = 0; i < NY; i++) raw[i] = y[i] + h * total[i];
    project(raw, next);
}

/* The derivative at `count` states: what the agreement with torch is checked on. */
int auvnn_rate(long count, const double *y, const double *u, const double *p, double *out) {
    double b[NB + 1];
    prologue(p, b);
    for (long first = 0; first < count; first += LANES) {
        V state[NY], input[NU], found[NY];
        for (int i = 0; i < NY; i++) state[i] = gather(y + i, NY, first, count);
        for (int i = 0; i < NU; i++) input[i] = gather(u + i, NU, first, count);
        rate(state, input, p, b, found);
        for (int l = 0; l < lanes_of(first, count); l++)
            for (int i = 0; i < NY; i++) out[(first + l) * NY + i] = LANE(found[i], l);
    }
    return 0;
}

int auvnn_run(const Problem *q, double *out) {
    double b[NB + 1];
    prologue(q->p, b);
    for (long first = 0; first < q->batch; first += LANES) {
        int lanes = lanes_of(first, q->batch);
        V y[NY], u[NU] = {0}, mean[NDRIVE], slope[NDRIVE], places[STAGES * NY], raw[NY];
        for (int i = 0; i < NY; i++) y[i] = gather(q->y0 + i, NY, first, q->batch);
        for (long k = 0; k < q->rows; k++) {
            for (int l = 0; l < lanes; l++)
                for (int i = 0; i < NY; i++) out[((first + l) * q->rows + k) * NY + i] = LANE(y[i], l);
            if (k + 1 == q->rows) break;
            V begin = gather(q->time + k, q->time_batch, first, q->batch);
            V end = gather(q->time + k + 1, q->time_batch, first, q->batch);
            V h = (end - begin) / (double)q->parts;
            hold(q, first, k, u);
            for (long part = 0; part < q->parts; part++) {
                if (!part || q->drive_part) drive(q, first, k, part, mean, slope);
                step(y, mean, slope, q->slope != NULL, begin + (double)part * h, h, u, q->p, b, places, raw, y);
            }
        }
    }
    return 0;
}

#ifdef GRADIENT

int auvnn_rate_back(long count, const double *y, const double *u, const double *p, const double *ct, double *gy,
                    double *gu, double *gp) {
    double b[NB + 1];
    prologue(p, b);
    V *sum = room(NW);
    if (!sum) return 1;
    for (long first = 0; first < count; first += LANES) {
        V state[NY], input[NU], back[NY], found[NY], inputs[NU];
        int lanes = lanes_of(first, count);
        for (int i = 0; i < NY; i++) state[i] = gather(y + i, NY, first, count);
        for (int i = 0; i < NU; i++) input[i] = gather(u + i, NU, first, count);
        for (int i = 0; i < NY; i++) {
            back[i] = gather(ct + i, NY, first, count);
#if LANES > 1
            for (int l = lanes; l < LANES; l++) back[i][l] = 0.0;
#endif
        }
        rate_back(state, input, p, b, back, found, inputs, sum);
        for (int l = 0; l < lanes; l++) {
            for (int i = 0; i < NY; i++) gy[(first + l) * NY + i] = LANE(found[i], l);
            for (int i = 0; i < NU; i++) gu[(first + l) * NU + i] = LANE(inputs[i], l);
        }
    }
    for (int k = 0; k < NW; k++)
        for (int l = 0; l < LANES; l++) gp[k] += LANE(sum[k], l);
    free(sum);
    return 0;
}

typedef struct {
    const double *run;        /* (batch, rows, NY), as auvnn_run left it */
    const double *back;       /* (batch, rows, NY): cotangent of it */
    double *y0;               /* (batch, NY) */
    double *mean, *slope;     /* laid out like mean and slope, added to; NULL where not wanted */
    double *row;              /* laid out like row, added to, or NULL */
    double *p;                /* (NW), added to */
} Adjoint;

static inline void scatter(double *to, long stride, long first, int lanes, V v) {
    for (int l = 0; l < lanes; l++) to[(first + l) * stride] += LANE(v, l);
}

/* Backwards through the intervals: the states at their ends are known, those between are run again. */
int auvnn_back(const Problem *q, const Adjoint *g) {
    double b[NB + 1];
    prologue(q->p, b);
    V *sum = room(NW);
    V *states = room((q->parts + 1) * NY);
    if (!sum || !states) { free(sum); free(states); return 1; }
    int sloped = q->slope != NULL;
    for (long first = 0; first < q->batch; first += LANES) {
        int lanes = lanes_of(first, q->batch);
        V u[NU] = {0}, mean[NDRIVE], slope[NDRIVE], places[STAGES * NY], raw[NY], next[NY], adjoint[NY];
        for (int i = 0; i < NY; i++) adjoint[i] = (V){0};
        for (long k = q->rows - 1; k >= 0; k--) {
            for (int l = 0; l < lanes; l++)
                for (int i = 0; i < NY; i++)
                    LANE(adjoint[i], l) += g->back[((first + l) * q->rows + k) * NY + i];
            if (!k) break;
            long from = k - 1;
            V begin = gather(q->time + from, q->time_batch, first, q->batch);
            V end = gather(q->time + from + 1, q->time_batch, first, q->batch);
            V h = (end - begin) / (double)q->parts;
            hold(q, first, from, u);
            for (int i = 0; i < NY; i++)
                states[i] = gather(g->run + from * NY + i, q->rows * NY, first, q->batch);
            for (long part = 0; part + 1 < q->parts; part++) {
                drive(q, first, from, part, mean, slope);
                step(states + part * NY, mean, slope, sloped, begin + (double)part * h, h, u, q->p, b, places, raw,
                     states + (part + 1) * NY);
            }
            for (long part = q->parts - 1; part >= 0; part--) {
                V start = begin + (double)part * h;
                drive(q, first, from, part, mean, slope);
                step(states + part * NY, mean, slope, sloped, start, h, u, q->p, b, places, raw, next);
                V over[NY], back[NY], found[NY], inputs[NU], later[NY], gmean[NDRIVE], gslope[NDRIVE], grow[NROW + 1];
                project_back(raw, adjoint, over);
                for (int i = 0; i < NY; i++) { adjoint[i] = over[i]; later[i] = (V){0}; }
                for (int i = 0; i < NDRIVE; i++) { gmean[i] = (V){0}; gslope[i] = (V){0}; }
                for (int n = 0; n < ROWS_USED; n++) grow[ROW_USED[n]] = (V){0};
                for (int s = STAGES - 1; s >= 0; s--) {
                    for (int i = 0; i < NY; i++) back[i] = (h * WEIGHT[s]) * over[i] + later[i];
                    at_stage(s, mean, slope, sloped, start, h, u);
                    rate_back(places + s * NY, u, q->p, b, back, found, inputs, sum);
                    for (int i = 0; i < NY; i++) {
                        adjoint[i] += found[i];
                        later[i] = (STAGE[s] * h) * found[i];
                    }
                    for (int i = 0; i < NDRIVE; i++) {
                        gmean[i] += inputs[i];
                        gslope[i] += (STAGE[s] - 0.5) * inputs[i];
                    }
                    for (int n = 0; n < ROWS_USED; n++) grow[ROW_USED[n]] += inputs[NDRIVE + ROW_USED[n]];
                }
                long at = from * q->drive_row + part * q->drive_part;
                for (int i = 0; i < NDRIVE; i++) {
                    if (g->mean) scatter(g->mean + at + i, q->drive_batch, first, lanes, gmean[i]);
                    if (g->slope) scatter(g->slope + at + i, q->drive_batch, first, lanes, gslope[i]);
                }
                if (g->row)
                    for (int n = 0; n < ROWS_USED; n++) {
                        const int i = ROW_USED[n];
                        scatter(g->row + from * NROW + i, q->row_batch, first, lanes, grow[i]);
                    }
            }
        }
        for (int l = 0; l < lanes; l++)
            for (int i = 0; i < NY; i++) g->y0[(first + l) * NY + i] = LANE(adjoint[i], l);
    }
    for (int k = 0; k < NW; k++)
        for (int l = 0; l < LANES; l++) g->p[k] += LANE(sum[k], l);
    free(sum);
    free(states);
    return 0;
}

#endif
