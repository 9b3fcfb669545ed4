"""The kinds of simulated scans: travel times or waves, in a plane or in 3-D."""

from collections.abc import Mapping
from types import MappingProxyType

from .plane import SimulationSettings
from .volume import VolumeSimulationSettings
from .volume_waves import VolumeWaveSettings
from .waves import BreastWaveSettings, DetailedWaveSettings, VerticalWaveSettings, WaveSimulationSettings

Simulated = SimulationSettings | VolumeSimulationSettings | WaveSimulationSettings

WAVES: Mapping[str, type[WaveSimulationSettings]] = MappingProxyType(
    {
        "table6": WaveSimulationSettings,
        "table6-vertical": VerticalWaveSettings,
        "detailed": DetailedWaveSettings,
        "breast": BreastWaveSettings,
        "table7": VolumeWaveSettings,
    }
)


def kind_of(phantom: str, *, waveform: bool) -> type[Simulated]:
    """The settings of a kind of scan."""
    if not waveform:
        return VolumeSimulationSettings if phantom == "table7" else SimulationSettings
    return WAVES[phantom]
