// The first point of a ray at which the field leaves an interval, as in isosurface/crossing.py.
//
// TOLERANCE, SHORTEST (nodes) and UNPROVED: as there.

// levels: place of a level's first node in masks, and its nodes along x, y and z.
typedef struct {
    global const uchar *masks;
    global const float *bend;
    constant const long *levels;
    int top;
} Octree;

// What of a crossing is sought and found: the interval (below, above) and its bits in the masks; the halvings
// that are left, below 0 where more were needed; s, the side by which the field leaves, and its gradient there,
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
        if (inside && safe) {
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
        } else {
            way->halvings -= shortest ? UNPROVED : 1;
            if (way->halvings < 0)
                return value_a;
            if (shortest) {
                a = b;
                value_a = value_b;
                length = lower(2 * length, step);
            } else {
                length = R(0.5) * (b - a);
            }
        }
    }
    return value_a;
}

#if HOW == ANALYTIC
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
    // Of the bound on which the ray starts: how far off the field is at s, and how fast it goes off.
    bool leaving = slope != 0;
    REAL near = 0, far = 0, slowest = size_of(slope), fastest = slowest;
    // The cell of a surface cannot be skipped, nor can a node about it.
    int level = leaving ? 0 : octree->top;
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
            leaving = false;
        } else {
            const REAL end = lower(out, stop), bend = octree->bend[node] * speed * speed;
            if (leaving) {
                const REAL length = end - s, sag = R(0.5) * bend * length * length;
                const REAL least_off = near + slowest * length - sag, most_off = far + fastest * length + sag;
                const REAL height = way->above - way->below;
                // A surface may lie on a face: then all is as it was where the next cell begins.
                const bool on_face = near == 0 && length * speed <= R(SHORTEST);
                if (on_face || (least_off > 0 && most_off < height)) {
                    if (!on_face) {
                        near = least_off;
                        far = most_off;
                        slowest -= bend * length;
                        fastest += bend * length;
                    }
                    s = end;
                    // Where gradients are continuous the next cell begins with this slope.
                    leaving = HOW == CERTAIN;
                } else {
                    if (near == 0)
                        s = turned(s, end, slowest, bend, height);
                    leaving = false;
                }
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
