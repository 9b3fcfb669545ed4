"""Records of a reconstruction's history for the images of a band."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..result import Iteration
from .band_inversion import Evaluation, given_by
from .waveform_settings import Band, WaveSettings


def iteration_records(
    settings: WaveSettings,
    number: int,
    history: Sequence[Evaluation],
    index: int,
    stage: int,
    *,
    over: bool,
    skipped: bool,
    speed_residual_s: float = math.nan,
) -> list[Iteration]:
    """A record for each image that was evaluated in a band.

    Args:
        settings: of the refinement.
        number: of the band, from 0.
        history: of the band.
        index: of the slice.
        stage: number of the band among all stages.
        over: whether the band is finished.
        skipped: whether the held-out misfit ended it.
        speed_residual_s: residual of the speed, s, for a band of the attenuation.
    """
    band = settings.bands[number]
    loss = band.of == "attenuation"
    given = given_by(history, by_held_out=skipped or loss) if over and history else -1
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
