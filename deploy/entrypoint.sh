#!/bin/sh
# Start of every container: lay the kernels that were compiled with the image where numba looks, then the command.
set -eu
compiled=${BENTRAY_COMPILED:-/app/compiled}
if [ -d "$compiled" ] && [ -z "$(ls -A "$NUMBA_CACHE_DIR")" ]; then
  cp -Rp "$compiled/." "$NUMBA_CACHE_DIR"
fi
exec "$@"
