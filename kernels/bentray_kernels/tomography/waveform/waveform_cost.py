"""Estimated CPU time of a refinement, and advice whether to refine."""

from collections.abc import Sequence

from ..result import EXCESS, Candidate
from .band_grid import Extent
from .validation import Validation
from .waveform_settings import Band, WaveSettings

# CPU time per node and time step of one evaluation, forward and adjoint, s; a core of 2020.
NODE_STEP_S = 2e-9

# A misfit through an image above this multiple of the misfit in water is due to the image. Through the truth
# the ratio is one to two, because traces of the object are weaker and relatively noisier.
MUCH = 3.0

# Without simulated waves: a misfit of rays above this multiple of the noise is not due to noise.
MUCH_OF_NOISE = 1.5

# Larger ones, as of a scan that claims no noise, are stored as this one.
LARGEST_EXCESS = 1000.0


def core_seconds(plan: Sequence[Band], width_m: float, record_s: float, fastest_mps: float) -> float:
    """Estimated CPU time of one slice, s.

    Args:
        plan: the bands.
        width_m: of the array, m.
        record_s: duration of a trace, s.
        fastest_mps: highest speed of a node, m/s.
    """
    seconds = 0.0
    for band in plan:
        extent = Extent.for_scan(band, 0.5 * width_m, record_s, fastest_mps)
        seconds += NODE_STEP_S * extent.padded * extent.steps * band.evaluations(WaveSettings.held_out)
    return seconds


def advice(validation: Validation, rays: Candidate, noise_s: float, minutes: float) -> dict[str, str]:
    """Entries of the provenance: whether full-waveform refinement is advised.

    Args:
        validation: of the image from rays.
        rays: the best candidate, used where the validation has no result.
        noise_s: standard deviation of the travel times, s.
        minutes: CPU time of the refinement, minutes.

    Returns:
        ``waveform``: one sentence with the CPU time; ``EXCESS``: a number, only where it is advised.
    """
    if validation.misfit is not None and validation.water is not None:
        misfit, noise, much = validation.misfit, validation.water, MUCH
        reason = f"waves through the image of rays miss held-out emitters by {misfit:.2g}"
        reason += f", those in water by {noise:.2g}"
    else:
        misfit, noise, much = rays.held_out_rms_s, noise_s, MUCH_OF_NOISE
        reason = f"rays miss held-out times by {1e9 * misfit:.0f} ns, whose noise is {1e9 * noise:.0f} ns"
    takes = "a minute" if minutes < 1.5 else f"{minutes:.0f} minutes"
    gain = misfit > much * noise
    advice = "is advised" if gain else "would gain little"
    excess = min(misfit, LARGEST_EXCESS * noise) / noise if noise else LARGEST_EXCESS
    sentence = f"method waveform {advice}, for {reason}; it takes about {takes} of a core"
    return {"waveform": sentence, **({EXCESS: f"{excess:.3g}"} if gain else {})}
