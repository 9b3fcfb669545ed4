"""deploy/trim.sh: which files of the image's libraries are removed, and that the rest still loads."""

import ctypes
import re
import shutil
import struct
import subprocess
from pathlib import Path

import numba
import pytest
import yaml._yaml

from . import compose

# Shipped unstripped, and no library of others beside it.
LIBRARY = Path(yaml._yaml.__file__)
# Edited by the wheel's makers after it was linked, as PoCL's is.
EDITED = next((Path(numba.__file__).parent / "np" / "ufunc").glob("omppool.*.so"))

# Of ELF: the kind of a program header whose segment is loaded, and what it is aligned to.
LOAD, PAGE = 1, 4096

GONE = (
    "dask/array/tests/test_core.py",
    "numba/test/data.bin",
    "fontTools/varLib/iup.c",
    "numpy/_core/include/numpy/ndarraytypes.h",
    "scipy/linalg/cython_blas.pxd",
    "pocl_binary_distribution/.libs/share/pocl/kernel-x86_64-unknown-linux-gnu-sse41.bc",
)
KEPT = (
    "dask/array/core.py",
    "dask/utils_test.py",
    "pocl_binary_distribution/.libs/share/pocl/include/_kernel.h",
    "pocl_binary_distribution/.libs/share/pocl/kernel-x86_64-unknown-linux-gnu-avx2.bc",
    "pyopencl/cl/pyopencl-random123/array.h",
)
STRIPPED = ("yaml/_yaml.so", "pyopencl/.libs/libOpenCL.so.1.0.0", "_cffi_backend.so")
EDITED_HERE = "numba/np/ufunc/omppool.so"


@pytest.fixture
def trimmed(tmp_path: Path) -> Path:
    if shutil.which("eu-strip") is None:
        pytest.skip("no eu-strip here: apt-get install elfutils")
    for name in (*GONE, *KEPT, *STRIPPED, EDITED_HERE):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    for name in (*GONE, *KEPT):
        (tmp_path / name).write_text("content")
    for name in STRIPPED:
        shutil.copy(LIBRARY, tmp_path / name)
    shutil.copy(EDITED, tmp_path / EDITED_HERE)
    subprocess.run([str(compose.ROOT / "deploy" / "trim.sh"), str(tmp_path)], check=True)
    return tmp_path


def test_trim_removes_only_tests_sources_and_unused_aws_services(trimmed: Path) -> None:
    assert [name for name in GONE if (trimmed / name).exists()] == []
    assert [name for name in KEPT if not (trimmed / name).exists()] == []


def test_libraries_lose_their_symbols_and_still_load(trimmed: Path) -> None:
    for name in STRIPPED:
        assert (trimmed / name).stat().st_size < LIBRARY.stat().st_size
        ctypes.CDLL(str(trimmed / name))


def test_libraries_that_were_edited_after_linking_keep_their_segments_on_pages(trimmed: Path) -> None:
    """Strip breaks them: ``ELF load command address/offset not page-aligned``."""
    content = (trimmed / EDITED_HERE).read_bytes()
    (table,) = struct.unpack_from("<Q", content, 32)
    size, count = struct.unpack_from("<HH", content, 54)
    headers = [struct.unpack_from("<IIQQ", content, table + number * size) for number in range(count)]
    loaded = [(offset, address) for kind, _, offset, address in headers if kind == LOAD]
    assert loaded
    assert all((address - offset) % PAGE == 0 for offset, address in loaded)


def test_only_imported_modules_are_compiled() -> None:
    text = (compose.ROOT / "deploy" / "Dockerfile").read_text()
    # uv compiles nothing unless it is asked to.
    assert len(re.findall(r"^RUN uv pip install", text, re.M)) == 2
    assert "--compile" not in text
    assert "UV_COMPILE" not in text


def test_an_image_without_a_device_is_not_built() -> None:
    text = (compose.ROOT / "deploy" / "Dockerfile").read_text()
    assert """|| grep -q '"usable": true' /tmp/devices""" in text
