"""The kinds of simulated scans: travel times or waves, in a plane or in 3-D."""

from __future__ import annotations

from bentray_kernels.errors import InvalidInput

from .plane import SimulationSettings
from .volume import VolumeSimulationSettings
from .volume_waves import VolumeWaveSettings
from .waves import VerticalWaveSettings, WaveSimulationSettings

Simulated = SimulationSettings | VolumeSimulationSettings | WaveSimulationSettings


def kind_of(phantom: str, *, waveform: bool) -> type[Simulated]:
    """The settings of a kind of scan.

    Raises:
        InvalidInput: for a phantom through which no waves are simulated.
    """
    if not waveform:
        return VolumeSimulationSettings if phantom == "table7" else SimulationSettings
    if phantom == "detailed":
        raise InvalidInput("phantom", repr(phantom), "table6, table6-vertical or table7, with waveform true")
    return {"table6-vertical": VerticalWaveSettings, "table7": VolumeWaveSettings}.get(
        phantom, WaveSimulationSettings
    )
