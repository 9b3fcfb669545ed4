"""The whole refinement: it finds a blob, through noise, in any number of threads, on a device."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform.band_inversion import Model, emitters, evaluate
from bentray_kernels.tomography.waveform.refinement_graph import starting_models
from bentray_kernels.tomography.waveform.wave_scan import WaveScan

from .scans import SETTINGS, error, lossy, nodes_of, refine, refined, scan, true_image, water


def test_the_blob_is_found():
    start, result = water(), refined()
    assert error(result.image) < 0.5 * error(start)
    assert not any(end.skipped for end in result.ends)
    first, last = result.ends[1].history[0], result.ends[1].history[-1]
    assert last.misfit < 0.6 * first.misfit
    assert last.held < 0.8 * first.held


@pytest.mark.nightly
def test_it_is_found_through_noise():
    assert error(refine(scan(noise=0.05), SETTINGS, water()).image) < 0.6 * error(water())


def losses(image):
    """Attenuation found and true inside 12 mm, Np/m."""
    x, y = nodes_of(image)
    inside = np.hypot(x, y) < 0.012
    return image.attenuation[inside], lossy(x, y)[inside]


def test_the_loss_is_found_and_the_speed_stays():
    plan = replace(SETTINGS, bands=(replace(SETTINGS.bands[2], iterations=6),))
    start = true_image()
    result = refine(scan(loss=True), plan, start)
    assert result.image.speed is start.speed
    image, true = losses(result.image)
    assert np.corrcoef(image, true)[0, 1] > 0.9
    assert np.sqrt(((image - true) ** 2).mean()) < 0.4 * true.std()
    none = losses(refine(scan(), plan, start).image)[0]
    assert none.max() < 0.15 * image.max()


def test_element_gains_are_not_attributed_to_attenuation():
    plan = replace(SETTINGS, bands=(SETTINGS.bands[2],))
    data = scan(loss=True)
    gain = np.random.default_rng(0).uniform(0.5, 2.0, data.waveform.object.shape[:2]).astype(np.float32)
    traces = (data.waveform.object, data.waveform.water)
    uneven = Waveform(*(gain[:, :, None] * part for part in traces))
    images = [
        refine(replace(data, waveform=waves), plan, true_image()).image.attenuation
        for waves in (data.waveform, uneven)
    ]
    assert np.abs(images[1] - images[0]).max() < 0.05 * images[0].max()


def test_threads_give_the_same_bits():
    assert np.array_equal(refine(scan(), SETTINGS, water(), threads=3).image.speed, refined().image.speed)


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
