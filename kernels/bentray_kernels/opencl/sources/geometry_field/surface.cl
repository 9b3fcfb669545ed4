// The surfaces of a scene, the exact intersector and the lines of the cube, after refraction/rays.cl.
//
// A function does what the one of its name does in geometry_field/intersector.py, cube.py, faces.py or
// lookup.py. LATER, ALMOST_ZERO, MAX_STEPS, WAITING: as there. NEVER: the reciprocal that stands for one over 0.

typedef struct {
    global const float *triangles;
    global const int *links;
    global const float *nodes;
    global const int *children;
} Surface;

// The face, -1 for none; the distance along the ray; the weights of corners 0 and 1.
typedef struct {
    int face;
    REAL distance, first, second;
} Found;

typedef struct {
    REAL near, far;
    int s;
    REAL sx, sy;
    int t;
    REAL tx, ty;
} Line;

typedef struct {
    int across, up, along;
    REAL step_across, step_up, over;
} Shear;

typedef struct {
    REAL distance, first, second, third, determinant;
} Meeting;

// A macro, since INFINITY is no compile-time constant for the compiler of NVIDIA.
#define NOT_FOUND ((Found){-1, NONE, 0, 0})

REAL part(Vector a, int axis) { return axis == 0 ? a.x : axis == 1 ? a.y : a.z; }
REAL over_(REAL a) { return size_of(a) > 1 / NEVER ? 1 / a : NEVER; }

void slab(REAL low, REAL high, REAL start, REAL over, REAL *near, REAL *far)
{
    const REAL a = (low - start) * over, b = (high - start) * over;
    *near = upper(*near, lower(a, b));
    *far = lower(*far, upper(a, b) * LATER);
}

REAL box_entry(global const float *box, Vector origin, Vector over, REAL begin, REAL end)
{
    REAL near = begin, far = end;
    slab(box[0], box[3], origin.x, over.x, &near, &far);
    slab(box[1], box[4], origin.y, over.y, &near, &far);
    slab(box[2], box[5], origin.z, over.z, &near, &far);
    return near <= far ? near : NONE;
}

Shear shear_of(Vector direction)
{
    const REAL x = size_of(direction.x), y = size_of(direction.y), z = size_of(direction.z);
    const int along = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    const bool back = part(direction, along) < 0;
    const int across = (along + (back ? 2 : 1)) % 3, up = (along + (back ? 1 : 2)) % 3;
    const REAL over = 1 / part(direction, along);
    return (Shear){across, up, along, part(direction, across) * over, part(direction, up) * over, over};
}

Vector sheared(global const float *corner, Vector origin, Shear shear)
{
    const REAL depth = corner[shear.along] - part(origin, shear.along);
    return (Vector){corner[shear.across] - part(origin, shear.across) - shear.step_across * depth,
                    corner[shear.up] - part(origin, shear.up) - shear.step_up * depth, depth};
}

// The distance, NONE where the ray passes the face; its weights in found.
REAL meet(global const float *triangle, Vector origin, Shear shear, Found *found)
{
#pragma OPENCL FP_CONTRACT OFF
    const Vector a = sheared(triangle, origin, shear), b = sheared(triangle + 3, origin, shear),
                 c = sheared(triangle + 6, origin, shear);
    const REAL u = c.x * b.y - c.y * b.x, v = a.x * c.y - a.y * c.x, w = b.x * a.y - b.y * a.x;
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0))
        return NONE;
    const REAL total = u + v + w;
    if (total == 0)
        return NONE;
    found->first = u / total;
    found->second = v / total;
    return shear.over * (u * a.z + v * b.z + w * c.z) / total;
}

Found closest(const Surface *surface, int root, Vector origin, Vector direction, REAL begin, REAL end,
              int ignored)
{
    const Vector over = {over_(direction.x), over_(direction.y), over_(direction.z)};
    const Shear shear = shear_of(direction);
    Found found = NOT_FOUND;
    int waiting[WAITING];
    int node = root, depth = 0;
    while (true) {
        global const float *boxes = surface->nodes + 16 * (size_t)node;
        REAL near = box_entry(boxes, origin, over, begin, end);
        REAL far = box_entry(boxes + 6, origin, over, begin, end);
        int one = surface->children[16 * (size_t)node + 12], other = surface->children[16 * (size_t)node + 13];
        if (far < near) {
            const REAL distance = near;
            const int child = one;
            near = far;
            far = distance;
            one = other;
            other = child;
        }
        node = -1;
        for (int turn = 0; turn < 2; ++turn) {
            const REAL at = turn == 0 ? near : far;
            const int child = turn == 0 ? one : other;
            if (!(at < NONE) || at > end)
                continue;
            if (child >= 0) {
                if (node < 0)
                    node = child;
                else
                    waiting[depth++] = child;
                continue;
            }
            const int start = ~child >> 3, count = ~child & 7;
            for (int face = start; face < start + count; ++face) {
                if (face == ignored)
                    continue;
                Found here = {face, 0, 0, 0};
                here.distance = meet(surface->triangles + 16 * (size_t)face, origin, shear, &here);
                if (begin < here.distance && here.distance < end) {
                    found = here;
                    end = here.distance;
                }
            }
        }
        if (node < 0) {
            if (depth == 0)
                return found;
            node = waiting[--depth];
        }
    }
}

