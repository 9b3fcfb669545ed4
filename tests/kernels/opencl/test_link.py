"""Our linker makes loadable libraries and reports objects that it cannot link."""

import ctypes
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from bentray_kernels.opencl.link import shared_library
from bentray_kernels.opencl.link.shared_library import link, main

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="it links for x86-64 Linux"
)

# Code, constants, data that is written or begins as zeros, tables of addresses, functions of the process.
PROGRAM = """
target triple = "x86_64-unknown-linux-gnu"
@counter = global i32 5
@zeros = internal global [300 x i32] zeroinitializer
@shared = common global i64 0, align 16
@tables = constant [3 x ptr] [ptr @twice, ptr @thrice, ptr @abs]
declare i32 @abs(i32)
declare i64 @strlen(ptr)
@word = private constant [6 x i8] c"rough\\00"
define i32 @twice(i32 %n) {
  %r = mul i32 %n, 2
  ret i32 %r
}
define i32 @thrice(i32 %n) {
  %r = mul i32 %n, 3
  ret i32 %r
}
define i32 @count() {
  %before = load i32, ptr @counter
  %after = add i32 %before, 1
  store i32 %after, ptr @counter
  %last = getelementptr [300 x i32], ptr @zeros, i64 0, i64 299
  %seen = load volatile i32, ptr %last
  store volatile i32 %after, ptr %last
  store i64 7, ptr @shared
  %r = add i32 %after, %seen
  ret i32 %r
}
define i32 @pick(i64 %which, i32 %n) {
  %at = getelementptr [3 x ptr], ptr @tables, i64 0, i64 %which
  %function = load ptr, ptr %at
  %r = call i32 %function(i32 %n)
  ret i32 %r
}
define i64 @length() {
  %r = call i64 @strlen(ptr nonnull @word)
  ret i64 %r
}
define double @pi() {
  ret double 3.14159265358979
}
"""


def built(text: str, reloc: str = "pic") -> bytes:
    """An object of LLVM's assembly, as PoCL has LLVM make one of a kernel."""
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_triple("x86_64-unknown-linux-gnu")
    machine = target.create_target_machine(reloc=reloc, codemodel="small", opt=0)
    return bytes(machine.emit_object(binding.parse_assembly(text)))


def loaded(folder: Path, library: bytes) -> ctypes.CDLL:
    (folder / "made.so").write_bytes(library)
    return ctypes.CDLL(str(folder / "made.so"))


def test_a_program_computes_as_written(tmp_path):
    made = loaded(tmp_path, link(built(PROGRAM)))
    assert [made.count(), made.count()] == [6, 7 + 6]
    assert ctypes.c_int64.in_dll(made, "shared").value == 7
    assert ctypes.c_int32.in_dll(made, "counter").value == 7
    assert [made.pick(ctypes.c_int64(k), -4) for k in range(3)] == [-8, -12, 4]
    assert made.length() == 5
    made.pi.restype = ctypes.c_double
    assert made.pi() == 3.14159265358979


def test_the_command_takes_what_a_compiler_gives_to_ld(tmp_path):
    (tmp_path / "kernel.o").write_bytes(built(PROGRAM))
    words = [
        "--hash-style=both",
        "-m",
        "elf_x86_64",
        "-shared",
        "-o",
        str(tmp_path / "made.so"),
        "-L/usr/lib",
    ]
    program = Path(shared_library.__file__).with_name("ld")
    done = subprocess.run(
        [program, *words, str(tmp_path / "kernel.o"), "-lgcc", "--as-needed", "-lc"],
        env={"BENTRAY_PYTHON": sys.executable, "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert ctypes.CDLL(str(tmp_path / "made.so")).pick(ctypes.c_int64(1), 5) == 15


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "unpack"),
        (b"no object" * 20, "no relocatable object"),
        (b"\x7fELF\x02\x01" + bytes(58), "no relocatable"),
    ],
)
def test_reports_invalid_object_files(tmp_path, capsys, content, why):
    (tmp_path / "kernel.o").write_bytes(content)
    assert main(["-o", str(tmp_path / "made.so"), str(tmp_path / "kernel.o")]) == 1
    assert why in capsys.readouterr().err
    assert not (tmp_path / "made.so").exists()


@pytest.mark.parametrize("words", [[], ["-o"], ["-o", "made.so"], ["-o", "made.so", "a.o", "b.o"], ["a.o"]])
def test_a_command_without_one_object_is_rejected(capsys, words):
    assert main(words) == 1
    assert "one object and -o are needed" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text",
    [
        """@mine = thread_local global i32 1
        define i32 @get() {
          %r = load i32, ptr @mine
          ret i32 %r
        }""",
        """@near = internal global i32 1
        define ptr @get() {
          ret ptr @near
        }""",
    ],
    ids=["thread-local", "absolute"],
)
def test_rejects_objects_that_cannot_be_linked(text):
    with pytest.raises(ValueError, match=r"relocation|absolute|no part"):
        link(built(f'target triple = "x86_64-unknown-linux-gnu"\n{text}', reloc="static"))
