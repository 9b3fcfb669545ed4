// Numbers, vectors and rays for the other files of the ray caster.
//
// The caster is rays, field, roots, crossing, optics and caster, built in that order. A function does what the
// one of its name does in isosurface or refraction.
// REAL: float or double, of places, directions and roots. SUM: the same for the coefficients and their sums.
// HOW: CERTAIN, CERTAIN_BRENT, BRENT or ANALYTIC within cells, or STEPS without them.
// Scalars only: not every device computes vectors of doubles right. A fraction is written R(0.5): a bare one
// would turn floats into doubles.

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif

#define CERTAIN 0
#define CERTAIN_BRENT 1
#define BRENT 2
#define ANALYTIC 3
#define STEPS 4

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
Vector unit(Vector a) { return scaled(1 / sqrt(dot3(a, a)), a); }
// Origin or direction of a ray, as of refraction/camera.py.
Vector affine(constant const REAL *basis, REAL u, REAL v)
{
    return moved(moved(read3(basis), read3(basis + 3), u), read3(basis + 6), v);
}
