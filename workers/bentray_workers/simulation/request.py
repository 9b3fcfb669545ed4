"""Request for a simulated scan: phantom, travel times or waves, resolution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from types import MappingProxyType
from typing import Any, Literal

from bentray_kernels.errors import InvalidInput
from bentray_kernels.ranges import Range, ranges_of
from bentray_kernels.request_fields import ABOVE_ZERO, Uses, check, check_used, setting

from .plane import SimulationSettings
from .volume import VolumeSimulationSettings
from .volume_waves import VolumeWaveSettings
from .waves import EMISSIONS, VerticalWaveSettings, WaveSimulationSettings

Simulated = SimulationSettings | VolumeSimulationSettings | WaveSimulationSettings

# Waves through each phantom that has them.
WAVES: Mapping[str, type[WaveSimulationSettings]] = MappingProxyType(
    {"table6": WaveSimulationSettings, "table6-vertical": VerticalWaveSettings, "table7": VolumeWaveSettings}
)

KINDS = (SimulationSettings, VolumeSimulationSettings, WaveSimulationSettings, VolumeWaveSettings)

CHOICES = {"phantom": ("table6", "table6-vertical", "detailed", "table7")}


def range_of(name: str) -> Range:
    """The range of a number over all kinds of scan; each checks its own range."""
    ranges = [ranges_of_kind[name] for ranges_of_kind in map(ranges_of, KINDS) if name in ranges_of_kind]
    return Range(
        min(within.least for within in ranges),
        max(within.most for within in ranges),
        all(within.above for within in ranges),
        all(within.below for within in ranges),
        ranges[0].unit,
    )


# When settings of some kinds of scan only have an effect.
TIMES: Uses = ({"waveform": (False,)},)
TRACES: Uses = ({"waveform": (True,)},)
VOLUMES: Uses = ({"waveform": (False,), "phantom": ("table7",)},)
NOISE: Uses = ({"snr": ABOVE_ZERO}, {"noise_s": ABOVE_ZERO})


@dataclass(frozen=True)
class PhantomScan:
    """The meaning of each setting is its metadata ``description``; those of other kinds of scan stay None.

    Raises:
        InvalidInput: naming the first field that is wrong, or belongs to another kind of scan.
    """

    phantom: Literal["table6", "table6-vertical", "detailed", "table7"] = setting(
        "table6",
        "table6: 2-D breast phantom (Li 2008, Table 6); table6-vertical: its vertical slice, half an "
        "ellipse; detailed: 2-D, with skin and glandular texture, travel times only; table7: 3-D breast "
        "phantom (Li 2008, Table 7).",
    )
    waveform: bool = setting(
        False, "Simulate waves and record traces of object and water, not travel times; of table7 in space."
    )
    nodes: int = setting(
        128, "Nodes along a side of the truth, and of the image it is meant for.", range_of("nodes")
    )
    elements: int = setting(256, "Transducers of a ring; each sends and receives.", range_of("elements"))
    coupling_mps: float = setting(1500.0, "Speed of the water, m/s.", range_of("coupling_mps"))
    snr: float | None = setting(None, "Signal over noise, as 10; none without it.", range_of("snr"))
    seed: int = setting(0, "Of the noise.", range_of("seed"), used_when=NOISE)
    refinement: int | None = setting(
        None,
        "Travel times: how many times finer their grid is, 4 by default; at least 2 in space, else 4.",
        range_of("refinement"),
        used_when=TIMES,
    )
    attenuation: bool | None = setting(None, "Travel times: record amplitudes too.", used_when=TIMES)
    noise_s: float | None = setting(
        None,
        "Travel times of a 2-D phantom: standard deviation of the noise on them, s; 0 by default.",
        range_of("noise_s"),
        used_when=({"waveform": (False,), "phantom": ("table6", "table6-vertical", "detailed")},),
    )
    slices: int | None = setting(
        None,
        "table7: heights of the ring, one node apart; 40 by default.",
        range_of("slices"),
        used_when=VOLUMES,
    )
    array: Literal["moved", "rings"] | None = setting(
        None,
        "table7: one ring moved (the default), or rings at all heights that receive each other.",
        used_when=VOLUMES,
    )
    three_d: bool | None = setting(
        None, "table7: wave fronts in space, not in each slice by itself.", used_when=VOLUMES
    )
    frequency_hz: float | None = setting(
        None,
        "Waves: middle of the pulse, Hz; 500000 by default, of table7 100000.",
        range_of("frequency_hz"),
        used_when=TRACES,
    )
    emissions: int | None = setting(
        None,
        "Waves: elements that send; 64 by default, or all if fewer.",
        range_of("emissions"),
        used_when=TRACES,
    )
    side_m: float | None = setting(
        None,
        "Waves: side of the square with phantom and ring, m; 0.12 by default.",
        range_of("side_m"),
        used_when=TRACES,
    )

    def __post_init__(self) -> None:
        check(self, CHOICES)
        check_used(self)
        self.chosen()

    def chosen(self) -> Simulated:
        """The settings of the scan, with defaults for absent ones."""
        kind: type[Simulated] = SimulationSettings
        if self.waveform and self.phantom == "detailed":
            raise InvalidInput(
                "phantom", repr(self.phantom), "table6, table6-vertical or table7, with waveform true"
            )
        if self.waveform:
            kind = WAVES[self.phantom]
        elif self.phantom == "table7":
            kind = VolumeSimulationSettings
        accepted = {field.name for field in fields(kind)}
        values = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.name in accepted and getattr(self, field.name) is not None
        }
        if "emissions" in accepted and self.elements is not None:
            values.setdefault("emissions", min(EMISSIONS, self.elements))
        return kind(**values)

    def plain(self) -> dict[str, Any]:
        """All settings of this scan as JSON values, which give the same scan again."""
        values = {name: value for name, value in asdict(self.chosen()).items() if value is not None}
        return {**values, "phantom": self.phantom, "waveform": self.waveform}
