// Acoustic waves of several emitters in 2-D or 3-D, and their adjoint; built with REAL (float or double), DIMS,
// HALO, TAPS, ROWS, STORE and FILLED.
//
// The factors of the medium and the weights of the stencil are those of the compiled kernels on the CPU, and
// sums are taken in the same order, so that fields do not depend on the emitters that share a launch. A grid
// has rows along its last axis, `pitch` apart, and slabs along its first, `slab` apart (in 2-D a slab is a
// row); the grid of the next emitter begins `plane` later. The factors are 0 in the halo and where a grid is
// filled up to whole groups: fields remain 0 there.
//
// STORE   what is stored of the field, the source that a change of the medium would scatter: 0 nothing, 1 by a
//         change of the speed, 2 by one of the damping.
// FILLED  whether launches over the image are filled up to whole groups; a processor needs none, and its compiler
//         uses vectors only without the test.
// nodes   of the image: margin of the grid; slabs, rows of a slab (1 in 2-D), nodes of a row.

#pragma OPENCL FP_CONTRACT OFF

// The Laplacian times spacing squared.
// column   the nodes along the first axis around this one.
// row      this node.
inline REAL laplacian(const REAL *column, global const REAL *row, const int pitch, constant REAL *weights)
{
    REAL centre = weights[0] + weights[0];
#if DIMS == 3
    centre += weights[0];
#endif
    REAL sum = centre * column[0];
#pragma unroll
    for (int k = 1; k <= HALO; ++k) {
        REAL around = column[-k] + column[k];
#if DIMS == 3
        around += row[-k * pitch] + row[k * pitch];
#endif
        sum += weights[k] * (around + (row[-k] + row[k]));
    }
    return sum;
}

// Place in the grid of a node of the image.
inline uint place(const uint row, const uint z, const uint shift, const uint pitch, const uint slab,
                  const uint4 nodes)
{
#if DIMS == 3
    return (row / nodes.z + nodes.x) * slab + (row % nodes.z + nodes.x) * pitch + z + nodes.x + shift;
#else
    return (row + nodes.x) * slab + z + nodes.x + shift;
#endif
}

// Turns the field before `now` into the one after it, in place. A work-item takes ROWS nodes along the first
// axis, a block, so that it reads each of them once. Axis 0 along the last axis of the grid; then the blocks
// and the emitters, in 3-D the rows, and the blocks of all emitters.
// first   the first node within the halo.
// flush   values far below it become 0.
kernel void advance(global const REAL *restrict now, global REAL *restrict old,
                    global const REAL *restrict keep, global const REAL *restrict fade,
                    global const REAL *restrict drive, constant REAL *weights, const REAL flush,
                    const uint first, const uint pitch, const uint slab, const ulong plane, const uint blocks)
{
#if DIMS == 3
    const uint block = get_global_id(2) % blocks, b = get_global_id(2) / blocks, row = get_global_id(1);
#else
    const uint block = get_global_id(1), b = get_global_id(2), row = 0;
#endif
    const size_t emitter = b * plane;
    const uint at = first + block * ROWS * slab + row * pitch + get_global_id(0);
    REAL column[ROWS + 2 * HALO];
#pragma unroll
    for (int r = 0; r < ROWS + 2 * HALO; ++r)
        column[r] = now[emitter + at + (r - HALO) * (int)slab];
#pragma unroll
    for (int r = 0; r < ROWS; ++r) {
        const uint node = at + r * slab;
        const REAL here = column[r + HALO], before = old[emitter + node];
        const REAL bent = laplacian(column + r + HALO, now + emitter + node, pitch, weights);
        const REAL next = (keep[node] * here - fade[node] * before + drive[node] * bent + flush) - flush;
        old[emitter + node] = next;
    }
}

// Ends a step forwards: receivers read the field before it, emitters add their sample to the one after it, and
// to what the step stored. Axis 0: the receivers, then the taps of the emitter, filled up; axis 1: the emitters.
// receiver, emitter   [element][axis], the tap nearest to the origin.
// reading, sending    [element][axis][tap], weights.
// traces              [emitter][step][receiver].
// shift               from a node of the padded image to its place in the grid.
kernel void exchange(global const REAL *restrict now, global REAL *restrict next,
                     global const REAL *restrict drive, global const uint *restrict receiver,
                     global const REAL *restrict reading, global REAL *restrict traces,
                     global const uint *restrict emitter, global const REAL *restrict sending,
                     global const REAL *restrict wavelet, const uint steps, const uint receivers,
                     const uint shift, const uint pitch, const uint slab, const ulong plane, const uint4 nodes,
                     global REAL *restrict stored, const uint slot, const uint step)
{
    const uint r = get_global_id(0);
    const size_t b = get_global_id(1);
    if (r < receivers) {
        global const REAL *along = reading + r * DIMS * TAPS;
        receiver += r * DIMS;
        REAL value = 0;
#if DIMS == 3
        global const REAL *corner = now + b * plane + receiver[0] * slab + receiver[1] * pitch + receiver[2] + shift;
        for (uint i = 0; i < TAPS; ++i)
            for (uint j = 0; j < TAPS; ++j) {
                REAL line = 0;
                for (uint k = 0; k < TAPS; ++k)
                    line += along[2 * TAPS + k] * corner[i * slab + j * pitch + k];
                value += along[i] * along[TAPS + j] * line;
            }
#else
        global const REAL *corner = now + b * plane + receiver[0] * slab + receiver[1] + shift;
        for (uint i = 0; i < TAPS; ++i)
            for (uint j = 0; j < TAPS; ++j)
                value += along[i] * along[TAPS + j] * corner[i * slab + j];
#endif
        traces[(b * steps + step) * receivers + r] = value;
        return;
    }
    const uint tap = r - receivers;
    if (tap >= TAPS * TAPS * (DIMS == 3 ? TAPS : 1))
        return;
    sending += b * DIMS * TAPS;
    emitter += b * DIMS;
#if DIMS == 3
    const uint i = tap / (TAPS * TAPS), j = tap / TAPS % TAPS, k = tap % TAPS;
    const uint x = emitter[0] + i, y = emitter[1] + j, z = emitter[2] + k;
    const uint node = x * slab + y * pitch + z + shift;
    const REAL sample = sending[i] * sending[TAPS + j] * sending[2 * TAPS + k] * wavelet[step];
#else
    const uint i = tap / TAPS, k = tap % TAPS;
    const uint x = emitter[0] + i, y = nodes.x, z = emitter[1] + k;
    const uint node = x * slab + z + shift;
    const REAL sample = sending[i] * sending[TAPS + k] * wavelet[step];
#endif
    const REAL added = drive[node] * sample;
    next[b * plane + node] += added;
#if STORE
    const uint u = x - nodes.x, v = y - nodes.x, w = z - nodes.x;
    if (u < nodes.y && v < nodes.z && w < nodes.w) {
        const size_t line = (((size_t)slot * get_global_size(1) + b) * nodes.y + u) * nodes.z + v;
        stored[line * nodes.w + w] += STORE == 1 ? sample : added;
    }
#endif
}

