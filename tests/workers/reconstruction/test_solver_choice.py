"""The executed solver is the planned one, for every combination of rays, decomposition and Eikonal solver."""

from itertools import product

import pytest

from bentray_kernels.eikonal import methods
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Problem, Settings
from bentray_kernels.tomography.grid_schedule import initial_slowness
from bentray_kernels.tomography.sart import sart_update
from bentray_kernels.tomography.sart.sart_step import advance, begin
from bentray_kernels.tomography.settings import DEVIATION
from bentray_kernels.tomography.solver_choice import needs_device, sart_engine, solver_of, wave_engine
from bentray_workers.cluster.capacities import MIB, resource_of
from bentray_workers.files.dataset.counts import Summary
from bentray_workers.reconstruction.ray_sizes import ray_task_sizes
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.volume import VolumeSimulationSettings

RAYS, CUTS = ("curved", "straight"), ("slices", "volume")
SOLVERS = (DEVIATION, *methods())
# A device is not to be had everywhere, and stands in for itself.
ON_DEVICE = ("fim-opencl",)


@pytest.fixture(scope="module")
def scans():
    plane = simulate(SimulationSettings(nodes=16, elements=8), lambda _: None)
    small = VolumeSimulationSettings(nodes=16, slices=2, elements=8, refinement=2, three_d=True)
    return {"slices": plane, "volume": simulate(small, lambda _: None)}


@pytest.mark.parametrize(("rays", "cut", "eikonal"), list(product(RAYS, CUTS, SOLVERS)))
def test_executed_solver_equals_the_planned_one(scans, monkeypatch, rays, cut, eikonal):
    if eikonal in ON_DEVICE:
        pytest.skip("its fallback on the CPU is tested with the device")
    settings = Settings(method="sart", nodes=16, iterations=1, rays=rays, decomposition=cut, eikonal=eikonal)
    problem = Problem.from_dataset(scans[cut], settings, 0)
    chosen = solver_of(settings, problem.region.ndim)
    solved, passed = [], []
    solve, trace = sart_update.solve, sart_update.EmitterPass.trace

    def watched(speed, spacing, source, method):
        solved.append(method)
        return solve(speed, spacing, source, method)

    def counted(self, slowness, front, *given):
        passed.append(front is not None)
        return trace(self, slowness, front, *given)

    monkeypatch.setattr(sart_update, "solve", watched)
    monkeypatch.setattr(sart_update.EmitterPass, "trace", counted)
    advance(problem, settings, begin(initial_slowness(problem)), 1)
    assert bool(passed) is chosen.compiled
    if chosen.compiled:
        assert solved == []
        assert set(passed) == {chosen.eikonal is not None}
    else:
        assert set(solved) == ({chosen.eikonal} - {None})


@pytest.mark.parametrize(("rays", "eikonal"), list(product(RAYS, SOLVERS)))
def test_the_plan_counts_the_arrays_of_what_runs(rays, eikonal):
    scan = Summary(1024, 1024, 1024**2, 1, False, 0.0, 0.2, 0, False)
    size = {
        name: ray_task_sizes(scan, Settings(method="sart", nodes=1024, rays=rays, eikonal=name))[
            "update_sart"
        ].bytes
        for name in (eikonal, DEVIATION)
    }
    settings = Settings(method="sart", nodes=1024, rays=rays, eikonal=eikonal)
    if solver_of(settings, 2).compiled:
        # Whatever the wave front would be tracked by: it is the same compiled call.
        assert size[eikonal] == size[DEVIATION]
    elif rays == "curved":
        assert abs(size[eikonal] - size[DEVIATION]) > MIB


@pytest.mark.parametrize("method", ["sart", "gauss-newton", "auto"])
@pytest.mark.parametrize(("rays", "eikonal"), list(product(("curved", "straight"), SOLVERS)))
def test_device_resource_is_requested_where_a_device_is_used(method, rays, eikonal):
    try:
        settings = Settings(method=method, rays=rays, eikonal=eikonal)
    except InvalidInput:
        pytest.skip("refused")
    used = eikonal in ON_DEVICE and (rays == "curved" or method == "auto")
    assert needs_device(settings) is used
    assert resource_of(settings) == ("opencl" if used else "recon")


@pytest.mark.parametrize("device", ["auto", "cpu", "opencl"])
@pytest.mark.parametrize("method", ["sart", "gauss-newton", "auto", "waveform"])
def test_waves_and_slices_are_computed_on_a_device_that_is_requested(method, device):
    settings = Settings(method=method, device=device)
    waves = device == "opencl" and method in ("auto", "waveform")
    slices = device == "opencl" and method == "sart"
    assert wave_engine(settings) == ("opencl" if waves else "compiled")
    assert sart_engine(settings, 2) == ("opencl" if slices else "compiled")
    assert resource_of(settings) == ("opencl" if waves or slices else "recon")


@pytest.mark.parametrize(
    ("changes", "able"),
    [
        ({}, True),
        ({"rays": "straight"}, True),
        ({"speed_range_mps": (1400.0, 1600.0)}, False),
        ({"eikonal": "fmm"}, False),
        ({"ray_gradient": "bspline"}, False),
    ],
)
def test_slices_whose_front_is_that_of_the_compiled_pass_run_on_a_device(changes, able):
    settings = Settings.from_values(method="sart", device="opencl", **changes)
    assert sart_engine(settings, 2) == ("opencl" if able else "compiled")
    assert sart_engine(settings, 3) == "compiled"
