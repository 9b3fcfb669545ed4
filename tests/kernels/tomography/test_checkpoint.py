"""Task graphs interrupted anywhere and resumed from a checkpoint give the same bits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.phantoms import TABLE6_SIDE_M
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.checkpoint import pack, unpack
from bentray_kernels.tomography.model_selection.candidates import CandidateGraph
from bentray_kernels.tomography.reconstruction_graph import (
    ReconstructionCheckpoint,
    ReconstructionGraph,
    estimate_uncertainty,
)
from bentray_kernels.tomography.sart.sart_step import begin
from bentray_kernels.tomography.scan import MemorySource, Scan

from ...effort import effort
from ...table6 import table6_scan
from .graph_runs import run, stored

PLANS = {
    "sart": Settings(method="sart", nodes=32, side_m=TABLE6_SIDE_M, iterations=2, resolution_check=True),
    "gauss-newton": Settings.from_values(
        method="gauss-newton",
        nodes=32,
        side_m=TABLE6_SIDE_M,
        iterations=3,
        coarser_grids=1,
    ),
}


@pytest.fixture(scope="module")
def dataset():
    return table6_scan(16, 32, 0.08, 1500.0, attenuation=True)


@pytest.mark.parametrize("name", PLANS)
@settings(max_examples=effort(2, 12), deadline=None)
@given(cuts=st.sets(st.integers(0, 12), min_size=1, max_size=4))
def test_a_graph_interrupted_anywhere_gives_the_same_bits(dataset, name, cuts):
    def make():
        return ReconstructionGraph(Scan(MemorySource(dataset), PLANS[name]), 0)

    whole, _ = run(make)
    resumed, _ = run(make, cuts)
    assert resumed.history == whole.history
    assert resumed.done == whole.done == whole.total
    (tree, arrays), (same, others) = (pack(stored(graph)) for graph in (resumed, whole))
    assert tree == same
    assert all(map(np.array_equal, arrays, others))


def test_an_attenuation_without_misfits_is_solved_again(dataset):
    """As checkpoints of earlier versions have it."""
    graph = ReconstructionGraph(Scan(MemorySource(dataset), PLANS["sart"].changed(resolution_check=False)), 0)
    run(lambda: graph)
    kept = stored(graph)
    (losses,) = kept.values
    graph.restore(kept)
    assert graph.first() == []
    graph.restore(replace(kept, values=(losses.image,)))
    assert graph.first()


def test_the_uncertainty_is_kept_and_computed_again_to_the_same_bits(dataset):
    plan = PLANS["sart"].changed(iterations=1, attenuation=False, resolution_check=False, uncertainty=True)

    def make():
        return ReconstructionGraph(Scan(MemorySource(dataset), plan), 0)

    whole, tasks = run(make)
    kept = stored(whole).values[0]
    one = whole.value_of(estimate_uncertainty)
    assert np.array_equal(kept.deviation, one.deviation)
    resumed, _ = run(make, {tasks - 1})
    other = resumed.value_of(estimate_uncertainty)
    assert np.array_equal(other.deviation, one.deviation)
    assert other.width_m == one.width_m == kept.width_m > 0.0


def test_the_graph_of_a_candidate_keeps_its_misfit(dataset):
    plan = PLANS["sart"].changed(attenuation=False, resolution_check=False)

    def make():
        shown, *held = (Scan(MemorySource(dataset), plan, part) for part in ("shown", "held-out", "views"))
        return CandidateGraph(shown, 0, *held)

    whole, tasks = run(make)
    again = make()
    again.restore(stored(whole))
    assert again.first() == []
    assert again.misfits() == whole.misfits()
    assert whole.misfits()[0] > 0.0
    resumed, more = run(make, {tasks - 1})
    assert resumed.misfits() == whole.misfits()
    assert more <= tasks + 1


def test_a_value_that_is_no_checkpoint_is_rejected():
    with pytest.raises(TypeError):
        unpack([1, 2], [])
    with pytest.raises(KeyError):
        unpack({"of": "Path", "fields": {}}, [])


def test_files_keep_the_name_of_a_renamed_field():
    state = replace(begin(np.ones((2, 2))), iteration=3)
    tree, arrays = pack(ReconstructionCheckpoint(0, 0, (), state, (), 1e-3, (0.0, 0.0)))
    assert tree["fields"]["state"]["fields"]["sweep"] == 3
    assert unpack(tree, arrays).state.iteration == 3
