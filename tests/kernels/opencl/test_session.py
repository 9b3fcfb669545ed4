"""An open OpenCL device builds each program once; blocks are solved alike whatever else is in the batch."""

from importlib import resources

import numpy as np
import pyopencl as cl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.opencl.blocks import EDGES, Blocks, travel_times
from bentray_kernels.opencl.program import Program
from bentray_kernels.opencl.self_test import reference
from bentray_kernels.opencl.session import DeviceKernel, Session, probe

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


SHAPES = st.one_of(st.tuples(*[st.integers(1, 20)] * 2), st.tuples(*[st.integers(1, 9)] * 3))


@given(shape=SHAPES, batch=st.integers(1, 3))
def test_cut_and_joined_is_the_same(shape, batch):
    grids = np.random.default_rng(0).uniform(size=(batch, *shape))
    blocks = Blocks(shape)
    cut = blocks.cut(grids)
    assert cut.shape == (batch, blocks.number, EDGES[len(shape)] ** len(shape))
    assert np.isinf(cut).sum() == cut.size - grids.size
    assert np.array_equal(blocks.join(cut), grids)


def test_points_of_a_block_lie_together():
    grid = np.arange(16.0 * 24).reshape(1, 16, 24)
    assert np.array_equal(Blocks((16, 24)).cut(grid)[0, 4], grid[0, 8:16, 8:16].ravel())


def test_around_gives_the_home_first_and_only_blocks_of_the_grid():
    blocks = Blocks((20, 9))
    points = list(blocks.around(np.array([np.ravel_multi_index((19, 8), (20, 9))])))
    assert points == [(2, 1), (1, 1), (2, 0)]


@pytest.mark.parametrize("shape", [(8, 8), (9, 7), (1, 30), (30, 1), (1, 1), (17, 24), (5, 4, 3), (1, 1, 9)])
def test_times_are_those_of_the_reference(session, shape):
    crossings = np.random.default_rng(1).uniform(0.2, 5.0, (1, *shape))
    last = tuple(n - 1 for n in shape)
    for source in ((0,) * len(shape), last):
        seeds = [(np.array([np.ravel_multi_index(source, shape)]), np.zeros(1))]
        times = travel_times(session, crossings, seeds)
        assert times.shape == (1, *shape)
        assert np.allclose(times[0], reference(crossings[0], source), rtol=1e-11, atol=0.0)


def test_result_does_not_depend_on_the_batch(session, monkeypatch):
    shape, rng = (21, 18), np.random.default_rng(2)
    crossings = rng.uniform(0.2, 5.0, (7, *shape))
    seeds = [(np.array([rng.integers(0, 21 * 18)]), np.zeros(1)) for _ in range(7)]
    together = travel_times(session, crossings, seeds)
    for k in range(7):
        assert np.array_equal(together[k], travel_times(session, crossings[k : k + 1], seeds[k : k + 1])[0])
    shared = travel_times(session, crossings[:1], seeds)
    assert np.array_equal(shared, travel_times(session, np.repeat(crossings[:1], 7, axis=0), seeds))
    # A device that holds two problems at a time, and one that seems to hold none.
    for room in (2 * Blocks(shape).points, 0):
        monkeypatch.setattr(Session, "doubles_at_once", lambda self, room=room: room)
        assert np.array_equal(travel_times(session, crossings, seeds), together)
        assert np.array_equal(travel_times(session, crossings[:1], seeds), shared)


def test_seed_between_blocks_activates_both(session):
    crossings = np.ones((1, 4, 16))
    seeds = [(np.array([7, 8]), np.array([0.5, 0.5]))]
    times = travel_times(session, crossings, seeds)[0, 0]
    assert np.allclose(times, np.abs(np.arange(16) - 7.5))
