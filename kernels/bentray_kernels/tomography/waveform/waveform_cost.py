"""CPU time of a refinement, and advice whether it is worth it, both before it starts."""

from __future__ import annotations

from collections.abc import Sequence

from ..result import Trial
from .band_grid import Extent
from .validation import Validation
from .waveform_settings import Band, WaveSettings

# Seconds per node and time step of one evaluation, forward and adjoint, all included; a core of 2020.
NODE_STEP_S = 4e-9

# A misfit through an image that is so many times the misfit in water is due to the image. Through the
# truth it is one to two times, for traces of the object are weaker and noise counts more on them.
MUCH = 3.0

# Without simulated waves: a misfit of rays that is so many times the noise is not noise.
MUCH_OF_NOISE = 1.5


def core_seconds(plan: Sequence[Band], width_m: float, record_s: float, fastest_mps: float) -> float:
    """About how long a core works on one slice, s.

    Args:
        plan: the bands.
        width_m: of the array, m.
        record_s: from the first sample of a trace to the last, s.
        fastest_mps: speed that a node may take at most, m/s.
    """
    found = 0.0
    for band in plan:
        extent = Extent.of(band, 0.5 * width_m, record_s, fastest_mps)
        found += NODE_STEP_S * extent.padded**2 * extent.steps * band.evaluations(WaveSettings.held_out)
    return found


def advice(validation: Validation, rays: Trial, noise_s: float, minutes: float) -> str:
    """One sentence: whether waves are advised after rays, and what they take.

    Args:
        validation: of the image of the rays.
        rays: the trial with the best ones, for where waves say nothing.
        noise_s: standard deviation of the travel times, s.
        minutes: that a core would work on waves.
    """
    if validation.misfit is not None and validation.water is not None:
        gain = validation.misfit > MUCH * validation.water
        found = f"waves through the image of rays miss held-out emitters by {validation.misfit:.2g}"
        found += f", those in water by {validation.water:.2g}"
    else:
        gain = rays.held_out_rms_s > MUCH_OF_NOISE * noise_s
        found = f"rays miss held-out times by {1e9 * rays.held_out_rms_s:.0f} ns"
        found += f", whose noise is {1e9 * noise_s:.0f} ns"
    takes = "a minute" if minutes < 1.5 else f"{minutes:.0f} minutes"
    advice = "is advised" if gain else "would gain little"
    return f"method waveform {advice}, for {found}; it takes about {takes} of a core"
