// Misfits of simulated and recorded traces, and their derivatives in place of the traces; built with REAL.
//
// Traces, recorded traces and weights are [emitter][step][receiver], weights 0 for pairs that are not used.
// Axis 0 the receivers, axis 1 the emitters. The misfit of an emitter is the sum of the first of a pair over
// the sum of the second, and the derivatives are to be divided by the latter; all sums have a fixed order.
//
// scale   of the recorded traces, to the unit of the simulated ones.
// sums    [emitter][receiver], pairs.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF

// One minus the normalised correlation; the number of traces that are not 0.
kernel void correlation(global REAL *restrict traces, global const REAL *restrict recorded,
                        global const REAL *restrict weight, global double2 *restrict sums, const uint steps,
                        const uint receivers, const double scale)
{
    const size_t r = get_global_id(0), b = get_global_id(1), first = b * steps * receivers + r;
    double power = 0.0, both = 0.0, energy = 0.0;
    for (uint n = 0; n < steps; ++n) {
        const size_t at = first + (size_t)n * receivers;
        const double w = weight[at], s = traces[at], d = scale * recorded[at];
        power += w * s * s;
        both += w * s * d;
        energy += w * d * d;
    }
    const double size = sqrt(power * energy);
    const bool alive = size > 0.0;
    const double alike = alive ? both / size : 1.0, along = alive ? alike / power : 0.0,
                 against = alive ? 1.0 / size : 0.0;
    sums[b * receivers + r] = (double2)(1.0 - alike, alive ? 1.0 : 0.0);
    for (uint n = 0; n < steps; ++n) {
        const size_t at = first + (size_t)n * receivers;
        const double s = traces[at], d = scale * recorded[at];
        traces[at] = (REAL)(weight[at] * (s * along - d * against));
    }
}

// Half the weighted sum of squared differences; the weighted sum of squares of the recorded traces.
kernel void least_squares(global REAL *restrict traces, global const REAL *restrict recorded,
                          global const REAL *restrict weight, global double2 *restrict sums, const uint steps,
                          const uint receivers, const double scale)
{
    const size_t r = get_global_id(0), b = get_global_id(1), first = b * steps * receivers + r;
    double misfit = 0.0, energy = 0.0;
    for (uint n = 0; n < steps; ++n) {
        const size_t at = first + (size_t)n * receivers;
        const double w = weight[at], d = scale * recorded[at], gap = traces[at] - d;
        misfit += 0.5 * w * gap * gap;
        energy += w * d * d;
        traces[at] = (REAL)(w * gap);
    }
    sums[b * receivers + r] = (double2)(misfit, energy);
}
