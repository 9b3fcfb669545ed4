// The ray tracer of tracing/ray_tracer.py, one work-item per pixel; after lookup_scene.cl.

#define NOTHING (-1)
#define GROUND (-2)
#define UNSEEN (-2)
#define SEES_ITSELF 1
#define SINGLE 2

// instances: shape, texture, flags; looks: RGB, mirrored, refracted, index; textures: place, rows, columns.
typedef struct {
    Fields fields;
    int count;
    global const float *normals;
    global const float *uv;
    global const REAL *to_local;
    global const long *instances;
    global const REAL *looks;
    global const float *pictures;
    global const long *textures;
    global const float *sky;
    int sky_rows, sky_columns;
    constant const REAL *ground;
    constant const REAL *light;
} World;

// What a ray leaves: instance, face; the instance that it is within.
typedef struct {
    int own, left, within;
} Leaving;

Vector place_in(global const REAL *m, Vector a, REAL place)
{
    return (Vector){m[0] * a.x + m[1] * a.y + m[2] * a.z + place * m[3],
                    m[4] * a.x + m[5] * a.y + m[6] * a.z + place * m[7],
                    m[8] * a.x + m[9] * a.y + m[10] * a.z + place * m[11]};
}

int nearest(const World *world, Vector origin, Vector direction, int way, Leaving leaving, Found *nearest_found)
{
    int met = NOTHING;
    *nearest_found = NOT_FOUND;
    const bool outside = leaving.within == NOTHING;
    for (int k = 0; k < world->count; ++k) {
        if (!outside && k != leaving.within)
            continue;
        const int flags = (int)world->instances[3 * k + 2];
        if (k == leaving.own && (leaving.left == UNSEEN || (outside && !(flags & SEES_ITSELF))))
            continue;
        const int shape = (int)world->instances[3 * k];
        const Vector o = place_in(world->to_local + 12 * k, origin, R(1));
        const Vector d = place_in(world->to_local + 12 * k, direction, R(0));
        const Found found =
            k == leaving.own
                ? from_the_surface(&world->fields, shape, way, o, d, leaving.left, outside ? R(1) : R(-1))
                : from_outside(&world->fields, shape, way, o, d);
        if (found.face >= 0 && found.distance < nearest_found->distance) {
            met = k;
            *nearest_found = found;
        }
    }
    if (world->ground[1] > 0 && outside && direction.z != 0) {
        const REAL down = (world->ground[0] - origin.z) / direction.z;
        const Vector at = moved(origin, direction, down);
        if (R(1e-9) < down && down < nearest_found->distance &&
            at.x * at.x + at.y * at.y <= world->ground[8] * world->ground[8]) {
            met = GROUND;
            nearest_found->distance = down;
        }
    }
    return met;
}

Vector normal_at(const World *world, int k, Found found)
{
    global const float *n = world->normals + 9 * (size_t)found.face;
    global const REAL *m = world->to_local + 12 * k;
    const REAL third = 1 - found.first - found.second;
    const REAL x = found.first * n[0] + found.second * n[3] + third * n[6];
    const REAL y = found.first * n[1] + found.second * n[4] + third * n[7];
    const REAL z = found.first * n[2] + found.second * n[5] + third * n[8];
    return unit((Vector){m[0] * x + m[4] * y + m[8] * z, m[1] * x + m[5] * y + m[9] * z,
                         m[2] * x + m[6] * y + m[10] * z});
}

Vector shading(const World *world, int k, Found found, Vector normal)
{
    const REAL cosine = upper(dot3(read3(world->light), normal), R(0));
    const REAL shown = world->light[3] + (1 - world->light[3]) * cosine;
    const long texture = world->instances[3 * k + 1];
    if (texture < 0)
        return (Vector){shown * world->looks[6 * k], shown * world->looks[6 * k + 1],
                        shown * world->looks[6 * k + 2]};
    global const float *uv = world->uv + 6 * (size_t)found.face;
    const REAL third = 1 - found.first - found.second;
    const REAL u = found.first * uv[0] + found.second * uv[2] + third * uv[4];
    const REAL v = found.first * uv[1] + found.second * uv[3] + third * uv[5];
    const int rows = (int)world->textures[3 * texture + 1], columns = (int)world->textures[3 * texture + 2];
    const int i = least(most((int)(v * rows), 0), rows - 1), j = least(most((int)(u * columns), 0), columns - 1);
    global const float *at = world->pictures + world->textures[3 * texture] + 3 * (i * columns + j);
    return (Vector){shown * at[0], shown * at[1], shown * at[2]};
}

