// Delay and sum of analytic signals, the same sums as tomography/reflection/delay_and_sum.py, pixel by pixel.
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
// Products and sums are rounded one by one, as in compiled code, so that both read the same samples.
#pragma OPENCL FP_CONTRACT OFF

// Value and slopes of a cubic spline (stored_x, stored_y) at a point, in nodes; as splines/cubic.py.
// Scalars only: not every device computes vectors of doubles right.
void jet(global const float *spline, int stored_x, int stored_y, double x, double y, double *value,
         double *slope_x, double *slope_y)
{
    int i = min(max((int)x, 0), stored_x - 4), j = min(max((int)y, 0), stored_y - 4);
    double t = x - i, u = 1.0 - t, s = y - j, v = 1.0 - s;
    double wx[4] = {u * u * u / 6.0, 2.0 / 3.0 - t * t * (1.0 - 0.5 * t), 2.0 / 3.0 - u * u * (1.0 - 0.5 * u),
                    t * t * t / 6.0};
    double wy[4] = {v * v * v / 6.0, 2.0 / 3.0 - s * s * (1.0 - 0.5 * s), 2.0 / 3.0 - v * v * (1.0 - 0.5 * v),
                    s * s * s / 6.0};
    double dx[4] = {-0.5 * u * u, t * (1.5 * t - 2.0), u * (2.0 - 1.5 * u), 0.5 * t * t};
    double dy[4] = {-0.5 * v * v, s * (1.5 * s - 2.0), v * (2.0 - 1.5 * v), 0.5 * s * s};
    *value = *slope_x = *slope_y = 0.0;
    for (int p = 0; p < 4; ++p) {
        double level = 0.0, slope = 0.0;
        global const float *row = spline + (size_t)(i + p) * stored_y + j;
        for (int q = 0; q < 4; ++q) {
            level += wy[q] * row[q];
            slope += dy[q] * row[q];
        }
        *value += wx[p] * level;
        *slope_x += dx[p] * level;
        *slope_y += wx[p] * slope;
    }
}

// Time and direction of some pixels as seen from each element, (elements, pixels).
kernel void view_pixels(global const double *places, global const float *slowness,
                        int stored_x, int stored_y, double spacing, global const double *px,
                        global const double *py, int pixels, global float4 *views)
{
    int p = get_global_id(0), k = get_global_id(1);
    if (p >= pixels)
        return;
    size_t spline = (size_t)k * stored_x * stored_y;
    double x = px[p] - places[2 * k], y = py[p] - places[2 * k + 1];
    double distance = sqrt(x * x + y * y);
    double mean, in_x, in_y;
    jet(slowness + spline, stored_x, stored_y, px[p], py[p], &mean, &in_x, &in_y);
    double gx = mean * x / distance + distance * in_x, gy = mean * y / distance + distance * in_y;
    double length = sqrt(gx * gx + gy * gy);
    double time = spacing * distance * mean;
    views[(size_t)k * pixels + p] = (float4)(time, gx / length, gy / length, 0.0);
}

// b_e(x) and the sum of the weights of one emission at each pixel, over the receivers in their order.
kernel void sum_receivers(global const float *signals, global const uchar *used,
                          global const int *emitters, global const int *receivers, int count,
                          int samples, global const float4 *views, int pixels, float rate, float first,
                          float least, float scale, global float4 *found)
{
    int p = get_global_id(0), e = get_global_id(1);
    if (p >= pixels)
        return;
    float4 sent = views[(size_t)emitters[e] * pixels + p];
    float real = 0.0f, imaginary = 0.0f, total = 0.0f, last = samples - 2;
    for (int r = 0; r < count; ++r) {
        if (!used[e * count + r])
            continue;
        float4 back = views[(size_t)receivers[r] * pixels + p];
        float weight = fmax(0.0f, (sent.y * back.y + sent.z * back.z - least) * scale);
        if (weight == 0.0f)
            continue;
        float place = fmin(fmax(rate * (sent.x + back.x) - first, 0.0f), last);
        int k = (int)place;
        float part = place - k;
        global const float *trace = signals + ((size_t)e * count + r) * 2 * samples + k;
        real += weight * (trace[0] + part * (trace[1] - trace[0]));
        imaginary += weight * (trace[samples] + part * (trace[samples + 1] - trace[samples]));
        total += weight;
    }
    found[(size_t)e * pixels + p] = (float4)(real, imaginary, total, 0.0f);
}

// Sums over the emissions in their order: echo (real, imaginary), power and weight of each pixel.
kernel void sum_emissions(global const float4 *found, int emissions, int pixels, global float4 *sums)
{
    int p = get_global_id(0);
    if (p >= pixels)
        return;
    float4 sum = (float4)(0.0f);
    for (int e = 0; e < emissions; ++e) {
        float4 one = found[(size_t)e * pixels + p];
        sum.x += one.x;
        sum.y += one.y;
        sum.z += one.x * one.x + one.y * one.y;
        sum.w += one.z;
    }
    sums[p] = sum;
}
