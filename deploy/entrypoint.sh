#!/bin/sh
# Entry point of every container: copy the compiled kernels of the image to numba's cache, then run the command.
set -eu
compiled=${BENTRAY_COMPILED:-/app/compiled}
if [ -d "$compiled" ] && [ -z "$(ls -A "$NUMBA_CACHE_DIR")" ]; then
  cp -Rp "$compiled/." "$NUMBA_CACHE_DIR"
fi
exec "$@"