Vector ground_at(const World *world, Vector point)
{
    const REAL square = world->ground[1];
    const int odd = ((int)floor(point.x / square) + (int)floor(point.y / square)) & 1;
    return read3(world->ground + 2 + 3 * odd);
}

Vector pixel(const World *world, int i, int j)
{
    global const float *at = world->sky + 3 * ((size_t)i * world->sky_columns + j);
    return (Vector){at[0], at[1], at[2]};
}

Vector mixed(Vector a, Vector b, REAL t)
{
    return moved(scaled(1 - t, a), b, t);
}

Vector sky_at(const World *world, Vector direction)
{
    const int rows = world->sky_rows, columns = world->sky_columns;
    const REAL x = atan2(direction.y, direction.x) / R(6.283185307179586) * columns - R(0.5);
    const REAL y = acos(lower(upper(direction.z, R(-1)), R(1))) / R(3.141592653589793) * rows - R(0.5);
    const REAL t = x - floor(x), w = y - floor(y);
    const int left = (int)floor(x), top = (int)floor(y);
    const int j0 = (left + columns) % columns, j1 = (left + 1 + columns) % columns;
    const int i0 = least(most(top, 0), rows - 1), i1 = least(most(top + 1, 0), rows - 1);
    return mixed(mixed(pixel(world, i0, j0), pixel(world, i0, j1), t),
                 mixed(pixel(world, i1, j0), pixel(world, i1, j1), t), w);
}

Vector colour_of(const World *world, Vector origin, Vector direction, int eye, int way, int depth)
{
    Vector colour = {0, 0, 0};
    REAL weight = 1;
    Leaving leaving = {NOTHING, -1, NOTHING};
    for (int turn = 0; turn <= depth; ++turn) {
        Found found;
        const int met = nearest(world, origin, direction, turn == 0 ? eye : way, leaving, &found);
        if (met == NOTHING)
            break;
        const Vector point = moved(origin, direction, found.distance);
        if (met == GROUND)
            return moved(colour, ground_at(world, point), weight);
        const Vector normal = normal_at(world, met, found);
        const REAL mirror = world->looks[6 * met + 3], glass = world->looks[6 * met + 4];
        const bool outside = leaving.within == NOTHING;
        if (outside) {
            colour = moved(colour, shading(world, met, found, normal), weight * (1 - mirror - glass));
            weight *= mirror + glass;
        }
        if (weight == 0)
            return colour;
        origin = point;
        leaving.own = met;
        leaving.left = found.face;
        if (mirror > 0) {
            direction = moved(direction, normal, -2 * dot3(direction, normal));
            continue;
        }
        const REAL index = world->looks[6 * met + 5];
        REAL passes = 1;
        const bool passed = refract(&direction, normal, outside ? 1 / index : index, &passes);
        bool entered = passed == outside;
        if (entered && (world->instances[3 * met + 2] & SINGLE)) {
            entered = false;
            leaving.left = UNSEEN;
        }
        leaving.within = entered ? met : NOTHING;
    }
    return moved(colour, sky_at(world, direction), weight);
}

uchar level(REAL share) { return (uchar)lower(upper(255 * share + R(0.5), R(0)), R(255)); }

kernel void trace(global const float *triangles, global const int *links, global const float *nodes,
                  global const int *children, global const float *normals, global const float *uv,
                  global const long *shapes, global const int *faces, global const float *fractions,
                  global const uchar *known, global const int *inner_faces, global const int *starts,
                  global const REAL *to_local, global const long *instances, const int count,
                  global const REAL *looks, global const float *pictures, global const long *textures,
                  global const float *sky, const int sky_rows, const int sky_columns,
                  constant const REAL *ground, constant const REAL *light, constant const REAL *camera,
                  const int eye, const int way, const int depth, const int rows, const int columns,
                  global uchar *image)
{
    const int k = (int)get_global_id(0);
    if (k >= rows * columns)
        return;
    const World world = {{{triangles, links, nodes, children}, shapes, faces, fractions, known, inner_faces, starts},
                         count,
                         normals,
                         uv,
                         to_local,
                         instances,
                         looks,
                         pictures,
                         textures,
                         sky,
                         sky_rows,
                         sky_columns,
                         ground,
                         light};
    const REAL u = (k % columns + R(0.5)) / columns - R(0.5), v = (k / columns + R(0.5)) / rows - R(0.5);
    const Vector colour = colour_of(&world, affine(camera, u, v), unit(affine(camera + 9, u, v)), eye, way, depth);
    image[3 * k] = level(colour.x);
    image[3 * k + 1] = level(colour.y);
    image[3 * k + 2] = level(colour.z);
}
