// The ray caster of refraction/caster.py, one work-item a ray; the last group has items left over.
//
// REAL: float or double, of places, directions and roots. SUM: the same for the coefficients and their sums.
// TAPS: nodes that a point reads along one axis. POWERS: of the weights' polynomials. WIDTH: numbers of a row
// of the tables (Stencil.weights). HOW: CERTAIN, CERTAIN_BRENT, BRENT or ANALYTIC within cells, or STEPS
// without them. TOLERANCE, SHORTEST (nodes) and MOST_HALVINGS: as in isosurface/crossing.py. DEEPEST: steps of
// a root finder.
// A function does what the one of its name does in isosurface or refraction. Scalars only: not every device
// computes vectors of doubles right. A fraction is written R(0.5): a bare one would turn floats into doubles.

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif

#define CERTAIN 0
#define CERTAIN_BRENT 1
#define BRENT 2
#define ANALYTIC 3
#define STEPS 4

#define MISSED 0
#define REFRACTED 1
#define LOST 2

#define R(number) ((REAL)(number))
#define NONE R(INFINITY)
#define UNKNOWN R(NAN)

typedef struct {
    REAL x, y, z;
} Vector;

// Points start + s * along; over is one over the direction. s is in m, places are in nodes.
typedef struct {
    Vector start, along, over;
} Ray;

// cells_*: the last cell of the filter along each axis.
typedef struct {
    global const SUM *coefficients;
    constant const SUM *tables;
    REAL shift;
    int cells_x, cells_y, cells_z;
    size_t stride_x, stride_y;
} Field;

// levels: place of a level's first node in masks, and its nodes along x, y and z.
typedef struct {
    global const uchar *masks;
    global const float *bend;
    constant const long *levels;
    int top;
} Octree;

// What of a crossing is sought and found: the interval (below, above) and its bits in the masks; the halvings
// that are left, -1 where one more was needed; s, the side by which the field leaves, and its gradient there,
// per node, where it is known.
typedef struct {
    REAL below, above;
    int sought;
    int halvings;
    REAL s;
    int side;
    bool known;
    Vector gradient;
} Way;

