// Rays of emitters, their back-projection and the update of the image, as rays/vectorised.py and
// tomography/sart/emitter_pass.py. To be compiled after fronts.cl.
//
// Sums over rays are integers, whose order does not matter: the same device gives the same bits on every run.

#pragma OPENCL EXTENSION cl_khr_int64_base_atomics : enable

#define STRIDE 1.5f
#define ARRIVED 1e-3f
// Sums are counted in this part of a node, and of a node times the largest power of two in a correction.
#define QUANTUM 0x1p-36

// The gradient of the deviation, the relative slowness and padding of every node, over nodes and passes.
kernel void interleave(global const uint *numbers, const uint members, const uint step,
                       global const float *crossings, global const float *deviation, const int nx, const int ny,
                       global float4 *fields)
{
    const int node = get_global_id(0), nodes = nx * ny, pass = get_global_id(1);
    if (node >= nodes || EMITTER(pass) < 0)
        return;
    const int i = node / ny, j = node % ny;
    const int low = max(i - 1, 0), high = min(i + 1, nx - 1), left = max(j - 1, 0), right = min(j + 1, ny - 1);
    global const float *u = deviation + (ulong)pass * 2 * nodes;
#define AT(a, b) (((a) + (b)) % nx * ny + (b))
    const float slope_x = (u[AT(high, j)] - u[AT(low, j)]) * (high - low == 2 ? 0.5f : 1.0f);
    const float slope_y = (u[AT(i, right)] - u[AT(i, left)]) * (right - left == 2 ? 0.5f : 1.0f);
    const float slowness = crossings[(ulong)pass * 2 * nodes + AT(i, j)];
    fields[(ulong)pass * nodes + node] = (float4)(slope_x, slope_y, slowness, 0.0f);
}

// The fields at a place, multilinear.
float4 fields_at(global const float4 *fields, const float x, const float y, const int nx, const int ny)
{
    const int i = min((int)x, nx - 2), j = min((int)y, ny - 2);
    const float part_x = x - i, part_y = y - j;
    const float last = part_x * part_y, right = part_y - last, lower = part_x - last;
    global const float4 *node = fields + i * ny + j;
    return (1.0f - part_x - right) * node[0] + right * node[1] + lower * node[ny] + last * node[ny + 1];
}

