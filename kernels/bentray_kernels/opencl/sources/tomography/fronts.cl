// Wave fronts of emitters by second-order sweeps of the deviation of travel times, as eikonal/deviation.py.
//
// Built with GROUP, the work-items of a group, a power of two. A pass is one emitter of one slice. Nodes
// (j, k) are stored by diagonals d = j + k, row d % nj, column k, in two copies: the grid, and the grid with
// j flipped. Nodes of a diagonal do not depend on each other, so that the results do not depend on GROUP.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF

#define UNKNOWN 1e6f
#define TINY 1e-12f
#define KINK 0.25f
#define SETTLED 0.5f
#define REACH 2
#define BEYOND 2
#define PART 8
#define ROUNDS 8
#define SLOTS 6

#define LOWER(a, b) ((a) < (b) ? (a) : (b))

// The emitter of a pass, by its place in the order of the slice; -1 where the slice has no more.
//   numbers  [slice], emitters.
//   members  emitters in one update of a slice.
//   step     number of the update.
#define PLACE(pass) (step * members + (pass) % members)
#define EMITTER(pass) (PLACE(pass) < numbers[(pass) / members] ? (int)PLACE(pass) : -1)

// Slowness at a source, s/m, interpolated.
double slowness_at(global const double *slowness, const double x, const double y, const int nx, const int ny)
{
    const int i = min((int)x, nx - 2), j = min((int)y, ny - 2);
    global const double *node = slowness + i * ny + j;
    const double lower = (i + 1 - x) * ((j + 1 - y) * node[0] + (y - j) * node[1]);
    return lower + (x - i) * ((j + 1 - y) * node[ny] + (y - j) * node[ny + 1]);
}

// Whether a node of the grid, or of the flipped one, has a fixed value because it is near the source.
int is_fixed(const int j, const int k, const int near_j, const int near_k)
{
    return abs(2 * (j - near_j) - 1) < 2 * REACH && abs(2 * (k - near_k) - 1) < 2 * REACH;
}

// Crossing times and first deviations of every node, over nodes and passes.
//   slowness   [slice][node], s/m, C order.
//   sources    [slice][emitter] (x, y), nodes, in the order of the updates.
//   crossings  [pass][copy][node], relative to the slowness at the source.
//   deviation  as crossings.
//   curved     0: rays are straight, and the deviation is 0.
kernel void begin(global const double *slowness, global const double2 *sources, global const uint *numbers,
                  const uint members, const uint step, const uint emitters, global float *crossings,
                  global float *deviation, const int nj, const int nk, const int curved)
{
    const int node = get_global_id(0), nodes = nj * nk, pass = get_global_id(1);
    const int emitter = EMITTER(pass);
    if (node >= nodes || emitter < 0)
        return;
    const int slice = pass / members;
    global const double *image = slowness + (ulong)slice * nodes;
    const double2 source = sources[(ulong)slice * emitters + emitter];
    const double scale = 1.0 / slowness_at(image, source.x, source.y, nj, nk);
    const int j = node / nk, k = node % nk;
    const float own = (float)(image[node] * scale);
    const float x = (float)source.x, y = (float)source.y;
    float value = curved ? UNKNOWN : 0.0f;
    if (curved && is_fixed(j, k, (int)x, (int)y))
        value = 0.5f * (own - 1.0f) * sqrt((j - x) * (j - x) + (k - y) * (k - y));
    const ulong first = (ulong)pass * 2 * nodes;
    const int plain = (j + k) % nj * nk + k, flipped = nodes + (nj - 1 - j + k) % nj * nk + k;
    crossings[first + plain] = crossings[first + flipped] = own;
    deviation[first + plain] = deviation[first + flipped] = value;
}

// The first column from low that belongs to this work-item; columns always have the same one.
int own_column(const int low)
{
    return low + (((int)get_local_id(0) - low) & (GROUP - 1));
}

