/* Jacobians of a function at many points, row by row, for the functions that come before this text: prologue and
   back. Points and rows of their Jacobians are pairs; LANES of them run side by side in one vector V. */

/* Of pairs `begin` to `end` (excluded); pair k is row k % ROWS at point k / ROWS. */
int auvnn_jacobian(long begin, long end, const double *y, const double *u, const double *p, const long *column,
                   long width, double *out) {
    double b[NB + 1];
    prologue(p, b);
    for (long first = begin; first < end; first += LANES) {
        V state[NY], input[NU], cotangent[ROWS], found[NG];
        long point[LANES];
        for (int i = 0; i < ROWS; i++) cotangent[i] = (V){0};
        for (int l = 0; l < LANES; l++) {
            /* The last pair stands in for those that are not there. */
            const long pair = first + l < end ? first + l : end - 1;
            point[l] = pair / ROWS;
            LANE(cotangent[pair % ROWS], l) = 1.0;
        }
        for (int i = 0; i < NY; i++)
            for (int l = 0; l < LANES; l++) LANE(state[i], l) = y[point[l] * NY + i];
        for (int i = 0; i < NU; i++)
            for (int l = 0; l < LANES; l++) LANE(input[i], l) = u[point[l] * NU + i];
        back(state, input, p, b, cotangent, found);
        for (int l = 0; l < LANES && first + l < end; l++) {
            double *to = out + (first + l) * width;
            for (int k = 0; k < NG; k++) to[column[k]] = LANE(found[k], l);
        }
    }
    return 0;
}