// A ray for each receiver of each pass: its steps, its residual, and the residual over its length.
//   receivers   [slice][ring][receiver] (x, y), nodes.
//   ring        [slice][emitter], whose receivers an emitter has.
//   times       [slice][emitter][receiver], measured beyond water, s; NaN: none.
//   water       s of a node in water.
//   most        steps of a ray at most.
//   tracks      [pass][step] (x, y, length) of each receiver.
//   taken       [pass][receiver], steps; 0: no ray.
//   residuals   [pass][receiver], s.
//   correction  [pass][receiver], s for a node.
kernel void trace(global const double *slowness, global const double2 *sources, global const uint *numbers,
                  const uint members, const uint step, const uint emitters,
                  global const double2 *receivers, global const int *ring, global const double *times,
                  const uint rings, const uint count, const int nx, const int ny, const double spacing,
                  const double water, global const float4 *all_fields, const uint most, global float *tracks,
                  global uint *taken, global double *residuals, global float *correction)
{
    const uint r = get_global_id(0), pass = get_global_id(1);
    const int emitter = EMITTER(pass);
    if (r >= count)
        return;
    const ulong row = (ulong)(pass / members) * emitters + emitter, ray = (ulong)pass * count + r;
    taken[ray] = 0;
    correction[ray] = 0.0f;
    if (emitter < 0)
        return;
    const double beyond = times[row * count + r];
    if (isnan(beyond))
        return;
    const double2 source = sources[row];
    const double2 receiver = receivers[((ulong)(pass / members) * rings + ring[row]) * count + r];
    const double2 straight = receiver - source;
    const double measured = beyond + sqrt(straight.x * straight.x + straight.y * straight.y) * water;
    const double at_source = slowness_at(slowness + (ulong)(pass / members) * nx * ny, source.x, source.y, nx, ny);
    global const float4 *fields = all_fields + (ulong)pass * nx * ny;
    global float *track = tracks + (ulong)pass * most * 3 * count + r;
    const float2 goal = convert_float2(source), last = (float2)(nx - 1, ny - 1);
    float2 at = convert_float2(receiver);
    float2 away = goal - at;
    float2 direction = away * (1.0f / (sqrt(away.x * away.x + away.y * away.y) + TINY));
    float length = 0.0f, time = 0.0f;
    uint steps = 0;
    int arrived = 0;
    while (steps < most && !arrived) {
        away = goal - at;
        const float distance = sqrt(away.x * away.x + away.y * away.y);
        const float size = distance <= STRIDE ? distance : STRIDE;
        const float2 middle = clamp(at + 0.5f * size * direction, (float2)(0.0f), last);
        const float4 read = fields_at(fields, middle.x, middle.y, nx, ny);
        const float2 off = goal - middle;
        const float2 uphill = off * (1.0f / sqrt(off.x * off.x + off.y * off.y + TINY)) - read.xy;
        const float2 ahead = size < STRIDE ? away : uphill;
        direction = ahead * (1.0f / sqrt(ahead.x * ahead.x + ahead.y * ahead.y + TINY));
        at = clamp(at + size * direction, (float2)(0.0f), last);
        length += size;
        time += size * read.z;
        global float *place = track + (ulong)steps * 3 * count;
        place[0] = middle.x;
        place[count] = middle.y;
        place[2 * count] = size;
        ++steps;
        away = at - goal;
        arrived = away.x * away.x + away.y * away.y < ARRIVED * ARRIVED;
    }
    if (!arrived) {
        // Caught where the discrete gradient has no downhill direction: a straight ray replaces it.
        const float2 begin = convert_float2(receiver), whole = goal - begin;
        length = sqrt(whole.x * whole.x + whole.y * whole.y);
        time = 0.0f;
        const float size = length / steps;
        for (uint n = 0; n < steps; ++n) {
            const float2 middle = clamp(begin + (n + 0.5f) / steps * whole, (float2)(0.0f), last);
            time += size * fields_at(fields, middle.x, middle.y, nx, ny).z;
            global float *place = track + (ulong)n * 3 * count;
            place[0] = middle.x;
            place[count] = middle.y;
            place[2 * count] = size;
        }
    }
    const double residual = measured - time * (at_source * spacing);
    taken[ray] = steps;
    residuals[ray] = residual;
    correction[ray] = length > 0.0f ? (float)(residual / length) : 0.0f;
}

// Of each pass, one work-group each: the exponent of its largest correction, the sum of its squared
// residuals, and their histogram.
//   edges     of the bins, s, rising; the outer bins include all beyond the ends.
//   squares   [slice][emitter], s².
//   bins      [slice][bin]; added to.
__attribute__((reqd_work_group_size(GROUP, 1, 1)))
kernel void summarise(global const uint *numbers, const uint members, const uint step,
                      const uint emitters, const uint count, global const uint *taken, global const double *residuals,
                      global const float *correction, global int *exponents, global double *squares,
                      global const double *edges, const uint edge_count, global uint *bins)
{
    local double sums[GROUP];
    local float largest[GROUP];
    const uint item = get_local_id(0), pass = get_group_id(0), slice = pass / members;
    double sum = 0.0;
    float most = 0.0f;
    for (uint r = item; r < count; r += GROUP) {
        const ulong ray = (ulong)pass * count + r;
        if (taken[ray] == 0)
            continue;
        const double residual = residuals[ray];
        sum += residual * residual;
        const float size = fabs(correction[ray]);
        most = size > most ? size : most;
        uint low = 0, high = edge_count - 1;
        while (high - low > 1) {
            const uint middle = (low + high) / 2;
            if (edges[middle] <= residual)
                low = middle;
            else
                high = middle;
        }
        atomic_inc(&bins[slice * (edge_count - 1) + low]);
    }
    sums[item] = sum;
    largest[item] = most;
    for (uint apart = GROUP / 2; apart > 0; apart /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < apart) {
            sums[item] += sums[item + apart];
            largest[item] = largest[item] > largest[item + apart] ? largest[item] : largest[item + apart];
        }
    }
    if (item == 0) {
        if (EMITTER(pass) >= 0)
            squares[(ulong)slice * emitters + EMITTER(pass)] = sums[0];
        exponents[pass] = largest[0] > 0.0f ? ilogb(largest[0]) : 0;
    }
}

