"""`python -m bentray_service.cli` is the `bentray` command."""

from . import main

# Dask workers import this module under another name.
if __name__ == "__main__":
    main()