// Stores the source that a change of the medium would scatter in the step from `now`, except for the emitters'
// part, before the step. Axis 0 along the rows of the image, axis 1 its rows, axis 2 the emitters. It is not a
// part of `advance`, because stores within the image alone would keep compilers from using vectors there.
// stored   [slot][emitter][row][node].
kernel void scatter(global const REAL *restrict now, global const REAL *restrict old,
                    global const REAL *restrict keep, global const REAL *restrict fade,
                    global const REAL *restrict drive, constant REAL *weights, const REAL flush,
                    const uint shift, const uint pitch, const uint slab, const ulong plane, const uint4 nodes,
                    global REAL *restrict stored, const uint slot)
{
    const uint z = get_global_id(0), row = get_global_id(1), node = place(row, z, shift, pitch, slab, nodes);
    const size_t b = get_global_id(2), rows = nodes.y * nodes.z, at = b * plane + node;
#if FILLED
    if (row >= rows || z >= nodes.w)
        return;
#endif
    REAL column[1 + 2 * HALO];
#pragma unroll
    for (int k = -HALO; k <= HALO; ++k)
        column[k + HALO] = now[at + k * (int)slab];
    REAL value = laplacian(column + HALO, now + at, pitch, weights);
    if (STORE == 2) {
        const REAL here = column[HALO], before = old[at], turn = (1 - fade[node]) / (1 + fade[node]);
        const REAL next = (keep[node] * here - fade[node] * before + drive[node] * value + flush) - flush;
        value = (turn + turn) * here - before + next;
    }
    stored[((slot * get_global_size(2) + b) * rows + row) * nodes.w + z] = value;
}

// Adds the product of the adjoint field and a stored one to the image of each emitter, and the energy of the
// stored one where `lit`. Axis 0 along the rows of the image, axis 1 its rows, axis 2 the emitters.
// image, light   [emitter][row][node].
kernel void correlate(global const REAL *restrict adjoint, global const REAL *restrict stored,
                      global REAL *restrict image, global REAL *restrict light, const uint shift,
                      const uint pitch, const uint slab, const ulong plane, const uint4 nodes, const uint slot,
                      const uint lit)
{
    const uint z = get_global_id(0), row = get_global_id(1), node = place(row, z, shift, pitch, slab, nodes);
    const size_t b = get_global_id(2), rows = nodes.y * nodes.z, here = (b * rows + row) * nodes.w + z;
#if FILLED
    if (row >= rows || z >= nodes.w)
        return;
#endif
    const REAL wave = stored[slot * get_global_size(2) * rows * nodes.w + here];
    image[here] += adjoint[b * plane + node] * wave;
    if (lit)
        light[here] += wave * wave;
}

// Adds the residuals of all receivers to the adjoint field, in the order of the receivers where their taps
// meet. Axis 0: the nodes that have a tap, `count`, filled up; axis 1: the emitters.
// node       place in the grid.
// begin      of the entries of each node, and their end.
// receiver   of each entry, and its weight.
// residual   [emitter][step][receiver].
kernel void inject(global REAL *restrict next, global const REAL *restrict drive,
                   global const uint *restrict node, global const uint *restrict begin,
                   global const uint *restrict receiver, global const REAL *restrict weight,
                   global const REAL *restrict residual, const uint steps, const uint receivers,
                   const ulong plane, const uint count, const uint step)
{
    const uint k = get_global_id(0);
    if (k >= count)
        return;
    const size_t b = get_global_id(1);
    global const REAL *samples = residual + (b * steps + step) * receivers;
    REAL sum = 0;
    for (uint e = begin[k]; e < begin[k + 1]; ++e)
        sum += weight[e] * samples[receiver[e]];
    next[b * plane + node[k]] += drive[node[k]] * sum;
}
