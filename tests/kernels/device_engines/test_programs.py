"""Every OpenCL program with all its macros, compiled by Debian's clang as the compilers of GPUs would."""

import shutil
import subprocess
from importlib import resources
from itertools import product

import numpy as np
import pytest

from bentray_kernels.device_engines.benchmark_process import answer
from bentray_kernels.geometry_field.tracing import ray_tracer_opencl
from bentray_kernels.opencl import Session, blocks, session
from bentray_kernels.opencl.device_benchmark import ENGINES
from bentray_kernels.opencl.program import Program
from bentray_kernels.refraction import caster_opencl
from bentray_kernels.splines import FILTERS
from bentray_kernels.splines.sampling import stencil_of
from bentray_kernels.tomography.reflection import delay_and_sum_opencl
from bentray_kernels.tomography.sart import device_slices
from bentray_kernels.wave import device_waves

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


def every_program():
    """The programs of all engines, each with every combination of macros that its engine may define."""
    yield from map(session._probing, session.WIDTHS)
    yield from map(blocks._program, blocks.EDGES)
    yield from map(device_slices._program, device_slices.GROUPS)
    yield delay_and_sum_opencl.PROGRAM
    yield from map(ray_tracer_opencl._program, ray_tracer_opencl.ROUNDING)
    for kind in map(np.dtype, (np.float32, np.float64)):
        yield device_waves._misfits(kind)
        stores = (device_waves.NOTHING, *device_waves.STORES.values())
        for sizes in product((2, 3), stores, (False, True)):
            yield device_waves._waves(kind, *sizes)
    ways = ("STEPS", *caster_opencl.WITHIN_CELLS.values())
    precisions = (("float64", "float64"), ("float64", "float32"), ("float32", "float32"))
    for chosen, way, numbers in product(FILTERS.values(), ways, precisions):
        yield caster_opencl._program(*numbers, stencil_of(chosen), way)


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
