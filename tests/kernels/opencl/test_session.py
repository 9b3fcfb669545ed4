"""An open OpenCL device builds each program once."""

from importlib import resources

import numpy as np
import pyopencl as cl
import pytest

from bentray_kernels.opencl.program import Program
from bentray_kernels.opencl.session import DeviceKernel, probe

PROBE = Program(("probe",), ("REAL=double",))


def test_a_kernel_is_built_once(session):
    first = session.kernel(PROBE, "probe")
    assert session.kernel(PROBE, "probe") is first
    assert session.kernel(Program(("probe",), ("REAL=double2",)), "probe") is not first


def test_a_source_that_does_not_compile_is_an_error(session):
    with pytest.raises(cl.RuntimeError):
        session.kernel(Program(("probe",), ("REAL=no_such_type",)), "probe")


def test_a_program_of_several_files_names_the_one_that_does_not_compile(session):
    text = resources.files("bentray_kernels.opencl").joinpath("sources", "refraction", "field.cl").read_text()
    line = 1 + text[: text.index("const SUM *coefficients")].count("\n")
    with pytest.raises(cl.RuntimeError, match=rf"field\.cl:{line}:"):
        session.kernel(Program(("probe", "refraction/field"), ("REAL=double",)), "probe")


def test_later_files_see_earlier_definitions(session):
    both = Program(("refraction/rays", "probe"), ("REAL=double",))
    assert session.kernel(both, "probe").handle.function_name == "probe"


def test_arguments_have_the_names_of_the_source():
    assert PROBE.positions("probe") == {"a": 0, "b": 1, "root": 2, "lower": 3}
    with pytest.raises(KeyError, match="roof"):
        DeviceKernel(None, PROBE.positions("probe")).set(roof=1.0)


def test_buffers_round_trip(session):
    sent = np.arange(10.0)
    buffer = session.upload(sent)
    whole, rest = np.empty(10), np.empty(4)
    session.download(whole, buffer)
    session.download(rest, buffer, 6 * 8)
    assert np.array_equal(whole, sent)
    assert np.array_equal(rest, sent[6:])


@pytest.mark.parametrize("width", [1, 2, 4])
def test_probe_gives_root_and_minimum(session, width):
    a, b = np.arange(16.0), np.full(16, 7.5)
    root, lower = probe(session, width, a, b)
    assert np.allclose(root, np.sqrt(a), rtol=1e-15, atol=0.0)
    assert np.array_equal(lower, np.minimum(a, b))
