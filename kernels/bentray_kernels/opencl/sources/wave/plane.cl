// Acoustic waves of several emitters in 2-D, and their adjoint; built with REAL (float or double), HALO, TAPS,
// ROWS and STORE.
//
// The factors of the medium and the weights of the stencil are those of the compiled kernels on the CPU, and
// sums are taken in the same order, so that fields do not depend on the emitters that share a launch. Rows of
// a grid are `pitch` apart, those of the next emitter begin `plane` later. The factors are 0 in the halo and
// where a grid is filled up to whole groups: fields remain 0 there.
//
// STORE   what a step stores of the field, the source that a change of the medium would scatter:
//         0 nothing, 1 by a change of the speed, 2 by one of the damping.
// nodes   of the image: margin of the grid, nx, ny.

#pragma OPENCL FP_CONTRACT OFF

// The Laplacian times spacing squared.
// column   the nodes along x around this one.
// row      this node.
inline REAL laplacian(const REAL *column, global const REAL *row, constant REAL *weights)
{
    REAL sum = (weights[0] + weights[0]) * column[0];
#pragma unroll
    for (int k = 1; k <= HALO; ++k)
        sum += weights[k] * ((column[-k] + column[k]) + (row[-k] + row[k]));
    return sum;
}

// Turns the field before `now` into the one after it, in place. A work-item takes ROWS nodes along x, so that
// it reads each of them once; axis 0 along y, axis 2 the emitters.
// first   the first node within the halo.
// flush   values far below it become 0.
kernel void advance(global const REAL *restrict now, global REAL *restrict old,
                    global const REAL *restrict keep, global const REAL *restrict fade,
                    global const REAL *restrict drive, constant REAL *weights, const REAL flush,
                    const uint first, const uint pitch, const uint plane, const uint4 nodes,
                    global REAL *restrict stored, const uint slot)
{
    const size_t emitter = get_global_id(2) * plane;
    const uint at = first + get_global_id(1) * ROWS * pitch + get_global_id(0);
    REAL column[ROWS + 2 * HALO];
#pragma unroll
    for (int r = 0; r < ROWS + 2 * HALO; ++r)
        column[r] = now[emitter + at + (r - HALO) * (int)pitch];
#pragma unroll
    for (int r = 0; r < ROWS; ++r) {
        const uint node = at + r * pitch;
        const REAL here = column[r + HALO], before = old[emitter + node];
        const REAL bent = laplacian(column + r + HALO, now + emitter + node, weights);
        const REAL next = (keep[node] * here - fade[node] * before + drive[node] * bent + flush) - flush;
        old[emitter + node] = next;
#if STORE
        const uint x = get_global_id(1) * ROWS + r - (nodes.x - HALO), y = get_global_id(0) - (nodes.x - HALO);
        if (x < nodes.y && y < nodes.z) {
            const REAL turn = (1 - fade[node]) / (1 + fade[node]);
            stored[((slot * get_global_size(2) + get_global_id(2)) * nodes.y + x) * nodes.z + y] =
                STORE == 1 ? bent : (turn + turn) * here - before + next;
        }
#endif
    }
}

// Ends a step forwards: receivers read the field before it, emitters add their sample to the one after it, and
// to what the step stored. Axis 0: the receivers, then the taps of the emitter; axis 1: the emitters.
// receiver, emitter   [element][axis], the tap nearest to the origin.
// reading, sending    [element][axis][tap], weights.
// traces              [emitter][step][receiver].
// shift               from a node of the padded image to its place in the grid.
kernel void exchange(global const REAL *restrict now, global REAL *restrict next,
                     global const REAL *restrict drive, global const uint *restrict receiver,
                     global const REAL *restrict reading, global REAL *restrict traces,
                     global const uint *restrict emitter, global const REAL *restrict sending,
                     global const REAL *restrict wavelet, const uint steps, const uint receivers,
                     const uint shift, const uint pitch, const uint plane, const uint4 nodes,
                     global REAL *restrict stored, const uint slot, const uint step)
{
    const uint r = get_global_id(0);
    const size_t b = get_global_id(1);
    if (r < receivers) {
        global const REAL *along = reading + r * 2 * TAPS;
        global const REAL *corner = now + b * plane + receiver[2 * r] * pitch + receiver[2 * r + 1] + shift;
        REAL value = 0;
        for (uint i = 0; i < TAPS; ++i)
            for (uint j = 0; j < TAPS; ++j)
                value += along[i] * along[TAPS + j] * corner[i * pitch + j];
        traces[(b * steps + step) * receivers + r] = value;
        return;
    }
    const uint i = (r - receivers) / TAPS, j = (r - receivers) % TAPS;
    const uint x = emitter[2 * b] + i, y = emitter[2 * b + 1] + j, node = x * pitch + y + shift;
    const REAL sample = sending[2 * TAPS * b + i] * sending[2 * TAPS * b + TAPS + j] * wavelet[step];
    const REAL added = drive[node] * sample;
    next[b * plane + node] += added;
#if STORE
    const uint u = x - nodes.x, v = y - nodes.x;
    if (u < nodes.y && v < nodes.z)
        stored[((slot * get_global_size(1) + b) * nodes.y + u) * nodes.z + v] += STORE == 1 ? sample : added;
#endif
}

// Adds the product of the adjoint field and a stored one to the image of each emitter, and the energy of the
// stored one where `lit`. Axis 0 along y, axis 2 the emitters.
// image, light   [emitter][nx][ny].
kernel void correlate(global const REAL *restrict adjoint, global const REAL *restrict stored,
                      global REAL *restrict image, global REAL *restrict light, const uint shift,
                      const uint pitch, const uint plane, const uint4 nodes, const uint slot, const uint lit)
{
    const uint y = get_global_id(0), x = get_global_id(1);
    const size_t b = get_global_id(2), here = (b * nodes.y + x) * nodes.z + y;
    const REAL wave = stored[(slot * get_global_size(2)) * nodes.y * nodes.z + here];
    image[here] += adjoint[b * plane + (x + nodes.x) * pitch + y + nodes.x + shift] * wave;
    if (lit)
        light[here] += wave * wave;
}

// Adds the residuals of all receivers to the adjoint field, in the order of the receivers where their taps
// meet. Axis 0: the nodes that have a tap; axis 1: the emitters.
// node       place in the grid.
// begin      of the entries of each node, and their end.
// receiver   of each entry, and its weight.
// residual   [emitter][step][receiver].
kernel void inject(global REAL *restrict next, global const REAL *restrict drive,
                   global const uint *restrict node, global const uint *restrict begin,
                   global const uint *restrict receiver, global const REAL *restrict weight,
                   global const REAL *restrict residual, const uint steps, const uint receivers,
                   const uint plane, const uint step)
{
    const uint k = get_global_id(0);
    const size_t b = get_global_id(1);
    global const REAL *samples = residual + (b * steps + step) * receivers;
    REAL sum = 0;
    for (uint e = begin[k]; e < begin[k + 1]; ++e)
        sum += weight[e] * samples[receiver[e]];
    next[b * plane + node[k]] += drive[node[k]] * sum;
}