REAL not_zero(REAL a) { return size_of(a) > ALMOST_ZERO ? a : ALMOST_ZERO; }

Line line_of(Vector origin, Vector direction)
{
    const REAL low = -MARGIN, high = R(1) + MARGIN;
    const Vector d = {not_zero(direction.x), not_zero(direction.y), not_zero(direction.z)};
    const REAL ix = 1 / d.x, iy = 1 / d.y, iz = 1 / d.z;
    const REAL ax = (low - origin.x) * ix, bx = (high - origin.x) * ix;
    const REAL ay = (low - origin.y) * iy, by = (high - origin.y) * iy;
    const REAL az = (low - origin.z) * iz, bz = (high - origin.z) * iz;
    const REAL near_x = lower(ax, bx), near_y = lower(ay, by), near_z = lower(az, bz);
    const REAL far_x = upper(ax, bx), far_y = upper(ay, by), far_z = upper(az, bz);
    const REAL near = upper(upper(near_x, near_y), near_z), far = lower(lower(far_x, far_y), far_z);
    const int in = near_x == near ? 0 : near_y == near ? 1 : 2;
    const int out = far_x == far ? 0 : far_y == far ? 1 : 2;
    const Vector s = moved(origin, d, near), t = moved(origin, d, far);
    return (Line){near,
                  far,
                  2 * in + (part(d, in) > 0 ? 0 : 1),
                  in == 0 ? s.y : s.x,
                  in == 2 ? s.y : s.z,
                  2 * out + (part(d, out) > 0 ? 1 : 0),
                  out == 0 ? t.y : t.x,
                  out == 2 ? t.y : t.z};
}

int number_at(int face, REAL x, REAL y, int n)
{
    const int i = (int)lower(upper(x * n, R(0)), R(n - 1)), j = (int)lower(upper(y * n, R(0)), R(n - 1));
    return 6 * n * j + i + face * n;
}

Meeting meet_plane(global const float *t, Vector s, Vector d)
{
    const Vector p = {R(t[3]) - t[0], R(t[4]) - t[1], R(t[5]) - t[2]};
    const Vector q = {R(t[6]) - t[0], R(t[7]) - t[1], R(t[8]) - t[2]};
    const Vector r = {s.x - t[0], s.y - t[1], s.z - t[2]};
    const Vector n = {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
    const Vector m = {r.y * d.z - r.z * d.y, r.z * d.x - r.x * d.z, r.x * d.y - r.y * d.x};
    const REAL determinant = -dot3(d, n), over = 1 / determinant;
    const REAL first = dot3(q, m) * over, second = -dot3(p, m) * over;
    return (Meeting){dot3(r, n) * over, 1 - first - second, first, second, determinant};
}

// Names weights by the corners 0, 1, 2 as meet_plane gives them: first, second, third.
int beyond(global const int *links, int face, Meeting at)
{
    const REAL smallest = lower(at.first, lower(at.second, at.third));
    if (smallest >= -SLACK)
        return face;
    return links[smallest == at.third ? 9 : smallest == at.first ? 10 : 11];
}

Found settle(const Surface *surface, int face, REAL side, Vector s, Vector d)
{
    Meeting at = meet_plane(surface->triangles + 16 * (size_t)face, s, d);
    int across = beyond(surface->links + 16 * (size_t)face, face, at);
    for (int step = 0; step < MAX_STEPS; ++step) {
        if (across == face || across < 0 || !(side * at.determinant > 0))
            break;
        face = across;
        at = meet_plane(surface->triangles + 16 * (size_t)face, s, d);
        across = beyond(surface->links + 16 * (size_t)face, face, at);
    }
    const bool ends = across == face && side * at.determinant > 0;
    return (Found){ends ? face : -1, at.distance, at.first, at.second};
}
