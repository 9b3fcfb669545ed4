// The first hit of a ray on one shape, from its fields or exactly; as tracing/lookup_scene.py. After surface.cl.
//
// MIN_DISTANCE: as there.

#define NEAREST 0
#define LINEAR 1
#define PLANE 2
#define WALK 3
#define EXACT 4
#define AGREE 1

// shapes: of each its first node; samples and place of the outer table; the same of the inner one.
typedef struct {
    Surface surface;
    global const long *shapes;
    global const int *faces;
    global const float *fractions;
    global const uchar *known;
    global const int *inner_faces;
    global const int *starts;
} Fields;

Found exactly(const Fields *fields, int shape, Vector origin, Vector direction, int left)
{
    const REAL begin = left >= 0 ? MIN_DISTANCE / sqrt(dot3(direction, direction)) : R(0);
    return closest(&fields->surface, (int)fields->shapes[5 * shape], origin, direction, begin, NONE, left);
}

REAL between(REAL x, int n, int *before)
{
    const REAL place = lower(upper(x * n - R(0.5), R(0)), R(n - 1));
    *before = (int)lower(place, R(n - 2));
    return place - *before;
}

REAL lerp2(global const float *at, int n, REAL a2, REAL a3)
{
    const REAL first = at[0] + a2 * (R(at[1]) - at[0]);
    const REAL second = at[6 * n] + a2 * (R(at[6 * n + 1]) - at[6 * n]);
    return first + a3 * (second - first);
}

void clamp_weights(Found *found)
{
    const REAL first = upper(found->first, R(0)), second = upper(found->second, R(0));
    const REAL total = first + second + upper(1 - first - second, R(0));
    found->first = first / total;
    found->second = second / total;
}

// The fraction of the way at a ray whose sixteen entries agree, or -1.
REAL averaged(const Fields *fields, long start, Line line, int n)
{
    int x0, x1, x2, x3;
    const REAL a0 = between(line.sx, n, &x0), a1 = between(line.sy, n, &x1);
    const REAL a2 = between(line.tx, n, &x2), a3 = between(line.ty, n, &x3);
    const long row = 6 * n * n;
    const long corner = (6 * n * x1 + x0 + line.s * n) * row + 6 * n * x3 + x2 + line.t * n;
    if (fields->known[start + corner] != AGREE)
        return -1;
    global const float *at = fields->fractions + start + corner;
    REAL first = lerp2(at, n, a2, a3);
    first += a0 * (lerp2(at + row, n, a2, a3) - first);
    at += 6 * n * row;
    REAL second = lerp2(at, n, a2, a3);
    second += a0 * (lerp2(at + row, n, a2, a3) - second);
    return first + a1 * (second - first);
}

Found from_outside(const Fields *fields, int shape, int way, Vector origin, Vector direction)
{
    const Line line = line_of(origin, direction);
    if (!(line.near < line.far && line.far > 0))
        return NOT_FOUND;
    const int n = (int)fields->shapes[5 * shape + 1];
    const long start = fields->shapes[5 * shape + 2];
    if (way == EXACT || n == 0)
        return exactly(fields, shape, origin, direction, -1);
    const long place =
        start + number_at(line.s, line.sx, line.sy, n) * (6L * n * n) + number_at(line.t, line.tx, line.ty, n);
    const int entry = fields->faces[place];
    Found found = {way == WALK && entry < -1 ? -2 - entry : entry, 0, 0, 0};
    if (found.face < 0)
        return NOT_FOUND;
    const REAL length = line.far - line.near;
    const Vector at = moved(origin, direction, line.near);
    if (way == WALK) {
        found = settle(&fields->surface, found.face, R(1), at, direction);
        found.distance = lower(upper(found.distance, R(0)), length);
        if (found.face < 0)
            return NOT_FOUND;
    } else {
        const Meeting met = meet_plane(fields->surface.triangles + 16 * (size_t)found.face, at, direction);
        found.distance = fields->fractions[place] * length;
        if (way == PLANE && 0 <= met.distance && met.distance <= length)
            found.distance = met.distance;
        const REAL fraction = way == LINEAR ? averaged(fields, start, line, n) : R(-1);
        if (fraction >= 0)
            found.distance = fraction * length;
        found.first = met.first;
        found.second = met.second;
        clamp_weights(&found);
    }
    found.distance += line.near;
    return found.distance < 0 ? exactly(fields, shape, origin, direction, -1) : found;
}

Found from_the_surface(const Fields *fields, int shape, int way, Vector origin, Vector direction, int left,
                       REAL side)
{
    const int n = (int)fields->shapes[5 * shape + 3];
    if (way == EXACT || n == 0)
        return exactly(fields, shape, origin, direction, left);
    const Line line = line_of(origin, direction);
    const long row = fields->shapes[5 * shape + 4] + fields->starts[left] * (6L * n * n);
    const int face = fields->inner_faces[row + number_at(line.t, line.tx, line.ty, n)];
    if (face >= 0) {
        const Found found = settle(&fields->surface, face, side, origin, direction);
        if (found.face >= 0 && found.face != left &&
            found.distance * sqrt(dot3(direction, direction)) > MIN_DISTANCE)
            return found;
    }
    return side < 0 ? exactly(fields, shape, origin, direction, left) : NOT_FOUND;
}
