"""Request for a simulated scan: phantom, travel times or waves, resolution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from bentray_kernels.requests.limits import SPEED_MPS
from bentray_kernels.requests.ranges import SEED
from bentray_kernels.requests.request_fields import ABOVE_ZERO, Uses, check, check_used, setting

from . import ranges

if TYPE_CHECKING:
    from .kinds import Simulated

# When settings of some kinds of scan only have an effect.
TIMES: Uses = ({"waveform": (False,)},)
TRACES: Uses = ({"waveform": (True,)},)
VOLUMES: Uses = ({"waveform": (False,), "phantom": ("table7",)},)
NOISE: Uses = ({"snr": ABOVE_ZERO}, {"noise_s": ABOVE_ZERO})

# The sample scan of the page, of `bentray demo` and of the README: traces of a ring of 12 cm in warm water.
# Bent rays show its lesions within seconds, full waveforms within half a minute.
SAMPLE: Mapping[str, Any] = MappingProxyType(
    {
        "phantom": "breast",
        "waveform": True,
        "nodes": 128,
        "elements": 72,
        "emissions": 18,
        "coupling_mps": 1520.0,
        "frequency_hz": 2.5e5,
        "side_m": 0.12,
        "snr": 30.0,
    }
)


@dataclass(frozen=True)
class PhantomScan:
    """The meaning of each setting is its metadata ``description``; those of other kinds of scan stay None.

    Raises:
        InvalidInput: naming the first field that is wrong, or belongs to another kind of scan.
    """

    phantom: Literal["table6", "table6-vertical", "detailed", "breast", "table7"] = setting(
        "table6",
        "table6: 2-D breast phantom (Li 2008, Table 6); table6-vertical: its vertical slice, half an "
        "ellipse; detailed: 2-D, with skin and glandular texture; breast: the same with large lesions, fast "
        "and slow; table7: 3-D breast phantom (Li 2008, Table 7).",
    )
    waveform: bool = setting(
        False, "Simulate waves and record traces of object and water, not travel times; table7: in 3-D."
    )
    nodes: int = setting(
        128, "Nodes along a side of the truth, and of the image that the scan is made for.", ranges.NODES
    )
    elements: int = setting(256, "Transducers of a ring; each emits and receives.", ranges.ELEMENTS)
    coupling_mps: float = setting(1500.0, "Speed of the water, m/s.", SPEED_MPS)
    snr: float | None = setting(
        None,
        "Signal-to-noise ratio of times and amplitudes, or of traces, such as 10.",
        ranges.SNR,
        unset="no noise",
    )
    seed: int = setting(0, "Seed of the noise.", SEED, used_when=NOISE)
    refinement: int | None = setting(
        None,
        "Travel times: refinement of the simulation grid over the image grid; in 3-D at least 2, else 4.",
        ranges.REFINEMENT,
        unset="4",
        used_when=TIMES,
    )
    attenuation: bool | None = setting(
        None, "Travel times: record amplitudes too.", unset="no", used_when=TIMES
    )
    noise_s: float | None = setting(
        None,
        "2-D phantoms: standard deviation of the travel-time noise, s.",
        ranges.NOISE_S,
        unset="0",
        used_when=({"waveform": (False,), "phantom": ("table6", "table6-vertical", "detailed", "breast")},),
    )
    slices: int | None = setting(
        None,
        "table7: number of ring heights, one node apart.",
        ranges.SLICES,
        unset="40",
        used_when=VOLUMES,
    )
    array: Literal["moved", "rings"] | None = setting(
        None,
        "table7: one moving ring, or rings at all heights that receive each other.",
        unset="moved",
        used_when=VOLUMES,
    )
    three_d: bool | None = setting(
        None,
        "table7: 3-D wave fronts instead of one slice at a time.",
        unset="no",
        used_when=VOLUMES,
    )
    frequency_hz: float | None = setting(
        None,
        "Waves: centre frequency, Hz.",
        ranges.FREQUENCY_HZ,
        unset="500000, table7 100000",
        used_when=TRACES,
    )
    emissions: int | None = setting(
        None,
        "Waves: number of emitting elements.",
        ranges.EMISSIONS,
        unset="64, or all if fewer",
        used_when=TRACES,
    )
    side_m: float | None = setting(
        None,
        "Waves: side of the square with phantom and ring, m.",
        ranges.SIDE_M,
        unset="0.12",
        used_when=TRACES,
    )

    def __post_init__(self) -> None:
        check(self)
        check_used(self)
        self.chosen()

    def chosen(self) -> Simulated:
        """The settings of the scan, with defaults for absent ones."""
        # These load compiled kernels, which the help of the command line does without.
        from .kinds import kind_of

        kind = kind_of(self.phantom, waveform=self.waveform)
        accepted = {field.name for field in fields(kind)}
        values = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.name in accepted and getattr(self, field.name) is not None
        }
        if "emissions" in accepted and self.elements is not None:
            values.setdefault("emissions", min(ranges.DEFAULT_EMISSIONS, self.elements))
        return kind(**values)

    def plain(self) -> dict[str, Any]:
        """All settings of this scan as JSON values, which give the same scan again."""
        values = {name: value for name, value in asdict(self.chosen()).items() if value is not None}
        return {**values, "phantom": self.phantom, "waveform": self.waveform}
