// The fast iterative method over blocks of points (Jeong & Whitaker 2008; dissertation, chapter 7.2.2).
//
// Built with DIMS (2 or 3) and EDGE, the points along a side of a block. One work-group advances one
// active block of one problem in local memory until it is settled, and lists the neighbours that it makes
// earlier. Blocks are coloured like a chessboard and a launch advances one colour: no block is written
// while another reads it, so that the result does not depend on the order of the work-groups.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF

// Items of a work-group and points of a tile, a block with its border; distances of neighbours along each axis
// in both. EACH(DO): DO(axis, place in the block, place of the block, blocks, entries between two) for all axes.
#define RIM (EDGE + 2)
#if DIMS == 2
#define ITEMS (EDGE * EDGE)
#define TILE (RIM * RIM)
#define EACH(DO) DO(0, x, bx, blocks_x, blocks_y) DO(1, y, by, blocks_y, 1)
constant const int row[DIMS] = {RIM, 1}, jump[DIMS] = {EDGE, 1};
#else
#define ITEMS (EDGE * EDGE * EDGE)
#define TILE (RIM * RIM * RIM)
#define EACH(DO) DO(0, x, bx, blocks_x, blocks_y * blocks_z) DO(1, y, by, blocks_y, blocks_z) DO(2, z, bz, blocks_z, 1)
constant const int row[DIMS] = {RIM * RIM, RIM, 1}, jump[DIMS] = {EDGE * EDGE, EDGE, 1};
#endif
#define LAST (EDGE - 1)
#define LOWER(a, b) ((a) < (b) ? (a) : (b))
#define UPPER(a, b) ((a) < (b) ? (b) : (a))

// First-order time from the earlier neighbour of each axis. Without branches, so that a compiler can advance
// many points at once; where no neighbour is known yet the result is not a number, which is never earlier.
#if DIMS == 2
double first_order(double a, double b, double crossing)
{
    const double gap = fabs(a - b);
    const double both = 0.5 * (a + b + sqrt(2.0 * crossing * crossing - gap * gap));
    return gap >= crossing ? LOWER(a, b) + crossing : both;
}
#else
double first_order(double a, double b, double c, double crossing)
{
    const double low = LOWER(a, LOWER(b, c));
    const double high = UPPER(a, UPPER(b, c));
    const double middle = UPPER(LOWER(a, b), LOWER(UPPER(a, b), c));
    const double gap = low - middle;
    const double one = low + crossing;
    const double two = 0.5 * (low + middle + sqrt(2.0 * crossing * crossing - gap * gap));
    const double total = low + middle + high;
    const double squares = low * low + middle * middle + high * high;
    const double three = (total + sqrt(total * total - 3.0 * (squares - crossing * crossing))) / 3.0;
    return one > middle ? (two > high ? three : two) : one;
}
#endif

