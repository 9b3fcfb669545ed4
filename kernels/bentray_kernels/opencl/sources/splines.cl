// Value and gradient of a filtered grid at many points, one work-item per point; the last group has idle items.
//
// REAL: float or double, of the coefficients and the sums. TAPS: nodes that a point reads along one axis.
// WIDTH: numbers of a row of the tables (Stencil.weights).
// DIMS: 1 to 3; axes that the grid lacks come first, with one node that has weight 1 and slope 0.
// Scalars only: not every device computes vectors of doubles right.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define TAPS_X (DIMS == 3 ? TAPS : 1)
#define TAPS_Y (DIMS >= 2 ? TAPS : 1)

// Where a place beyond the outer nodes lies in the mirror; turned is -1 where the slope is then reversed.
double mirrored(double place, int nodes, REAL *turned)
{
    const double last = nodes - 1.0;
    *turned = 1;
    if (place >= 0.0 && place <= last)
        return place;
    const double within = place - 2.0 * last * floor(place / (2.0 * last));
    if (within <= last)
        return within;
    *turned = -1;
    return 2.0 * last - within;
}

// First node that is read along one axis, and the weights of TAPS nodes from there on.
int weigh(double place, double shift, int cells, constant const REAL *tables, REAL *weights, REAL *slopes)
{
    const double shifted = place + shift;
    // Not a number: any cell of the grid, and weights that are no numbers either.
    const int cell = (int)fmin(fmax(shifted, 0.0), (double)cells);
    const REAL t = (REAL)(shifted - cell);
    for (int tap = 0; tap < TAPS; ++tap) {
        REAL weight = 0, slope = 0;
        for (int power = TAPS - 1; power >= 0; --power) {
            weight = weight * t + tables[2 * power * WIDTH + tap];
            slope = slope * t + tables[(2 * power + 1) * WIDTH + tap];
        }
        weights[tap] = weight;
        slopes[tap] = slope;
    }
    return cell;
}

kernel void sample(global const REAL *coefficients, constant const REAL *tables, const double shift,
                   const int nodes_x, const int nodes_y, const int nodes_z, const int border,
                   const uint count, global const double *points, global REAL *values,
                   global REAL *gradients)
{
    const size_t point = get_global_id(0);
    if (point >= count)
        return;
    global const double *place = points + DIMS * point;
    REAL wx[TAPS], wy[TAPS], wz[TAPS], dx[TAPS], dy[TAPS], dz[TAPS], turned[3];
    size_t start = 0;
    const size_t stride_y = nodes_z + border, stride_x = stride_y * (DIMS >= 2 ? nodes_y + border : 1);
    wx[0] = wy[0] = 1;
    dx[0] = dy[0] = 0;
#if DIMS == 3
    const double x = mirrored(place[0], nodes_x, &turned[0]);
    start += stride_x * weigh(x, shift, nodes_x + border - TAPS, tables, wx, dx);
#endif
#if DIMS >= 2
    const double y = mirrored(place[DIMS - 2], nodes_y, &turned[1]);
    start += stride_y * weigh(y, shift, nodes_y + border - TAPS, tables, wy, dy);
#endif
    const double z = mirrored(place[DIMS - 1], nodes_z, &turned[2]);
    start += weigh(z, shift, nodes_z + border - TAPS, tables, wz, dz);

    REAL value = 0, slope_x = 0, slope_y = 0, slope_z = 0;
    for (int p = 0; p < TAPS_X; ++p) {
        REAL plane = 0, plane_y = 0, plane_z = 0;
        for (int q = 0; q < TAPS_Y; ++q) {
            global const REAL *line = coefficients + start + p * stride_x + q * stride_y;
            REAL level = 0, slope = 0;
            for (int r = 0; r < TAPS; ++r) {
                level += wz[r] * line[r];
                slope += dz[r] * line[r];
            }
            plane += wy[q] * level;
            plane_y += dy[q] * level;
            plane_z += wy[q] * slope;
        }
        value += wx[p] * plane;
        slope_x += dx[p] * plane;
        slope_y += wx[p] * plane_y;
        slope_z += wx[p] * plane_z;
    }
    values[point] = value;
#if DIMS == 3
    gradients[DIMS * point] = turned[0] * slope_x;
#endif
#if DIMS >= 2
    gradients[DIMS * point + DIMS - 2] = turned[1] * slope_y;
#endif
    gradients[DIMS * point + DIMS - 1] = turned[2] * slope_z;
}
