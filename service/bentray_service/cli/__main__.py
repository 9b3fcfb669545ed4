"""`python -m bentray_service.cli` is the `bentray` command."""

from . import main

# Dask's workers import this module anew under another name, and must not start the command again.
if __name__ == "__main__":
    main()
