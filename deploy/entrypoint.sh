#!/bin/sh
# Entry point of every container: copy the compiled kernels of the image to numba's cache, then run the command.
# Where the cache cannot be written (another user, a read-only root), it is in a temporary folder.
set -eu
compiled=${BENTRAY_COMPILED:-/app/compiled}
writable() {
  mkdir -p "$1" 2>/dev/null && [ -w "$1" ]
}
if ! writable "$NUMBA_CACHE_DIR"; then
  for folder in "${TMPDIR:-/tmp}" /dev/shm "$PWD"; do
    if writable "$folder" && cache=$(mktemp -d "$folder/bentray-XXXXXX"); then
      echo "bentray: $NUMBA_CACHE_DIR cannot be written; compiled kernels are in $cache" >&2
      export NUMBA_CACHE_DIR="$cache" XDG_CACHE_HOME="$cache" POCL_CACHE_DIR="$cache/pocl" MPLCONFIGDIR="$cache/matplotlib"
      [ "$folder" = "${TMPDIR:-/tmp}" ] || export TMPDIR="$cache"
      break
    fi
  done
fi
if [ -d "$compiled" ] && writable "$NUMBA_CACHE_DIR" && [ -z "$(ls -A "$NUMBA_CACHE_DIR")" ]; then
  cp -R --preserve=timestamps "$compiled"/* "$NUMBA_CACHE_DIR" ||
    echo "bentray: not all compiled kernels fit into $NUMBA_CACHE_DIR; the others are compiled when they are needed" >&2
fi
exec "$@"
