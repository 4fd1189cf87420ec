/* The camera's motion. */

#include "loops.h"

enum { LANES = 8, SUMS = 12 }; /* partial sums, added in the same order on all machines */

/* What a pixel adds to the upper half of the normal equations and to their two right-hand sides. */
INLINE void add_place(double w, double x, double y, double u, double v, int lane,
                      double sums[SUMS][LANES])
{
    double wx = w * x, wy = w * y;
    sums[0][lane] += w;
    sums[1][lane] += wx;
    sums[2][lane] += wy;
    sums[3][lane] += wx * x;
    sums[4][lane] += wx * y;
    sums[5][lane] += wy * y;
    sums[6][lane] += w * u;
    sums[7][lane] += wx * u;
    sums[8][lane] += wy * u;
    sums[9][lane] += w * v;
    sums[10][lane] += wx * v;
    sums[11][lane] += wy * v;
}

/* Solve three symmetric, positive definite equations by elimination. */
INLINE void solve(const double *sum, const double *right, double *out)
{
    double a = sum[1] / sum[0], b = sum[2] / sum[0];
    double xx = sum[3] - a * sum[1], xy = sum[4] - a * sum[2], yy = sum[5] - b * sum[2];
    double rx = right[1] - a * right[0], ry = right[2] - b * right[0], c = xy / xx;
    out[2] = (ry - c * rx) / (yy - c * xy);
    out[1] = (rx - xy * out[2]) / xx;
    out[0] = (right[0] - sum[1] * out[1] - sum[2] * out[2]) / sum[0];
}

/* See compiled.camera_model. */
CLONED void itmo_camera_model(const double *across, const double *down, const double *vectors,
                              const double *texture, int64_t count, const double *sigmas,
                              int64_t rounds, double ridge, double *weight, double *model)
{
    const double *u = vectors, *v = vectors + count;
    memcpy(weight, texture, count * sizeof *weight);
    for (int64_t round = 0; round < rounds; round++) {
        double sums[SUMS][LANES] = {{0}}, sum[SUMS];
        int64_t i = 0;
        for (; i + LANES <= count; i += LANES)
            for (int k = 0; k < LANES; k++)
                add_place(weight[i + k], across[i + k], down[i + k], u[i + k], v[i + k], k, sums);
        for (; i < count; i++)
            add_place(weight[i], across[i], down[i], u[i], v[i], 0, sums);
        for (int s = 0; s < SUMS; s++) {
            sum[s] = 0;
            for (int k = 0; k < LANES; k++)
                sum[s] += sums[s][k];
        }
        sum[3] += ridge * sum[0];
        sum[5] += ridge * sum[0];
        solve(sum, sum + 6, model);
        solve(sum, sum + 9, model + 3);
        double scale = 1 / (sigmas[round] * sigmas[round]);
        for (i = 0; i < count; i++) {
            double off_x = u[i] - (model[0] + model[1] * across[i] + model[2] * down[i]);
            double off_y = v[i] - (model[3] + model[4] * across[i] + model[5] * down[i]);
            double far = 1 + (off_x * off_x + off_y * off_y) * scale;
            weight[i] = texture[i] / (far * far);
        }
    }
}