// Copy a diagonal, as far as the box reads it, into a slot; UNKNOWN beyond the grid.
void load_diagonal(global const float *u, local float *slot, const int d, const int4 box, const int nj,
                   const int nk)
{
    const int low = max(max(0, d - nj - 1), box.z - 2), high = min(min(nk - 1, d + 2), box.w + 2);
    for (int k = own_column(low); k <= high; k += GROUP) {
        const int j = d - k;
        slot[k] = j >= 0 && j < nj ? u[d % nj * nk + k] : UNKNOWN;
    }
}

// Base of the upwind difference along an axis, and whether it is of second order.
float base_of(const float old, const float near, const float far, const float slope, int *smooth)
{
    const float fall = near - far;
    *smooth = fabs(fall - (old - near)) < 2.0f * KINK;
    return *smooth ? near + fall * (1.0f / 3.0f) + slope * (2.0f / 3.0f) : near + slope;
}

// One sweep over a box (low j, high j, low k, high k) in the direction way; whether a node moved much.
// The ring holds the diagonals d - 2 to d + 3 in local memory, and behind them the crossings of d and d + way.
int sweep(global float *u, global const float *crossings, local float *ring, const int4 box, const int way,
          const int second, const float x, const float y, const int nj, const int nk, const int near_j,
          const int near_k)
{
    const int width = nk + 4, low = box.x + box.z, high = box.y + box.w;
    local float *slots = ring + 2, *rhs_slots = ring + SLOTS * width;
    int moved = 0, d = way > 0 ? low : high;
#define SLOT(diagonal) (slots + ((diagonal) + SLOTS) % SLOTS * width)
#define LOAD_CROSSINGS(diagonal)                                                                                \
    for (int k = own_column(max(box.z, (diagonal) - box.y)); k <= min(box.w, (diagonal) - box.x); k += GROUP)  \
        rhs_slots[((diagonal) & 1) * nk + k] = crossings[(diagonal) % nj * nk + k];
    for (int other = d - 2; other <= d + 2; ++other)
        load_diagonal(u, SLOT(other), other, box, nj, nk);
    LOAD_CROSSINGS(d)
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int left = high - low; left >= 0; --left, d += way) {
        // In the slot of d - 3 way, which nobody reads any more.
        load_diagonal(u, SLOT(d + 3 * way), d + 3 * way, box, nj, nk);
        if (left > 0) {
            LOAD_CROSSINGS(d + way)
        }
        local float *here = SLOT(d);
        local const float *before = SLOT(d - 1), *after = SLOT(d + 1);
        local const float *before_2 = SLOT(d - 2), *after_2 = SLOT(d + 2);
        const int last = min(box.w, d - box.x);
        for (int k = own_column(max(box.z, d - box.y)); k <= last; k += GROUP) {
            const int j = d - k;
            if (is_fixed(j, k, near_j, near_k))
                continue;
            const float off_j = j - x, off_k = k - y;
            const float inverse = 1.0f / sqrt(off_j * off_j + off_k * off_k + TINY);
            const float along = off_j * inverse, across = off_k * inverse;
            const float rhs = rhs_slots[(d & 1) * nk + k], old = here[k];
            const float down = before[k], up = after[k], left_of = before[k - 1], right_of = after[k + 1];
            float new;
            if (!second) {
                const float a = LOWER(down - along, up + along), b = LOWER(left_of - across, right_of + across);
                const float apart = fabs(a - b), gap = LOWER(apart, rhs);
                new = LOWER(a, b) + 0.5f * (gap + sqrt(2.0f * rhs * rhs - gap * gap));
                new = LOWER(new, old);
            } else {
                const int falls_a = down - along < up + along, falls_b = left_of - across < right_of + across;
                int smooth_a, smooth_b;
                const float base_a = base_of(old, falls_a ? down : up, falls_a ? before_2[k] : after_2[k],
                                             falls_a ? -along : along, &smooth_a);
                const float base_b = base_of(old, falls_b ? left_of : right_of,
                                             falls_b ? before_2[k - 2] : after_2[k + 2],
                                             falls_b ? -across : across, &smooth_b);
                const float square_a = smooth_a ? 2.25f : 1.0f, square_b = smooth_b ? 2.25f : 1.0f;
                const float both = square_a + square_b;
                const float share = smooth_a == smooth_b ? (smooth_a ? 4.0f / 18.0f : 0.5f) : 4.0f / 13.0f;
                const float gap = base_a - base_b;
                const float root = both * rhs * rhs - square_a * square_b * gap * gap;
                const float joint = (square_a * base_a + square_b * base_b + sqrt(root > 0.0f ? root : 0.0f)) * share;
                const float alone_a = base_a + (smooth_a ? (2.0f / 3.0f) * rhs : rhs);
                const float alone_b = base_b + (smooth_b ? (2.0f / 3.0f) * rhs : rhs);
                const float latest = base_a > base_b ? base_a : base_b;
                new = root > 0.0f && joint >= latest ? joint : LOWER(alone_a, alone_b);
                // Corrections are small; large ones come from the margin of the border.
                new = new < old + 1.0f ? new : old;
                moved |= fabs(new - old) > SETTLED * rhs;
            }
            here[k] = new;
            u[d % nj * nk + k] = new;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    return moved;
}

// Copy the nodes of one copy of the grid into the other.
void turn(global const float *from, global float *into, const int nj, const int nk)
{
    for (int row = 0; row < nj; ++row)
        for (int k = get_local_id(0); k < nk; k += GROUP) {
            int j = row - k;
            while (j < 0)
                j += nj;
            into[(nj - 1 - j + k) % nj * nk + k] = from[row * nk + k];
        }
}

// The deviations of a pass, one work-group each.
//   ring  SLOTS * (nk + 4) + 2 * nk numbers.
__attribute__((reqd_work_group_size(GROUP, 1, 1)))
kernel void front(global const double2 *sources, global const uint *numbers, const uint members,
                  const uint step, const uint emitters, global const float *crossings,
                  global float *deviation, const int nj, const int nk, local float *ring)
{
    local int any;
    const int pass = get_group_id(0), nodes = nj * nk;
    const int emitter = EMITTER(pass);
    if (emitter < 0)
        return;
    const double2 source = sources[(ulong)(pass / members) * emitters + emitter];
    const float x = (float)source.x, y = (float)source.y;
    global const float *both_crossings = crossings + (ulong)pass * 2 * nodes;
    global float *u = deviation + (ulong)pass * 2 * nodes;
    for (int at = get_local_id(0); at < SLOTS * (nk + 4); at += GROUP)
        ring[at] = UNKNOWN;
    barrier(CLK_LOCAL_MEM_FENCE);
    int moved = 1;
    for (int round = 0; round <= ROUNDS && moved; ++round) {
        const int margin = round == 0 ? BEYOND : round > 2 ? max(nj, nk) : max(nj, nk) / PART;
        const int low_k = max(0, (int)y - margin), high_k = min(nk - 1, (int)y + 1 + margin);
        int mine = round == 0;
        for (int side = 0; side < 2; ++side) {
            const int middle = side ? nj - 2 - (int)x : (int)x;
            const int low_j = max(0, middle - margin), high_j = min(nj - 1, middle + 1 + margin);
            const float from_j = side ? nj - 1 - x : x;
            for (int way = 1; way >= -1; way -= 2) {
                const int4 box = way > 0 ? (int4)(low_j, nj - 1, low_k, nk - 1) : (int4)(0, high_j, 0, high_k);
                mine |= sweep(u + side * nodes, both_crossings + side * nodes, ring, box, way, round > 0, from_j,
                              y, nj, nk, middle, (int)y);
                barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
            }
            if (side == 0 || round < ROUNDS)
                turn(u + side * nodes, u + (1 - side) * nodes, nj, nk);
            barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
        }
        if (get_local_id(0) == 0)
            any = 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        if (mine)
            any = 1;
        barrier(CLK_LOCAL_MEM_FENCE);
        moved = any;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}
