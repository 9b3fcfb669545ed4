"""Advice on waves: given after rays, followed where it may be, and not against held-out emitters."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bentray_kernels.acquisition import pick
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Candidate, Settings, reconstruct
from bentray_kernels.tomography.waveform.band_inversion import Evaluation
from bentray_kernels.tomography.waveform.inversion_state import BandEnd, Image
from bentray_kernels.tomography.waveform.refinement import CLEARLY, _band_note, misfit_ratio
from bentray_kernels.tomography.waveform.validation import Validation
from bentray_kernels.tomography.waveform.waveform_cost import advice

from .scans import error, scan

PLAN = Settings.from_values(
    method="auto", rays="straight", nodes=32, iterations=2, bands=3, emitters=6, minutes=60.0
)


def heard(noise=0.0):
    made = scan(seed=3, noise=noise)
    return replace(pick(made), waveform=made.waveform, water_attenuation_np_m=0.25)


def error_of(result):
    return error(Image(result.speed, result.spacing_m[0], result.origin_m))


@pytest.fixture(scope="module")
def rays():
    return reconstruct(heard(), replace(PLAN, minutes=0.0))


def test_auto_runs_waveform_inversion_where_it_predicts_better(rays):
    seen = []
    result = reconstruct(heard(), PLAN, seen.append)
    assert result.settings == replace(PLAN, method="waveform", decomposition="slices")
    assert error_of(result) < 0.9 * error_of(rays)
    # What is refined comes on top of the water's.
    assert rays.attenuation is None
    assert result.attenuation.shape == result.speed.shape
    assert (result.attenuation[0] == 0.25).all()
    assert result.attenuation.min() == 0.25
    assert seen[-1].done == seen[-1].total
    # What was chosen gives the same bits when asked for by itself.
    again = reconstruct(heard(), result.settings)
    assert np.array_equal(again.speed, result.speed)
    assert again.history == result.history


def test_without_a_budget_there_is_only_advice(rays):
    assert rays.settings.method in ("sart", "gauss-newton")
    assert rays.provenance["waveform"].startswith("method waveform ")
    assert rays.provenance["waveform"].endswith("it takes about a minute of a core")
    # A tenth of a second is too little.
    hurried = reconstruct(heard(), replace(PLAN, minutes=0.1 / 60.0))
    assert np.array_equal(hurried.speed, rays.speed)
    assert hurried.provenance == rays.provenance


def test_waves_are_advised_where_the_image_explains_less_than_water_does(rays):
    """The image of rays leaves four times what is left in water; beside noise that is nothing."""
    advised = rays.provenance["waveform"]
    assert advised.startswith("method waveform is advised, for waves through the image of rays miss")
    assert float(rays.provenance["misfit_over_noise"]) > 3.0
    noisy = reconstruct(heard(0.05), replace(PLAN, minutes=0.0))
    assert noisy.provenance["waveform"].startswith("method waveform would gain little, for waves through")
    assert "misfit_over_noise" not in noisy.provenance


def test_advice_without_waveform_inversion_uses_times():
    missed = Candidate({}, held_out_rms_s=100e-9, shown_rms_s=50e-9)
    assert advice(Validation(), missed, 10e-9, 3.4) == {
        "waveform": "method waveform is advised, for rays miss held-out times by 100 ns, "
        "whose noise is 10 ns; it takes about 3 minutes of a core",
        "misfit_over_noise": "10",
    }
    declined = advice(Validation(), missed, 80e-9, 0.2)
    assert declined["waveform"].startswith("method waveform would gain little, for rays miss")
    assert list(declined) == ["waveform"]


def test_advice_for_a_scan_that_claims_no_noise_has_a_finite_number():
    missed = Candidate({}, held_out_rms_s=100e-9, shown_rms_s=50e-9)
    assert advice(Validation(), missed, 0.0, 1.0)["misfit_over_noise"] == "1e+03"
    assert advice(Validation(0.3, 0.02), missed, 0.0, 1.0)["misfit_over_noise"] == "15"


@pytest.mark.nightly
def test_held_out_emitters_decide_against_it():
    """Noise as high as the signal: what waves make of it predicts nothing."""
    loud = heard(0.3)
    result = reconstruct(loud, PLAN)
    rays = reconstruct(loud, replace(PLAN, minutes=0.0))
    assert result.settings == replace(rays.settings, minutes=60.0)
    assert np.array_equal(result.speed, rays.speed)
    assert result.provenance["waveform"].endswith("not clearly better, so the image of the rays is given")
    assert any(sweep.band_hz for sweep in result.history)


def test_a_scan_without_traces_is_not_advised():
    deaf = replace(heard(), waveform=None)
    assert "waveform" not in reconstruct(deaf, PLAN).provenance
    with pytest.raises(InvalidInput, match="for a scan without traces"):
        reconstruct(deaf, replace(PLAN, method="waveform"))


@pytest.mark.parametrize(
    ("held", "expected"),
    [([(1.0, 0.9)], True), ([(1.0, 0.95)], False), ([(1.0, 0.95), (0.5, 0.48)], True), ([(1.0, 1.1)], False)],
)
def test_improvements_of_bands_multiply(held, expected):
    image = Image(np.zeros((2, 2)), 1.0, (0.0, 0.0))
    ends = [BandEnd(image, skipped=False, history=())]
    for before, after in held:
        passes = (Evaluation(1.0, before, accepted=True), Evaluation(0.5, after, accepted=True))
        ends.append(BandEnd(image, skipped=False, history=passes))
    assert (misfit_ratio([SimpleNamespace(ends=ends)]) < CLEARLY) is expected
    assert misfit_ratio([SimpleNamespace(ends=ends[:1])]) >= CLEARLY


def test_the_note_of_a_band_counts_slices_where_there_are_several():
    record = Evaluation(0.5, 0.4, True)
    image = Image(np.ones((2, 2)), 1e-3, (0.0, 0.0))
    whole, ended = (BandEnd(image, skipped, (record,)) for skipped in (False, True))
    left_out = BandEnd(image, True, ())
    assert _band_note([]) == _band_note([whole]) == ""
    assert _band_note([ended]).startswith("stopped as the misfit rose")
    assert _band_note([ended, whole, ended]).startswith("stopped in 2 slices as the misfit rose")
    assert _band_note([left_out, left_out]).startswith("left out")
