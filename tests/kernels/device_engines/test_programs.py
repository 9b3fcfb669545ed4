"""Every OpenCL program with all its macros, compiled by Debian's clang as the compilers of GPUs would."""

import shutil
import subprocess
from importlib import resources

import pytest

from bentray_kernels.device_engines.benchmark_process import answer
from bentray_kernels.device_engines.programs import every_program
from bentray_kernels.opencl import Session
from bentray_kernels.opencl.device_benchmark import ENGINES
from bentray_kernels.opencl.program import Program

# In NVIDIA's headers these are functions, so no constant of a program may be initialised with them.
PRELUDE = """
float function_of_the_driver(void);
#undef INFINITY
#undef NAN
#undef HUGE_VALF
#undef HUGE_VAL
#define INFINITY (function_of_the_driver())
#define NAN (function_of_the_driver())
#define HUGE_VALF (function_of_the_driver())
#define HUGE_VAL (function_of_the_driver())
"""
# The front end itself, which takes many files at a time: starting it takes longer than a program.
FRONT_END = "-cc1 -triple spir64 -x cl -cl-std=CL1.2 -fdeclare-opencl-builtins -finclude-default-header"

PROGRAMS = tuple(dict.fromkeys(every_program()))


def compiled(programs, folder):
    """Messages of clang about programs; their files are numbered."""
    clang = shutil.which("clang")
    if clang is None:
        pytest.skip(
            "NOT CHECKED: no clang here that compiles the OpenCL programs (Debian: apt-get install clang)"
        )
    files = []
    for number, program in enumerate(programs):
        macros = "".join(f"#define {define.replace('=', ' ', 1)}\n" for define in program.defines)
        files.append(folder / f"{number}.cl")
        files[-1].write_text(macros + PRELUDE + program.text)
    words = [clang, *FRONT_END.split(), "-fsyntax-only", *map(str, files)]
    ended = subprocess.run(words, text=True, capture_output=True, check=False)
    assert (ended.returncode == 0) == ("error:" not in ended.stderr), ended.stderr
    return ended.stderr


def test_every_program_compiles(tmp_path):
    said = compiled(PROGRAMS, tmp_path)
    assert "error:" not in said, said[:2000]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("constant const Found NOT_AT_ALL = {-1, INFINITY, 0, 0};", "not a compile-time constant"),
        ("constant float NOTHING_AT_ALL = NAN;", "not a compile-time constant"),
        ("kernel void odd(global float *a) { a[0] = no_such_function(a[0]); }", "no_such_function"),
        ("kernel void odd(float *a) { a[0] = 0; }", "address space"),
    ],
)
def test_what_compilers_of_gpus_refuse_is_seen(monkeypatch, tmp_path, line, said):
    tracer = next(program for program in PROGRAMS if "geometry_field/surface" in program.sources)
    monkeypatch.setattr(Program, "text", tracer.text + line)
    assert said in compiled([tracer], tmp_path)


def test_every_file_is_in_a_program():
    folder = resources.files("bentray_kernels.opencl").joinpath("sources")
    files = {str(file.relative_to(folder).with_suffix("")) for file in folder.rglob("*.cl")}
    assert files == {source for program in PROGRAMS for source in program.sources}


@pytest.mark.opencl
@pytest.mark.nightly
@pytest.mark.parametrize("engine", ENGINES)
def test_what_the_engines_build_is_listed(monkeypatch, opencl_session, engine):
    built, own_kernel = [], Session.own_kernel

    def recorded(session, program, name):
        built.append(program)
        return own_kernel(session, program, name)

    monkeypatch.setattr(Session, "own_kernel", recorded)
    answer(engine)
    assert built
    assert set(built) <= set(PROGRAMS)
