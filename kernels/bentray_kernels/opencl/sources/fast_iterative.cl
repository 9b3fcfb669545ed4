// The fast iterative method over blocks of points (Jeong & Whitaker 2008; dissertation, chapter 7.2.2).
//
// Built with DIMS (2 or 3) and EDGE, the points along a side of a block. One work-group advances one
// active block of one problem in local memory until it is settled, and lists the neighbours that it makes
// earlier. Blocks are coloured like a chessboard and a launch advances one colour: no block is written
// while another reads it, so that the result does not depend on the order of the work-groups.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF

#if DIMS == 2
#define ITEMS (EDGE * EDGE)
#define TILE ((EDGE + 2) * (EDGE + 2))
#define ROW_X (EDGE + 2)
#define STEP_X EDGE
#define SIDES 4
#else
#define ITEMS (EDGE * EDGE * EDGE)
#define TILE ((EDGE + 2) * (EDGE + 2) * (EDGE + 2))
#define ROW_X ((EDGE + 2) * (EDGE + 2))
#define ROW_Y (EDGE + 2)
#define STEP_X (EDGE * EDGE)
#define STEP_Y EDGE
#define SIDES 6
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
    local int woken[SIDES];

    const uint entry = active[get_group_id(0)];
    const uint blocks = blocks_x * blocks_y * blocks_z;
    const uint block = entry % blocks;
#if DIMS == 2
    const uint y = get_local_id(0), x = get_local_id(1);
    const uint item = x * STEP_X + y;
    const uint here = (x + 1) * ROW_X + y + 1;
    const uint by = block % blocks_y, bx = block / blocks_y;
    const uint apart_x = blocks_y;
    const uint colour = (x + y) & 1;
#else
    const uint z = get_local_id(0), y = get_local_id(1), x = get_local_id(2);
    const uint item = x * STEP_X + y * STEP_Y + z;
    const uint here = (x + 1) * ROW_X + (y + 1) * ROW_Y + z + 1;
    const uint bz = block % blocks_z, by = block / blocks_z % blocks_y, bx = block / blocks_z / blocks_y;
    const uint apart_x = blocks_y * blocks_z, apart_y = blocks_z;
    const uint colour = (x + y + z) & 1;
#endif
    global double *own = times + (ulong)entry * ITEMS;
    const double crossing = crossings[(ulong)(shared ? block : entry) * ITEMS + item];
    const double enough = tolerance * crossing;
    const double before = own[item];
    double now = before;

    tile[here] = now;
#define BORDER(inside, apart, jump) ((inside) ? times[(ulong)(apart) * ITEMS + item + (jump)] : INFINITY)
    if (x == 0)
        tile[here - ROW_X] = BORDER(bx > 0, entry - apart_x, LAST * STEP_X);
    if (x == LAST)
        tile[here + ROW_X] = BORDER(bx + 1 < blocks_x, entry + apart_x, -LAST * STEP_X);
#if DIMS == 2
    if (y == 0)
        tile[here - 1] = BORDER(by > 0, entry - 1, LAST);
    if (y == LAST)
        tile[here + 1] = BORDER(by + 1 < blocks_y, entry + 1, -LAST);
#else
    if (y == 0)
        tile[here - ROW_Y] = BORDER(by > 0, entry - apart_y, LAST * STEP_Y);
    if (y == LAST)
        tile[here + ROW_Y] = BORDER(by + 1 < blocks_y, entry + apart_y, -LAST * STEP_Y);
    if (z == 0)
        tile[here - 1] = BORDER(bz > 0, entry - 1, LAST);
    if (z == LAST)
        tile[here + 1] = BORDER(bz + 1 < blocks_z, entry + 1, -LAST);
#endif
    const bool first = item == 0;
    if (first) {
        queued[entry] = 0;
        falling[0] = 0;
        for (int side = 0; side < SIDES; ++side)
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
                const double a = LOWER(tile[here - ROW_X], tile[here + ROW_X]);
#if DIMS == 2
                const double b = LOWER(tile[here - 1], tile[here + 1]);
                const double trial = first_order(a, b, crossing);
#else
                const double b = LOWER(tile[here - ROW_Y], tile[here + ROW_Y]);
                const double c = LOWER(tile[here - 1], tile[here + 1]);
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
    if (before - now > enough) {
        if (x == 0 && bx > 0 && now < tile[here - ROW_X])
            woken[0] = 1;
        if (x == LAST && bx + 1 < blocks_x && now < tile[here + ROW_X])
            woken[1] = 1;
#if DIMS == 2
        if (y == 0 && by > 0 && now < tile[here - 1])
            woken[2] = 1;
        if (y == LAST && by + 1 < blocks_y && now < tile[here + 1])
            woken[3] = 1;
#else
        if (y == 0 && by > 0 && now < tile[here - ROW_Y])
            woken[2] = 1;
        if (y == LAST && by + 1 < blocks_y && now < tile[here + ROW_Y])
            woken[3] = 1;
        if (z == 0 && bz > 0 && now < tile[here - 1])
            woken[4] = 1;
        if (z == LAST && bz + 1 < blocks_z && now < tile[here + 1])
            woken[5] = 1;
#endif
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (first) {
#if DIMS == 2
        const uint neighbours[SIDES] = {entry - apart_x, entry + apart_x, entry - 1, entry + 1};
#else
        const uint neighbours[SIDES] = {entry - apart_x, entry + apart_x, entry - apart_y,
                                        entry + apart_y, entry - 1, entry + 1};
#endif
        for (int side = 0; side < SIDES; ++side)
            if (woken[side] && atomic_xchg(&queued[neighbours[side]], 1) == 0)
                following[atomic_inc(&counts[(step + 1) % 3])] = neighbours[side];
    }
}
