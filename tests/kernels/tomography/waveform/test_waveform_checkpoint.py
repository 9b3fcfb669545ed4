"""Waveform refinement resumed from any checkpoint gives the bits of an uninterrupted run."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.tomography.checkpoint import pack, unpack
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform.refinement_graph import RefinementGraph
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.tomography.waveform.waveform_checkpoint import TYPES

from ....effort import effort
from ..graph_runs import run
from .scans import SETTINGS, refined, scan, water


@functools.cache
def memory_scan():
    return WaveScan(MemorySource(scan()), SETTINGS)


def begun():
    return RefinementGraph(memory_scan(), water())


@settings(max_examples=effort(2, 12), deadline=None)
@given(cuts=st.sets(st.integers(0, 140), min_size=1, max_size=5))
def test_a_refinement_cut_off_anywhere_ends_with_the_same_bits(cuts):
    (resumed, _), expected = run(begun, cuts, TYPES), refined()
    assert resumed.over
    assert resumed.done == resumed.total
    assert np.array_equal(resumed.image.speed, expected.image.speed)
    assert np.array_equal(resumed.image.attenuation, expected.image.attenuation)
    assert resumed.image.origin == expected.image.origin
    for end, other in zip(resumed.ends, expected.ends, strict=True):
        assert np.array_equal(end.image.speed, other.image.speed)
        assert (end.history, end.skipped) == (other.history, other.skipped)


def test_its_records_are_not_those_of_rays():
    graph, _ = run(begun)
    tree, arrays = pack(graph.checkpoint)
    with pytest.raises(KeyError):
        unpack(tree, arrays)
