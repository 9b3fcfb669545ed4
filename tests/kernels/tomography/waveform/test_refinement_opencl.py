"""A refinement whose waves are simulated on OpenCL: the image of compiled code, and the same bits again."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform.band_inversion import Model, emitters, evaluate
from bentray_kernels.tomography.waveform.refinement_graph import starting_models
from bentray_kernels.tomography.waveform.wave_scan import WaveScan

from .scans import SETTINGS, error, refine, refined, scan, water

ON_A_DEVICE = replace(SETTINGS, engine="opencl")


@pytest.mark.opencl
@pytest.mark.parametrize("number", [1, 2])
def test_misfits_of_all_emitters_are_those_of_compiled_code(number):
    problem = WaveScan(MemorySource(scan()), SETTINGS).problem(number)
    speed = starting_models(water(), problem, SETTINGS)[0].speed
    model = Model(speed, None if problem.band.of == "speed" else np.full_like(speed, 10.0))
    some = emitters(problem)
    expected, found = (evaluate(problem, plan, model, some) for plan in (SETTINGS, ON_A_DEVICE))
    assert found.misfit == pytest.approx(expected.misfit, rel=1e-4)
    assert found.held == pytest.approx(expected.held, rel=1e-4)
    # Compiled code leaves out waves that come too late for every receiver.
    for name, bound in (("gradient", 1e-4), ("illumination", 1e-2)):
        one, other = getattr(found, name), getattr(expected, name)
        assert np.abs(one - other).max() < bound * np.abs(other).max()
    again = evaluate(problem, ON_A_DEVICE, model, some)
    assert np.array_equal(found.gradient, again.gradient)


@pytest.mark.opencl
def test_the_image_is_that_of_compiled_code():
    graph = refine(scan(), ON_A_DEVICE, water())
    image, expected = graph.image, refined().image
    assert 0.0 < np.abs(image.speed - expected.speed).max() < 0.01
    assert np.abs(image.attenuation - expected.attenuation).max() < 0.01
    assert error(image) == pytest.approx(error(expected), rel=1e-3)
    assert graph.total == refined().total == graph.done
