"""Records of a reconstruction's history for the images of a band."""

import math
from collections.abc import Sequence

from ..result import Iteration
from .band_inversion import Evaluation
from .waveform_settings import Band


def iteration_records(
    band: Band, history: Sequence[Evaluation], index: int, stage: int, given: int, speed_residual_s: float
) -> list[Iteration]:
    """A record for each image that was evaluated in a band.

    Args:
        band: the band.
        history: of the band.
        index: of the slice.
        stage: number of the band among all stages.
        given: index of the image that the band returned; -1 while it is not finished.
        speed_residual_s: residual of the speed, s, for a band of the attenuation.
    """
    loss = band.of == "attenuation"
    return [
        Iteration(
            index,
            k + 1,
            speed_residual_s if loss else shift_s(record.misfit, band),
            band.emitters,
            stage,
            given=k == given,
            band_hz=(band.low_hz, band.high_hz),
            misfit=record.misfit,
            held_out_misfit=None if math.isnan(record.held) else record.held,
            of_attenuation=loss,
        )
        for k, record in enumerate(history)
    ]


def shift_s(misfit: float, band: Band) -> float:
    """The time shift of a wave at the middle of a band that causes this misfit, s; at most half a period.

    For two waves that differ in phase alone, one minus the correlation is one minus the cosine of the phase,
    as is half the energy of their difference over that of one wave.
    """
    return math.acos(max(1.0 - misfit, -1.0)) / (math.pi * (band.low_hz + band.high_hz))
