"""Validation by simulated waves: images are ranked as by the truth, and noise is accounted for."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.checkpoint import pack, unpack
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform.automatic_settings import scale_of, wave_settings
from bentray_kernels.tomography.waveform.validation import (
    MIN_VALID_CORRELATION,
    SHOTS,
    Validation,
    ValidationGraph,
    evaluations,
    validate_image,
    validation_settings,
)
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.tomography.waveform.waveform_checkpoint import TYPES

from .scans import WATER, scan, true_image


def images():
    """The truth, half of it, water and the truth upside down."""
    true = true_image(half=30)
    parts = true.speed, 0.5 * (WATER + true.speed), np.full_like(true.speed, WATER), 2.0 * WATER - true.speed
    return [replace(true, speed=part) for part in parts]


def plan_for(data):
    settings = Settings(method="waveform")
    return wave_settings(scale_of(data, settings, data.waveform.object.shape[-1], 1), settings)


@pytest.fixture(scope="module")
def heard():
    data = scan()
    return WaveScan(MemorySource(data), validation_settings(plan_for(data)))


def test_images_are_ranked_as_the_truth_ranks_them(heard):
    found = [validate_image(heard, image) for image in images()]
    assert [one.misfit for one in found] == sorted(one.misfit for one in found)
    assert found[1].misfit > 5.0 * found[0].misfit
    assert {one.water for one in found} == {1.0 - heard.problem(0).water_correlation}
    # Through the truth no more is left than in water, but for what the grid does to it.
    assert found[0].misfit < 3.0 * found[0].water


def test_noise_counts_as_it_does_in_water():
    data = scan(seed=1, noise=0.1)
    noisy = WaveScan(MemorySource(data), validation_settings(plan_for(data)))
    found = validate_image(noisy, images()[0])
    assert 0.5 * found.water < found.misfit < 2.0 * found.water


def test_no_report_where_water_shots_cannot_be_simulated():
    data = scan()
    random = np.random.default_rng(0).normal(size=data.waveform.water.shape).astype(np.float32)
    deaf = replace(data, waveform=replace(data.waveform, water=random))
    here = WaveScan(MemorySource(deaf), validation_settings(plan_for(deaf)))
    assert here.problem(0).water_correlation < MIN_VALID_CORRELATION
    assert validate_image(here, images()[0]) == Validation()


def test_few_emitters_are_read(heard):
    plan = heard.plan
    assert evaluations(plan) == SHOTS + plan.held_out
    assert len(heard.problem(0).traces) == evaluations(plan)
    assert [band.of for band in plan.bands] == ["speed"]


def test_validation_resumes_from_its_checkpoint(heard):
    judge = ValidationGraph(heard, images()[1], ())
    (task,) = judge.first()
    assert (judge.done, judge.checkpoint.milestone) == (0, (False,))
    assert judge.after(task, task.function(*task.arguments)) == []
    assert judge.done == judge.total
    again = ValidationGraph(heard, images()[1], ())
    again.restore(unpack(*pack(judge.checkpoint), TYPES))
    assert again.first() == []
    assert again.validation == judge.validation
