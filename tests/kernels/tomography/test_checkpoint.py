"""Chains cut off anywhere and gone on with from a checkpoint's content end as if nothing had happened."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.checkpoint import packed, unpacked
from bentray_kernels.tomography.model_selection.candidates import TrialChain
from bentray_kernels.tomography.reconstruct import Here
from bentray_kernels.tomography.task_chains import Chain, attenuate, recover

PLANS = {
    "sart": Settings(nodes=32, side_m=TABLE6_SIDE_M, sweeps=2, resolution_check=True),
    "gauss-newton": Settings(
        method="gauss-newton", nodes=32, side_m=TABLE6_SIDE_M, sweeps=3, coarser_grids=1, straight_sweeps=1
    ),
}


@pytest.fixture(scope="module")
def dataset():
    ring, emitters = Ring(16, 0.08), np.arange(16)
    scan = TravelTimeScan(table6(1500.0), ring, TABLE6_SIDE_M, nodes=32)
    delta, ratio = scan.medium(attenuation=True).arrivals(scan.elements(), emitters)
    return Dataset(ring.positions(), emitters, emitters, 1500.0, delta_tof_s=delta, log_ratio_np=ratio)


def stored(chain):
    """Where it stands, through what a file can hold."""
    tree, arrays = packed(chain.standing)
    return unpacked(json.loads(json.dumps(tree)), [array.copy() for array in arrays])


def run(make, cuts=()):
    """A chain to its end; before each call whose number is among ``cuts`` it is lost and made anew."""
    chain = make()
    ready, done = chain.first(), 0
    while ready:
        if done in cuts:
            standing = stored(chain)
            chain = make()
            chain.restore(standing)
            ready = chain.first()
        done += 1
        call = ready.pop(0)
        ready += chain.after(call, call.function(*call.arguments))
    return chain, done


@pytest.mark.parametrize("name", PLANS)
@settings(max_examples=6, deadline=None)
@given(cuts=st.sets(st.integers(0, 12), min_size=1, max_size=4))
def test_a_chain_cut_off_anywhere_ends_with_the_same_bits(dataset, name, cuts):
    def make():
        return Chain(Here(dataset, PLANS[name], "all"), 0)

    whole, _ = run(make)
    resumed, _ = run(make, cuts)
    assert resumed.history == whole.history
    assert resumed.done == whole.done == whole.total
    for then in (attenuate, recover):
        assert np.array_equal(resumed.found(then), whole.found(then)) or whole.found(then) is None
    assert np.array_equal(resumed.state.slowness, whole.state.slowness)
    assert np.array_equal(resumed.state.coverage, whole.state.coverage)
    assert np.array_equal(resumed.state.residuals, whole.state.residuals)


def test_the_chain_of_a_trial_keeps_its_misfit(dataset):
    plan = replace(PLANS["sart"], attenuation=False, resolution_check=False)

    def make():
        return TrialChain(Here(dataset, plan, "shown"), 0, Here(dataset, plan, "held-out"))

    whole, calls = run(make)
    again = make()
    again.restore(stored(whole))
    assert again.first() == []
    assert again.held_out_rms_s == whole.held_out_rms_s > 0.0
    resumed, more = run(make, {calls - 1})
    assert resumed.held_out_rms_s == whole.held_out_rms_s
    assert more <= calls + 1


def test_what_is_no_state_is_refused():
    with pytest.raises(TypeError):
        unpacked([1, 2], [])
    with pytest.raises(KeyError):
        unpacked({"of": "Path", "fields": {}}, [])
