// The ray caster of refraction/caster.py, one work-item per ray; the last group has idle items.
//
// MAX_HALVINGS: as in isosurface/crossing.py.

#define MISSED 0
#define REFRACTED 1
#define LOST 2

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
kernel void follow(global const SUM *coefficients, constant const SUM *tables, const REAL shift,
                   const int counts_x, const int counts_y, const int counts_z, global const uchar *masks,
                   global const float *bend, constant const long *shapes, const int top,
                   constant const REAL *levels, constant const REAL *indices, const int layers,
                   const int around, constant const REAL *frame, const int open, const REAL step,
                   constant const REAL *camera, const int depth, const uint count,
                   global const REAL *places, global REAL *points, global REAL *directions,
                   global uchar *fates, global short *crossings, global REAL *weights)
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
    Vector direction = unit(affine(camera + 9, places[2 * n], places[2 * n + 1]));

    int crossed = 0, layer = around, fate = MISSED, halvings = MAX_HALVINGS;
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
