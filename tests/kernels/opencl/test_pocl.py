"""pip's PoCL on a processor newer than its compiler and a system without a linker: right once prepared."""

import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from bentray_kernels.opencl import pocl
from bentray_kernels.opencl.library import files_of
from bentray_kernels.opencl.pocl import BUILD, BUILT_FOR, prepare, processor_name
from bentray_kernels.opencl.processor import processor

ON_X86 = sys.platform == "linux" and platform.machine() == "x86_64"

OLD = frozenset({"sse2", "ssse3", "cx16", "sse4_1", "popcnt", "avx"})
ZEN_5 = OLD | {"f16c", "fma", "avx2", "abm", "bmi1", "bmi2", "avx512f", "avx512bw", "avx512vl"}

# The function that asks LLVM for the processor's name answers as on AMD family 26; then the device is tried.
UNKNOWN_PROCESSOR = """
import ctypes, struct, sys
from bentray_kernels.opencl import devices, self_test
from bentray_kernels.opencl.session import Session

library, how = sys.argv[1:]
libc = ctypes.CDLL(None)
asked = ctypes.cast(ctypes.CDLL(library).pocl_get_llvm_cpu_name, ctypes.c_void_p).value
text = ctypes.create_string_buffer(b"generic")
copy = ctypes.cast(libc.strdup, ctypes.c_void_p).value
# mov rdi, text; mov rax, strdup; jmp rax
code = b"\\x48\\xbf" + struct.pack("<Q", ctypes.addressof(text))
code += b"\\x48\\xb8" + struct.pack("<Q", copy) + b"\\xff\\xe0"
assert libc.mprotect(ctypes.c_void_p(asked & -4096), ctypes.c_size_t(8192), 7) == 0
ctypes.memmove(asked, code, len(code))
if how == "as it comes":
    devices.prepare = lambda handle: None
(device,) = [d for d in devices.find_devices() if d.library == library]
assert device.version.endswith("-generic")
session = Session(device)
for stage in ("double1", "solve", "double16"):
    print(stage, self_test.fault_of(session, stage) or "right", flush=True)
"""


@pytest.mark.parametrize(
    ("features", "name"),
    [
        (ZEN_5, "skylake-avx512"),
        (ZEN_5 - {"avx512f"}, "haswell"),
        (ZEN_5 - {"avx512f", "bmi2"}, "ivybridge"),
        (OLD, "sandybridge"),
        (OLD | {"xop", "fma4"}, "bdver1"),
        (OLD - {"avx"}, "penryn"),
        (frozenset({"sse2", "ssse3", "cx16"}), "core2"),
        (frozenset({"sse2"}), "x86-64"),
        (frozenset({"fp", "asimd"}), None),
    ],
)
def test_the_name_is_that_of_the_library_for_the_features(features, name):
    assert processor_name(features) == name


@pytest.mark.skipif(not ON_X86, reason="pip has PoCL for x86-64 alone")
def test_pip_provides_the_expected_build_for_this_processor():
    """Fails when another build comes, whose records may be laid out otherwise: then see to pocl.py."""
    assert metadata.version("pocl-binary-distribution") == "3.0"
    assert [file.name for file in files_of("pocl-binary-distribution", BUILD)] == [BUILD]
    assert processor_name(processor()) in [name for name, _ in BUILT_FOR]


def test_other_devices_are_left_alone():
    class Handle:
        int_ptr = 0

    prepare(Handle())


def test_a_system_links_with_ld_and_the_libraries_of_a_compiler(tmp_path, monkeypatch):
    folders = tmp_path / "usr/lib64/gcc/x86_64-redhat-linux/14", tmp_path / "usr/lib/x86_64-linux-gnu"
    monkeypatch.setattr(pocl.shutil, "which", lambda name: f"/usr/bin/{name}")
    assert not pocl.system_links(tmp_path)
    for folder, name in zip(folders, ("libgcc.a", "libc.so"), strict=True):
        folder.mkdir(parents=True)
        (folder / name).touch()
    assert pocl.system_links(tmp_path)
    monkeypatch.setattr(pocl.shutil, "which", lambda name: None)
    assert not pocl.system_links(tmp_path)


def test_user_settings_take_precedence_over_our_linker(monkeypatch):
    monkeypatch.setenv("COMPILER_PATH", "/usr/local/cross")
    monkeypatch.setenv("BENTRAY_PYTHON", "")
    for _ in range(2):
        pocl._provide_linker()
    first, ours = os.environ["COMPILER_PATH"].split(":")
    assert first == "/usr/local/cross"
    assert os.access(Path(ours, "ld"), os.X_OK)


@pytest.mark.opencl
@pytest.mark.skipif(not ON_X86, reason="pip has PoCL for x86-64 alone")
@pytest.mark.parametrize("how", ["as it comes", "prepared"])
def test_unknown_processor_without_a_linker(how, tmp_path, monkeypatch):
    (library,) = files_of("pocl-binary-distribution", BUILD)
    # Nothing that another run has built, and no program but Python.
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("COMPILER_PATH", raising=False)
    done = subprocess.run(
        [sys.executable, "-c", UNKNOWN_PROCESSOR, str(Path(library)), how],
        capture_output=True,
        text=True,
        timeout=120,
    )
    if how == "prepared":
        assert done.returncode == 0, done.stderr
        assert done.stdout.splitlines() == [f"{stage} right" for stage in ("double1", "solve", "double16")]
    else:
        assert done.returncode != 0
        assert "unknown target CPU 'generic'" in done.stderr
