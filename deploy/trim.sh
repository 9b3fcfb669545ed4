#!/bin/sh
# Remove unused files from the libraries of the image: trim.sh SITE_PACKAGES
set -eu
cd "${1:?usage: trim.sh SITE_PACKAGES}"
find . -type d \( -name tests -o -name test \) -prune -exec rm -rf {} +
# Sources and headers for compilers, except those that PoCL needs to compile kernels.
find . \( -path ./pyopencl -o -path ./pocl_binary_distribution \) -prune -o -type f \( -name '*.c' -o -name '*.cpp' \
  -o -name '*.h' -o -name '*.hpp' -o -name '*.pyx' -o -name '*.pxd' -o -name '*.a' \) -exec rm -f {} +
# Debug symbols. strip would break libraries that were edited after linking (PoCL, NumPy); eu-strip does not.
find . -type f \( -name '*.so' -o -name '*.so.*' \) -exec eu-strip {} +
# PoCL's functions for processors of 2006 to 2015 (Core 2, Penryn, Bulldozer). There `bentray devices` says that the
# device fails, and compiled code computes instead.
rm -f pocl_binary_distribution/.libs/share/pocl/kernel-*-ssse3.bc pocl_binary_distribution/.libs/share/pocl/kernel-*-sse41.bc \
  pocl_binary_distribution/.libs/share/pocl/kernel-*-avx_fma4.bc