// times       s, [problem][block][point]; the points of a block lie together, the last axis fastest.
// crossings   spacing times slowness, s, [problem or one for all][block][point]; infinite off the grid.
// queued      1 for each block that stands on a list.
// active      the blocks to advance, as problem * blocks + block; one work-group each, axis 0 of the range.
// following   the list of the other colour, which this launch lengthens.
// counts      lengths of the lists of this launch, the next and the one after, in turn.
// shared      1 where all problems have the same crossings.
// tolerance   a fall of at most this part of a point's crossing counts as settled.
#if DIMS == 2
__attribute__((reqd_work_group_size(EDGE, EDGE, 1)))
#else
__attribute__((reqd_work_group_size(EDGE, EDGE, EDGE)))
#endif
kernel void advance(global double *times, global const double *crossings, global int *queued,
                    global const uint *active, global uint *following, global uint *counts,
                    const uint step, const uint blocks_x, const uint blocks_y, const uint blocks_z,
                    const uint shared, const double tolerance)
{
    local double tile[TILE];
    local int falling[2];
    local int woken[2 * DIMS];

    const uint entry = active[get_group_id(0)];
    const uint blocks = blocks_x * blocks_y * blocks_z;
    const uint block = entry % blocks;
#if DIMS == 2
    const uint y = get_local_id(0), x = get_local_id(1);
    const uint item = x * jump[0] + y, here = (x + 1) * row[0] + y + 1, colour = (x + y) & 1;
    const uint by = block % blocks_y, bx = block / blocks_y;
#else
    const uint z = get_local_id(0), y = get_local_id(1), x = get_local_id(2);
    const uint item = x * jump[0] + y * jump[1] + z, colour = (x + y + z) & 1;
    const uint here = (x + 1) * row[0] + (y + 1) * row[1] + z + 1;
    const uint bz = block % blocks_z, by = block / blocks_z % blocks_y, bx = block / blocks_z / blocks_y;
#endif
    global double *own = times + (ulong)entry * ITEMS;
    const double crossing = crossings[(ulong)(shared ? block : entry) * ITEMS + item];
    const double enough = tolerance * crossing;
    const double before = own[item];
    double now = before;

    tile[here] = now;
#define BORDER(inside, apart, jump) ((inside) ? times[(ulong)(apart) * ITEMS + item + (jump)] : INFINITY)
#define LOAD(axis, at, home, number, apart)                                                                    \
    if (at == 0)                                                                                               \
        tile[here - row[axis]] = BORDER(home > 0, entry - (apart), LAST * jump[axis]);                         \
    if (at == LAST)                                                                                            \
        tile[here + row[axis]] = BORDER(home + 1 < number, entry + (apart), -LAST * jump[axis]);
    EACH(LOAD)
    const bool first = item == 0;
    if (first) {
        queued[entry] = 0;
        falling[0] = 0;
        for (int side = 0; side < 2 * DIMS; ++side)
            woken[side] = 0;
        if (get_group_id(0) == 0)
            counts[(step + 2) % 3] = 0;
    }
    barrier(CLK_LOCAL_MEM_FENCE);

    // Points of one colour read only those of the other, so they may be renewed in place, all at once.
    int going = 1;
    for (uint turn = 0; going; ++turn) {
        for (uint phase = 0; phase < 2; ++phase) {
            if (colour == phase) {
                const double a = LOWER(tile[here - row[0]], tile[here + row[0]]);
                const double b = LOWER(tile[here - row[1]], tile[here + row[1]]);
#if DIMS == 2
                const double trial = first_order(a, b, crossing);
#else
                const double c = LOWER(tile[here - row[2]], tile[here + row[2]]);
                const double trial = first_order(a, b, c, crossing);
#endif
                if (now - trial > enough)
                    falling[turn & 1] = 1;
                now = LOWER(trial, now);
                tile[here] = now;
            }
            // The flag of the next turn: all have read its last value before the first barrier of this turn.
            if (phase == 1 && first)
                falling[(turn + 1) & 1] = 0;
            barrier(CLK_LOCAL_MEM_FENCE);
        }
        going = falling[turn & 1];
    }
    own[item] = now;

    // A neighbour's block is woken where a point at the common face can make it earlier.
#define WAKE(axis, at, home, number, apart)                                                                    \
    if (at == 0 && home > 0 && now < tile[here - row[axis]])                                                   \
        woken[2 * axis] = 1;                                                                                   \
    if (at == LAST && home + 1 < number && now < tile[here + row[axis]])                                       \
        woken[2 * axis + 1] = 1;
    if (before - now > enough) {
        EACH(WAKE)
    }
    barrier(CLK_LOCAL_MEM_FENCE);
#define BESIDE(axis, at, home, number, apart) entry - (apart), entry + (apart),
    if (first) {
        const uint neighbours[2 * DIMS] = {EACH(BESIDE)};
        for (int side = 0; side < 2 * DIMS; ++side)
            if (woken[side] && atomic_xchg(&queued[neighbours[side]], 1) == 0)
                following[atomic_inc(&counts[(step + 1) % 3])] = neighbours[side];
    }
}
