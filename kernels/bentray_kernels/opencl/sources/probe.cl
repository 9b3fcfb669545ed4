// Part of the self-test of a device: sqrt and fmin on doubles of one vector width, REAL.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

kernel void probe(global const REAL *a, global const REAL *b, global REAL *root, global REAL *lower)
{
    const size_t i = get_global_id(0);
    root[i] = sqrt(a[i]);
    lower[i] = fmin(a[i], b[i]);
}
