"""The images of a band as records of a reconstruction's history."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..result import Sweep
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
    kept_s: float = math.nan,
) -> list[Sweep]:
    """A record for each image that was evaluated in a band.

    Args:
        settings: how it is refined.
        number: of the band, from 0.
        history: of the band.
        index: of the slice.
        stage: number of the band among all stages.
        over: whether the band is.
        skipped: whether held-out emitters ended it.
        kept_s: residual of the speed, s, which a band of the attenuation leaves as it is.
    """
    band = settings.bands[number]
    loss = band.of == "attenuation"
    given = given_by(history, judged=skipped or loss) if over and history else -1
    return [
        Sweep(
            index,
            k + 1,
            kept_s if loss else shift_s(record.misfit, band),
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
    """The shift of a wave in the middle of a band that has this misfit, s; half a period at most.

    Of two waves that differ by a phase alone, one minus the correlation is one minus its cosine, and so is
    half the energy of their difference over that of one.
    """
    return math.acos(max(1.0 - misfit, -1.0)) / (math.pi * (band.low_hz + band.high_hz))
