// One time step of the acoustic scheme; built with REAL (float or double), HALO and TAPS.
//
// The factors of the medium and the weights of the stencil are those of the compiled kernels on the CPU, and
// sums are taken in the same order.

#pragma OPENCL FP_CONTRACT OFF

// Turns the field before `now` into the one after it, in place. The range covers the grid within its halo,
// axis 0 along y.
// now, old, keep, fade, drive   [nx][ny].
// weights   of the second derivative at distances 0 to HALO.
// flush     values far below it become 0.
kernel void advance(global const REAL *now, global REAL *old, global const REAL *keep,
                    global const REAL *fade, global const REAL *drive, constant REAL *weights,
                    const REAL flush, const uint ny)
{
    const uint here = (get_global_id(1) + HALO) * ny + get_global_id(0) + HALO;
    REAL laplacian = (weights[0] + weights[0]) * now[here];
    for (uint k = 1; k <= HALO; ++k)
        laplacian += weights[k] * ((now[here - k * ny] + now[here + k * ny]) + (now[here - k] + now[here + k]));
    const REAL next = keep[here] * now[here] - fade[here] * old[here] + drive[here] * laplacian;
    old[here] = (next + flush) - flush;
}

// Adds a sample of the source; one work-item a tap, axis 0 along y.
// first   the tap nearest to the origin, x then y.
// along   [axis][tap], its weights.
kernel void inject(global REAL *field, global const REAL *drive, constant int *first, constant REAL *along,
                   global const REAL *wavelet, const uint step, const uint ny)
{
    const uint i = get_global_id(1), j = get_global_id(0);
    const uint here = (first[0] + i) * ny + first[1] + j;
    field[here] += drive[here] * (along[i] * along[TAPS + j] * wavelet[step]);
}

// Reads the field at every receiver, one work-item each.
// first    [receiver][axis].
// along    [receiver][axis][tap].
// traces   [receiver][step].
kernel void record(global const REAL *field, global const int *first, global const REAL *along,
                   global REAL *traces, const uint step, const uint steps, const uint ny)
{
    const uint r = get_global_id(0);
    global const REAL *weight = along + r * 2 * TAPS;
    REAL found = 0;
    for (uint i = 0; i < TAPS; ++i)
        for (uint j = 0; j < TAPS; ++j)
            found += weight[i] * weight[TAPS + j] * field[(first[2 * r] + i) * ny + first[2 * r + 1] + j];
    traces[r * steps + step] = found;
}