// Where a is not a number, b.
REAL lower(REAL a, REAL b) { return a < b ? a : b; }
REAL upper(REAL a, REAL b) { return a > b ? a : b; }
// Written out, since there are compilers that make calls of fabs, min, max, isinf and isnan.
REAL size_of(REAL a) { return a < 0 ? -a : a; }
bool endless(REAL a) { return size_of(a) == NONE; }
int least(int a, int b) { return a < b ? a : b; }
int most(int a, int b) { return a > b ? a : b; }
REAL dot3(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vector scaled(REAL by, Vector a) { return (Vector){by * a.x, by * a.y, by * a.z}; }
Vector moved(Vector a, Vector along, REAL s)
{
    return (Vector){a.x + s * along.x, a.y + s * along.y, a.z + s * along.z};
}
Vector read3(constant const REAL *at) { return (Vector){at[0], at[1], at[2]}; }
Vector axis_of(int axis) { return (Vector){R(axis == 0), R(axis == 1), R(axis == 2)}; }

// First node that is read along one axis, and how far into that cell the place lies.
int cell_of(REAL place, REAL shift, int cells, SUM *t)
{
    const REAL shifted = place + shift;
    const int cell = (int)lower(upper(shifted, 0), R(cells));
    *t = (SUM)(shifted - cell);
    return cell;
}

// The weights of TAPS nodes; those of the slopes where tables begin with theirs.
void weigh(SUM t, constant const SUM *tables, SUM *weights)
{
#pragma unroll
    for (int tap = 0; tap < TAPS; ++tap)
        weights[tap] = tables[2 * (POWERS - 1) * WIDTH + tap];
#pragma unroll
    for (int power = POWERS - 2; power >= 0; --power)
#pragma unroll
        for (int tap = 0; tap < TAPS; ++tap)
            weights[tap] = weights[tap] * t + tables[2 * power * WIDTH + tap];
}

global const SUM *cell_and_rests(const Field *field, const Ray *ray, REAL s, SUM *rests)
{
    const Vector place = moved(ray->start, ray->along, s);
    const int i = cell_of(place.x, field->shift, field->cells_x, rests);
    const int j = cell_of(place.y, field->shift, field->cells_y, rests + 1);
    const int k = cell_of(place.z, field->shift, field->cells_z, rests + 2);
    return field->coefficients + i * field->stride_x + j * field->stride_y + k;
}

// The innermost loops are over the nodes of a row, so that a compiler can put them into vectors.
REAL field_at(const Field *field, const Ray *ray, REAL s)
{
    SUM rests[3], wx[TAPS], wy[TAPS], wz[TAPS], rows[TAPS] = {0};
    global const SUM *start = cell_and_rests(field, ray, s, rests);
    weigh(rests[0], field->tables, wx);
    weigh(rests[1], field->tables, wy);
    weigh(rests[2], field->tables, wz);
#pragma unroll
    for (int p = 0; p < TAPS; ++p)
#pragma unroll
        for (int q = 0; q < TAPS; ++q) {
            global const SUM *line = start + p * field->stride_x + q * field->stride_y;
            const SUM weight = wx[p] * wy[q];
#pragma unroll
            for (int r = 0; r < TAPS; ++r)
                rows[r] += weight * line[r];
        }
    SUM value = 0;
#pragma unroll
    for (int r = 0; r < TAPS; ++r)
        value += rows[r] * wz[r];
    return value;
}

// With the gradient, per node.
REAL field_and_gradient_at(const Field *field, const Ray *ray, REAL s, Vector *gradient)
{
    constant const SUM *slopes = field->tables + WIDTH;
    SUM rests[3], wx[TAPS], wy[TAPS], wz[TAPS], dx[TAPS], dy[TAPS], dz[TAPS];
    SUM rows[TAPS] = {0}, rows_x[TAPS] = {0}, rows_y[TAPS] = {0};
    global const SUM *start = cell_and_rests(field, ray, s, rests);
    weigh(rests[0], field->tables, wx);
    weigh(rests[0], slopes, dx);
    weigh(rests[1], field->tables, wy);
    weigh(rests[1], slopes, dy);
    weigh(rests[2], field->tables, wz);
    weigh(rests[2], slopes, dz);
#pragma unroll
    for (int p = 0; p < TAPS; ++p) {
        SUM plane[TAPS] = {0}, plane_y[TAPS] = {0};
#pragma unroll
        for (int q = 0; q < TAPS; ++q) {
            global const SUM *line = start + p * field->stride_x + q * field->stride_y;
#pragma unroll
            for (int r = 0; r < TAPS; ++r) {
                plane[r] += wy[q] * line[r];
                plane_y[r] += dy[q] * line[r];
            }
        }
#pragma unroll
        for (int r = 0; r < TAPS; ++r) {
            rows[r] += wx[p] * plane[r];
            rows_x[r] += dx[p] * plane[r];
            rows_y[r] += wx[p] * plane_y[r];
        }
    }
    SUM value = 0, x = 0, y = 0, z = 0;
#pragma unroll
    for (int r = 0; r < TAPS; ++r) {
        value += rows[r] * wz[r];
        x += rows_x[r] * wz[r];
        y += rows_y[r] * wz[r];
        z += rows[r] * dz[r];
    }
    *gradient = (Vector){x, y, z};
    return value;
}

#if HOW == CERTAIN
REAL newton(const Field *field, const Ray *ray, REAL target, REAL a, REAL value_a, REAL b, REAL value_b,
            REAL bend, REAL tolerance, Vector *gradient)
{
    REAL s = a + (b - a) * (target - value_a) / (value_b - value_a), last = 0;
    Vector before = {0, 0, 0};
    for (int n = 0; n < DEEPEST; ++n) {
        const REAL value = field_and_gradient_at(field, ray, s, gradient);
        const REAL slope = dot3(*gradient, ray->along);
        if ((value > target) == (value_b > value_a))
            b = s;
        else
            a = s;
        REAL step = (target - value) / slope;
        if (!(a <= s + step && s + step <= b)) {
            // Out of the bracket, or no slope to follow.
            step = R(0.5) * (a + b) - s;
        } else if (size_of(step) <= tolerance) {
            return s + step;
        } else if (n > 0 && R(0.5) * bend * step * step <= tolerance * size_of(slope)) {
            *gradient = moved(*gradient, moved(*gradient, before, -1), step / last);
            return s + step;
        }
        before = *gradient;
        last = step;
        s += step;
    }
    return s;
}
#endif

REAL brent(const Field *field, const Ray *ray, REAL target, REAL a, REAL value_a, REAL b, REAL value_b,
           REAL tolerance)
{
    REAL f_a = value_a - target, f_b = value_b - target;
    if (f_a == 0)
        return a;
    const REAL close = tolerance * size_of(f_b - f_a) / size_of(b - a);
    REAL c = a, f_c = f_a, step = b - a, last = b - a;
    for (int n = 0; n < DEEPEST; ++n) {
        if ((f_b > 0) == (f_c > 0)) {
            c = a;
            f_c = f_a;
            step = last = b - a;
        }
        if (size_of(f_c) < size_of(f_b)) {
            a = b;
            b = c;
            c = a;
            f_a = f_b;
            f_b = f_c;
            f_c = f_a;
        }
        const REAL half_way = R(0.5) * (c - b);
        if (size_of(half_way) <= tolerance || size_of(f_b) <= close)
            break;
        if (size_of(last) >= tolerance && size_of(f_a) > size_of(f_b)) {
            const REAL ratio = f_b / f_a;
            REAL p, q;
            if (a == c) {
                p = 2 * half_way * ratio;
                q = 1 - ratio;
            } else {
                const REAL u = f_a / f_c, v = f_b / f_c;
                p = ratio * (2 * half_way * u * (u - v) - (b - a) * (v - 1));
                q = (u - 1) * (v - 1) * (ratio - 1);
            }
            q = p > 0 ? -q : q;
            p = size_of(p);
            if (2 * p < lower(3 * half_way * q - size_of(tolerance * q), size_of(last * q))) {
                last = step;
                step = p / q;
            } else {
                last = step = half_way;
            }
        } else {
            last = step = half_way;
        }
        a = b;
        f_a = f_b;
        b += size_of(step) > tolerance ? step : copysign(tolerance, half_way);
        f_b = field_at(field, ray, b) - target;
    }
    return b;
}

// The field where the search ended; way->s and way->side as found.
REAL scan(const Field *field, const Ray *ray, REAL speed, REAL start, REAL value, REAL stop, REAL step,
          REAL bend, Way *way)
{
    const REAL below = way->below, above = way->above;
    REAL a = start;
    if (value != value)
        value = field_at(field, ray, a);
    REAL value_a = lower(upper(value, below), above);
    REAL length = step;
    way->s = stop;
    way->side = 0;
    way->known = false;
    while (a < stop) {
        const REAL b = lower(a + length, stop);
        const REAL value_b = field_at(field, ray, b);
        const REAL sag = R(0.125) * bend * (b - a) * (b - a);
        const bool inside = below < value_b && value_b < above;
        const bool shortest = (b - a) * speed <= R(SHORTEST);
        const bool safe = lower(lower(value_a, value_b) - below, above - upper(value_a, value_b)) >= sag;
        if (inside && (safe || shortest)) {
            a = b;
            value_a = value_b;
            length = lower(2 * length, step);
        } else if (!inside && (shortest || size_of(value_b - value_a) >= 4 * sag)) {
            way->side = value_b >= above ? 1 : -1;
            const REAL target = way->side > 0 ? above : below, tolerance = R(TOLERANCE) / speed;
#if HOW == CERTAIN
            // Where the field stays on the bound, Newton's method has no slope to follow.
            if (size_of(value_b - value_a) > 4 * sag) {
                way->s = newton(field, ray, target, a, value_a, b, value_b, bend, tolerance, &way->gradient);
                way->known = true;
                return target;
            }
#endif
            way->s = brent(field, ray, target, a, value_a, b, value_b, tolerance);
            return target;
        } else if (--way->halvings < 0) {
            return value_a;
        } else {
            length = R(0.5) * (b - a);
        }
    }
    return value_a;
}

#if HOW == ANALYTIC
REAL polished(REAL t, REAL c0, REAL c1, REAL c2, REAL c3)
{
    for (int n = 0; n < 2; ++n) {
        const REAL slope = c1 + t * (2 * c2 + t * 3 * c3);
        if (slope != 0)
            t -= (c0 + t * (c1 + t * (c2 + t * c3))) / slope;
    }
    return R(-1e-12) <= t && t <= R(1.0 + 1e-12) ? t : NONE;
}

REAL first_root_of_cubic(REAL c0, REAL c1, REAL c2, REAL c3)
{
    const REAL scale = upper(upper(size_of(c0), size_of(c1)), upper(size_of(c2), size_of(c3)));
    REAL first = NONE;
    if (size_of(c3) > R(1e-9) * scale) {
        const REAL p = c2 / (3 * c3), q = c1 / c3;
        const REAL third = (q - 3 * p * p) / 3;
        const REAL constant_part = (2 * p * p - q) * p + c0 / c3;
        const REAL discriminant = R(0.25) * constant_part * constant_part + third * third * third;
        if (discriminant > 0) {
            const REAL root = sqrt(discriminant);
            const REAL larger = cbrt(R(-0.5) * constant_part - copysign(root, constant_part));
            first = polished(larger - third / larger - p, c0, c1, c2, c3);
        } else {
            const REAL radius = sqrt(-third);
            const REAL cube = radius * radius * radius;
            const REAL cosine = radius > 0 ? R(-0.5) * constant_part / cube : 0;
            const REAL angle = acos(lower(upper(cosine, -1), 1)) / 3;
            for (int k = 0; k < 3; ++k) {
                const REAL t = 2 * radius * cos(angle + k * R(2.0943951023931954923)) - p;
                first = lower(first, polished(t, c0, c1, c2, c3));
            }
        }
    } else if (size_of(c2) > R(1e-12) * scale) {
        const REAL discriminant = c1 * c1 - 4 * c2 * c0;
        if (discriminant >= 0) {
            const REAL both = R(-0.5) * (c1 + copysign(sqrt(discriminant), c1));
            first = polished(both / c2, c0, c1, c2, c3);
            if (both != 0)
                first = lower(first, polished(c0 / both, c0, c1, c2, c3));
        }
    } else if (c1 != 0) {
        first = polished(-c0 / c1, c0, c1, c2, c3);
    }
    return first;
}

void solve(const Field *field, const Ray *ray, REAL start, REAL stop, Way *way)
{
    const REAL third = (stop - start) / 3;
    const REAL f0 = field_at(field, ray, start), f1 = field_at(field, ray, start + third);
    const REAL f2 = field_at(field, ray, start + 2 * third), f3 = field_at(field, ray, stop);
    const REAL c1 = R(0.5) * (-11 * f0 + 18 * f1 - 9 * f2 + 2 * f3);
    const REAL c2 = R(4.5) * (2 * f0 - 5 * f1 + 4 * f2 - f3);
    const REAL c3 = R(4.5) * (-f0 + 3 * f1 - 3 * f2 + f3);
    const REAL rising = endless(way->above) ? NONE : first_root_of_cubic(f0 - way->above, c1, c2, c3);
    const REAL falling = endless(way->below) ? NONE : first_root_of_cubic(f0 - way->below, c1, c2, c3);
    const REAL first = lower(rising, falling);
    const bool found = first <= R(1.0 + 1e-12);
    way->s = found ? start + first * 3 * third : stop;
    way->side = found ? (rising < falling ? 1 : -1) : 0;
    way->known = false;
}
#endif

#if HOW == STEPS
void leave_interval(const Field *field, const Octree *octree, REAL step, const Ray *ray, REAL start,
                    REAL stop, REAL slope, Way *way)
{
    const REAL speed = sqrt(dot3(ray->along, ray->along));
    scan(field, ray, speed, start, UNKNOWN, stop, step / speed, 0, way);
}
#else
REAL turned(REAL s, REAL end, REAL slope, REAL bend, REAL height)
{
    const REAL length = end - s;
    const REAL rise = slope * length + R(0.5) * bend * length * length;
    if (bend * length < 2 * slope && rise < height)
        return end;
    return lower(s + slope / upper(bend, 2 * slope * slope / height), end);
}

REAL way_out(REAL start, REAL over, int node, int level, int cells)
{
    if (endless(over))
        return NONE;
    const int face = over > 0 ? least((node + 1) << level, cells) : node << level;
    return (face - start) * over;
}

int within(REAL place, int node, int level, int cells)
{
    return least(most((int)place, node << level), least((node + 1) << level, cells) - 1);
}

int cell_at(REAL place, int cells) { return least(most((int)place, 0), cells - 1); }

void leave_interval(const Field *field, const Octree *octree, REAL step, const Ray *ray, REAL start,
                    REAL stop, REAL slope, Way *way)
{
    const REAL speed = sqrt(dot3(ray->along, ray->along));
    const int cells_x = octree->levels[1], cells_y = octree->levels[2], cells_z = octree->levels[3];
    const Vector first = moved(ray->start, ray->along, start);
    int i = cell_at(first.x, cells_x), j = cell_at(first.y, cells_y), k = cell_at(first.z, cells_z);
    REAL s = start, value = UNKNOWN;
    // The cell of a surface cannot be skipped, nor can a node about it.
    int level = slope == 0 ? octree->top : 0;
    while (s < stop) {
        const int p = i >> level, q = j >> level, r = k >> level;
        constant const long *shape = octree->levels + 4 * level;
        const size_t node = shape[0] + (p * shape[2] + q) * shape[3] + r;
        const bool skipped = (octree->masks[node] & way->sought) == 0;
        if (!skipped && level > 0) {
            --level;
            continue;
        }
        const REAL out_x = way_out(ray->start.x, ray->over.x, p, level, cells_x);
        const REAL out_y = way_out(ray->start.y, ray->over.y, q, level, cells_y);
        const REAL out_z = way_out(ray->start.z, ray->over.z, r, level, cells_z);
        const REAL out = upper(lower(lower(out_x, out_y), out_z), s);
        if (skipped) {
            value = UNKNOWN;
            slope = 0;
        } else {
            const REAL end = lower(out, stop), bend = octree->bend[node] * speed * speed;
            if (slope != 0 && (end - s) * speed > R(SHORTEST)) {
                s = turned(s, end, size_of(slope), bend, way->above - way->below);
                slope = 0;
            } else if (slope != 0) {
                // The surface lies on a face; where gradients are continuous the next cell has its slope.
                s = end;
                slope = HOW == CERTAIN ? slope : 0;
            }
            if (s >= end) {
                value = UNKNOWN;
            } else {
#if HOW == ANALYTIC
                solve(field, ray, s, end, way);
#else
                value = scan(field, ray, speed, s, value, end, end - s, HOW == BRENT ? 0 : bend, way);
#endif
                if (way->side != 0 || way->halvings < 0)
                    return;
            }
        }
        s = out;
        // The axis of the face moves to the next node; rounding must not carry the others out of theirs.
        const bool by_x = out_x <= out_y && out_x <= out_z, by_y = !by_x && out_y <= out_z;
        const Vector place = moved(ray->start, ray->along, s);
        const int before = by_x ? p : (by_y ? q : r);
        const REAL over = by_x ? ray->over.x : (by_y ? ray->over.y : ray->over.z);
        const int after = over > 0 ? (before + 1) << level : (before << level) - 1;
        if (after < 0 || after >= (by_x ? cells_x : (by_y ? cells_y : cells_z)))
            break;
        i = by_x ? after : within(place.x, p, level, cells_x);
        j = by_y ? after : within(place.y, q, level, cells_y);
        k = by_x || by_y ? within(place.z, r, level, cells_z) : after;
        // Above the highest level at which the node changed, nothing is new.
        for (int changed = (after >> level) ^ before; changed > 1 && level < octree->top; changed >>= 1)
            ++level;
    }
    way->s = stop;
    way->side = 0;
}
#endif

// The direction behind an interface, its share of the energy, and whether the ray passed.
bool refract(Vector *direction, Vector normal, REAL ratio, REAL *weight)
{
    const REAL along = dot3(*direction, normal);
    const REAL cosine = size_of(along);
    const REAL square = 1 - ratio * ratio * (1 - cosine * cosine);
    const bool passed = !(square < 0);
    Vector bent;
    if (passed) {
        const REAL behind = sqrt(square);
        const REAL s = (ratio * cosine - behind) / (ratio * cosine + behind);
        const REAL p = (ratio * behind - cosine) / (ratio * behind + cosine);
        *weight *= 1 - R(0.5) * (s * s + p * p);
        bent = moved(scaled(ratio, *direction), normal, (behind - ratio * cosine) * copysign(R(1), along));
    } else {
        bent = moved(*direction, normal, -2 * along);
    }
    // A unit vector but for rounding; one step of Newton's method keeps it one.
    *direction = scaled(R(1.5) - R(0.5) * dot3(bent, bent), bent);
    return passed;
}

Vector unit_normal(Vector gradient, Vector direction)
{
    const REAL square = dot3(gradient, gradient);
    return square == 0 ? direction : scaled(1 / sqrt(square), gradient);
}

void narrow(REAL start, REAL over, REAL low, REAL high, int axis, REAL *near, REAL *far, int *face_in,
            int *face_out)
{
    if (endless(over)) {
        if (!(low <= start && start <= high))
            *far = -NONE;
        return;
    }
    const REAL a = (low - start) * over, b = (high - start) * over;
    if (lower(a, b) > *near) {
        *near = lower(a, b);
        *face_in = axis;
    }
    if (upper(a, b) < *far) {
        *far = upper(a, b);
        *face_out = axis;
    }
}

void through_box(const Ray *ray, Vector low, Vector high, REAL *near, REAL *far, int *face_in, int *face_out)
{
    *near = -NONE;
    *far = NONE;
    *face_in = *face_out = 0;
    narrow(ray->start.x, ray->over.x, low.x, high.x, 0, near, far, face_in, face_out);
    narrow(ray->start.y, ray->over.y, low.y, high.y, 1, near, far, face_in, face_out);
    narrow(ray->start.z, ray->over.z, low.z, high.z, 2, near, far, face_in, face_out);
}

Ray in_nodes(Vector origin, Vector direction, Vector zero, Vector density)
{
    const Vector start = {(origin.x - zero.x) * density.x, (origin.y - zero.y) * density.y,
                          (origin.z - zero.z) * density.z};
    const Vector along = {direction.x * density.x, direction.y * density.y, direction.z * density.z};
    return (Ray){start, along, {1 / along.x, 1 / along.y, 1 / along.z}};
}

Vector affine(constant const REAL *basis, REAL u, REAL v)
{
    return moved(moved(read3(basis), read3(basis + 3), u), read3(basis + 6), v);
}

void store(global REAL *at, Vector a)
{
    at[0] = a.x;
    at[1] = a.y;
    at[2] = a.z;
}

// coefficients, tables, shift, counts   the filtered volume with its border, as in Spline.
// masks, bend, shapes, top              the octree; the level at which the descent begins.
// levels, indices, layers, around       of the medium, how many layers, and the one around the grid.
// frame                                 origin, density, low and high of the medium.
// open                                  whether the object is cut by the grid's faces.
// camera                                origin and direction, 3 rows each.
// kept                                  how many places of a path are kept in vertices.
kernel void follow(global const SUM *coefficients, constant const SUM *tables, const REAL shift,
                   const int counts_x, const int counts_y, const int counts_z, global const uchar *masks,
                   global const float *bend, constant const long *shapes, const int top,
                   constant const REAL *levels, constant const REAL *indices, const int layers,
                   const int around, constant const REAL *frame, const int open, const REAL step,
                   constant const REAL *camera, const int depth, const int kept, const uint count,
                   global const REAL *places, global REAL *points, global REAL *directions,
                   global uchar *fates, global short *crossings, global REAL *weights, global REAL *vertices)
{
    const size_t n = get_global_id(0);
    if (n >= count)
        return;
    const Field field = {coefficients, tables, shift, counts_x - TAPS, counts_y - TAPS, counts_z - TAPS,
                         (size_t)counts_y * counts_z, counts_z};
    const Octree octree = {masks, bend, shapes, top};
    const Vector zero = read3(frame), density = read3(frame + 3);
    const Vector low = read3(frame + 6), high = read3(frame + 9);
    Vector origin = affine(camera, places[2 * n], places[2 * n + 1]);
    Vector direction = affine(camera + 9, places[2 * n], places[2 * n + 1]);
    direction = scaled(1 / sqrt(dot3(direction, direction)), direction);

    int crossed = 0, layer = around, fate = MISSED, halvings = MOST_HALVINGS;
    bool entered = false, leaving = false;
    REAL weight = 1, slope = 0;
    while (!leaving) {
        const Ray ray = in_nodes(origin, direction, zero, density);
        REAL near, far, start = 0;
        int face_in, face_out;
        Vector normal;
        through_box(&ray, low, high, &near, &far, &face_in, &face_out);
        int behind = around;
        bool face = false;
        if (!entered) {
            start = upper(near, 0);
            if (!(far > start))
                break;
            entered = true;
            // On the faces of a box within the grid lies that of the surroundings, and most rays begin there.
            if (open || start == 0) {
                layer = 0;
                const REAL value = field_at(&field, &ray, start);
                while (layer + 1 < layers && value > levels[layer + 1])
                    ++layer;
            }
            // The object is cut by the grid's face, which is flat. (A camera within it sees no face.)
            if (layer != around && near >= 0) {
                face = true;
                behind = layer;
                layer = around;
                normal = axis_of(face_in);
                origin = moved(origin, direction, start);
            }
        }
        Vector gradient = {0, 0, 0};
        if (!face) {
            // Iso-value m - 1 lies below layer m, iso-value m above it.
            Way way = {levels[layer], levels[layer + 1], (1 << layer) | (1 << layer >> 1), halvings};
            leave_interval(&field, &octree, step, &ray, start, far, slope, &way);
            halvings = way.halvings;
            if (way.side == 0 && halvings >= 0 && layer == around)
                break;
            if (crossed == depth || halvings < 0) {
                fate = LOST;
                break;
            }
            origin = moved(origin, direction, way.s);
            if (way.side == 0) {
                normal = axis_of(face_out);
                leaving = true;
            } else {
                if (!way.known)
                    field_and_gradient_at(&field, &ray, way.s, &way.gradient);
                gradient = (Vector){way.gradient.x * density.x, way.gradient.y * density.y,
                                    way.gradient.z * density.z};
                normal = unit_normal(gradient, direction);
                behind = layer + way.side;
            }
        }
        const bool passed = refract(&direction, normal, indices[layer] / indices[behind], &weight);
        ++crossed;
        fate = REFRACTED;
        if (crossed <= kept)
            store(vertices + 3 * ((size_t)kept * n + crossed - 1), origin);
        if (passed)
            layer = behind;
        // What is mirrored at a face from within stays; what is mirrored at one from without has left.
        leaving = face ? !passed : leaving && passed;
        slope = dot3(gradient, direction);
    }
    store(points + 3 * n, origin);
    store(directions + 3 * n, direction);
    fates[n] = fate;
    crossings[n] = crossed;
    weights[n] = weight;
}
