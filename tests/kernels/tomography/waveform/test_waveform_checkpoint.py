"""Refinements cut off anywhere and gone on with from a checkpoint end as if nothing had happened."""

import functools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.tomography.checkpoint import packed, unpacked
from bentray_kernels.tomography.waveform.frequency_continuation import Here
from bentray_kernels.tomography.waveform.waveform_chain import WaveChain
from bentray_kernels.tomography.waveform.waveform_checkpoint import TYPES

from .scans import SETTINGS, refined, scan, water


@functools.cache
def here():
    return Here(scan(), SETTINGS)


def stored(chain):
    """Where it stands, through what a file can hold."""
    tree, arrays = packed(chain.standing)
    return unpacked(json.loads(json.dumps(tree)), [array.copy() for array in arrays], TYPES)


def run(cuts=()):
    """A chain to its end; before each call whose number is among ``cuts`` it is lost and made anew."""
    chain = WaveChain(here(), water())
    ready, done = chain.first(), 0
    while ready:
        if done in cuts:
            standing = stored(chain)
            chain = WaveChain(here(), water())
            chain.restore(standing)
            ready = chain.first()
        done += 1
        call = ready.pop(0)
        ready += chain.after(call, call.function(*call.arguments))
    return chain


@settings(max_examples=6, deadline=None)
@given(cuts=st.sets(st.integers(0, 140), min_size=1, max_size=5))
def test_a_refinement_cut_off_anywhere_ends_with_the_same_bits(cuts):
    resumed, expected = run(cuts), refined()
    assert resumed.over
    assert resumed.done == resumed.total
    assert np.array_equal(resumed.image.speed, expected.image.speed)
    assert np.array_equal(resumed.image.attenuation, expected.image.attenuation)
    assert resumed.image.origin == expected.image.origin
    for end, other in zip(resumed.ends, expected.bands, strict=True):
        assert np.array_equal(end.image.speed, other.image.speed)
        assert (end.history, end.skipped) == (other.history, other.skipped)


def test_its_records_are_not_those_of_rays():
    chain = run()
    tree, arrays = packed(chain.standing)
    with pytest.raises(KeyError):
        unpacked(tree, arrays)
