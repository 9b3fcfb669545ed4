// Interpolation of a volume at a point of a ray, as in splines/sampling.py.
//
// TAPS: nodes that a point reads along one axis. POWERS: of the weights' polynomials. WIDTH: numbers of a row
// of the tables (Stencil.weights).

// cells_*: the last cell of the filter along each axis.
typedef struct {
    global const SUM *coefficients;
    constant const SUM *tables;
    REAL shift;
    int cells_x, cells_y, cells_z;
    size_t stride_x, stride_y;
} Field;

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