// Distribute the length of each step, and that times the correction, to the nodes around it.
//   sums  [pass][node] (Σ correction·w, Σ w), integers; added to.
kernel void project(const uint count, const int nx, const int ny, const uint most, global const float *tracks,
                    global const uint *taken, global const float *correction, global const int *exponents,
                    global long *sums)
{
    const uint r = get_global_id(0), pass = get_global_id(1);
    if (r >= count)
        return;
    const ulong ray = (ulong)pass * count + r;
    const uint steps = taken[ray];
    global const float *track = tracks + (ulong)pass * most * 3 * count + r;
    global long *into = sums + (ulong)pass * 2 * nx * ny;
    const double value = ldexp((double)correction[ray], -exponents[pass]) / QUANTUM;
    for (uint n = 0; n < steps; ++n) {
        global const float *place = track + (ulong)n * 3 * count;
        const float x = place[0], y = place[count], size = place[2 * count];
        const int i = min((int)x, nx - 2), j = min((int)y, ny - 2);
        const float high = (x - i) * size, part = y - j, low = size - high;
        const float right = low * part, lower_right = high * part;
        const float weights[4] = {low - right, right, high - lower_right, lower_right};
        for (int corner = 0; corner < 4; ++corner) {
            const double weight = weights[corner];
            global long *node = into + 2 * ((i + corner / 2) * ny + j + corner % 2);
            atom_add(node, convert_long_rte(value * weight));
            atom_add(node + 1, convert_long_rte(weight / QUANTUM));
        }
    }
}

// The change of every node of a slice before it is smoothed, and its coverage; the sums become 0.
kernel void change(global const uint *numbers, const uint members, const uint step,
                   const int nodes, const double spacing, global const uchar *region, global const int *exponents,
                   global long *sums, global double *coverage, global float *changes)
{
    const int node = get_global_id(0), slice = get_global_id(1);
    if (node >= nodes)
        return;
    double corrected = 0.0, passed = 0.0;
    for (uint member = 0; member < members; ++member) {
        const uint pass = slice * members + member;
        if (EMITTER(pass) < 0)
            continue;
        global long *sum = sums + 2 * ((ulong)pass * nodes + node);
        corrected += ldexp(sum[0] * QUANTUM, exponents[pass]);
        passed += sum[1] * QUANTUM;
        sum[0] = sum[1] = 0;
    }
    const ulong place = (ulong)slice * nodes + node;
    coverage[place] += passed * spacing;
    changes[place] = passed > 0.0 && region[place] ? (float)(corrected / passed) : 0.0f;
}

// Blur along x with a symmetric kernel, given from its middle outwards; constant beyond the boundary.
kernel void blur(global const float *changes, global float *blurred, global const float *weights, const int reach,
                 const int nx, const int ny)
{
    const int node = get_global_id(0);
    if (node >= nx * ny)
        return;
    const int i = node / ny, j = node % ny;
    global const float *image = changes + (ulong)get_global_id(1) * nx * ny;
    float sum = weights[0] * image[node];
    for (int d = 1; d <= reach; ++d)
        sum += weights[d] * (image[max(i - d, 0) * ny + j] + image[min(i + d, nx - 1) * ny + j]);
    blurred[(ulong)get_global_id(1) * nx * ny + node] = sum;
}

// Blur along y, and change the image within its bounds.
kernel void apply(global const uint *numbers, const uint members, const uint step,
                  global const float *blurred, global const float *weights, const int reach, const int nx,
                  const int ny, global const double *scales, const double lowest, const double highest,
                  global const uchar *region, global double *slowness)
{
    const int node = get_global_id(0), slice = get_global_id(1);
    const ulong place = (ulong)slice * nx * ny + node;
    // Without an emitter there is nothing to update.
    if (node >= nx * ny || EMITTER(slice * members) < 0 || !region[place])
        return;
    const int row = node / ny * ny, j = node % ny;
    global const float *image = blurred + (ulong)slice * nx * ny + row;
    float sum = weights[0] * image[j];
    for (int d = 1; d <= reach; ++d)
        sum += weights[d] * (image[max(j - d, 0)] + image[min(j + d, ny - 1)]);
    slowness[place] = clamp(slowness[place] + scales[slice] * sum, lowest, highest);
}
