#!/bin/sh
# Remove from the image's libraries what nothing runs there: trim.sh SITE_PACKAGES
set -eu
cd "${1:?usage: trim.sh SITE_PACKAGES}"
find . -type d \( -name tests -o -name test \) -prune -exec rm -rf {} +
# Sources and headers for compilers, but for those with which PoCL compiles kernels.
find . \( -path ./pyopencl -o -path ./pocl_binary_distribution \) -prune -o -type f \( -name '*.c' -o -name '*.cpp' \
  -o -name '*.h' -o -name '*.hpp' -o -name '*.pyx' -o -name '*.pxd' -o -name '*.a' \) -exec rm -f {} +
# Symbols for debuggers. It is eu-strip, as strip breaks libraries that were edited after they were linked (PoCL, NumPy).
find . -type f \( -name '*.so' -o -name '*.so.*' \) -exec eu-strip {} +
# Of botocore's descriptions of Amazon's services: a bucket's, and those of signing in to one.
for service in botocore/data/*/; do
  case ${service#botocore/data/} in
    s3/ | sts/ | sso/ | sso-oidc/ | signin/) ;;
    *) rm -rf "$service" ;;
  esac
done
