"""The OpenCL platforms of this process: those of the system and of Python packages."""

import os
import tempfile
import threading
from functools import cache
from pathlib import Path
from typing import Any

from ..compilation.cache_folder import use_writable_folder
from .library import files_of

# Folder of the system's drivers, unless one of these variables names another one.
SYSTEM = "/etc/OpenCL/vendors"
SYSTEM_VARIABLES = ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH")

# Set by pyopencl when it is imported: the loader in its wheel reads $PYOPENCL_HOME/.libs/*.icd too.
HOME = "PYOPENCL_HOME"

_ASKING = threading.Lock()


def platforms() -> list[Any]:
    """Every ``pyopencl.Platform``.

    Raises:
        ImportError: where pyopencl or its loader cannot be loaded.
        pyopencl.Error: where there is none.
    """
    import pyopencl as cl

    with _ASKING:
        # PoCL is no platform without a folder for its programs.
        use_writable_folder("POCL_CACHE_DIR", "pocl")
        _register_intel()
        return list(cl.get_platforms())


@cache
def _register_intel() -> None:
    """Register Intel's runtime with the loader, if its package is installed.

    The loader reads its lists once, at the first call in a process. The list in pyopencl's wheel contains
    pip's PoCL. Intel's package names a folder that does not exist, so a temporary list is used for that call.
    The system's list is read as well; a runtime of Intel on it is not added again.
    """
    import pyopencl as cl

    home = os.environ.get(HOME)
    library = next(files_of("intel-opencl-rt", "libintelocl.so"), None)
    if home is None or library is None or not library.exists() or _listed_by_the_system(library.name):
        return
    try:
        with tempfile.TemporaryDirectory(prefix="bentray-opencl-") as folder:
            listed = Path(folder, ".libs")
            listed.mkdir()
            for file in Path(home, ".libs").glob("*.icd"):
                (listed / file.name).write_bytes(file.read_bytes())
            (listed / "intel.icd").write_text(f"{library}\n")
            os.environ[HOME] = folder
            try:
                cl.get_platforms()
            finally:
                os.environ[HOME] = home
    except (OSError, cl.Error):  # no place for a list, or no device at all: the loader's answer is used
        return


def _listed_by_the_system(name: str) -> bool:
    folder = next((value for word in SYSTEM_VARIABLES if (value := os.environ.get(word))), SYSTEM)
    for file in Path(folder).glob("*.icd"):
        try:
            if Path(file.read_text().strip()).name.startswith(name):
                return True
        except (OSError, UnicodeDecodeError):
            continue
    return False
