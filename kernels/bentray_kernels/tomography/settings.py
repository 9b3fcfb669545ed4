"""The settings of a reconstruction: nested frozen records with the description and range of every setting."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from typing import Any, ClassVar, Literal

from ..errors import InvalidInput
from ..requests.limits import LEFT_OUT, MAX_LEFT_OUT, SPEED_MPS, WATER_C, check_speeds
from ..requests.names import DEFAULT_PICKER, PickerName, SolverName
from ..requests.ranges import Range
from ..requests.request_fields import ABOVE_ZERO, Uses, check, declared, setting
from .numerics import Numerics

# The wave front of the compiled pass over a slice; see ``eikonal.deviation``.
DEVIATION = "deviation"

MIN_NODES = 16
# What a speed may be, as JSON Schema says it.
SPEED = {"type": "number", **SPEED_MPS.schema}
# What holds before the scan is known.
AUTOMATIC = Numerics()
# When a setting has an effect: auto tries Gauss-Newton, and waveform begins with the image of auto.
GAUSS_NEWTON = ("gauss-newton", "auto", "waveform")
LOSSES = {"attenuation": (True,), "scan_amplitudes": (True,)}
ECHOES: Uses = ({"reflection": (True,)},)
# The compiled pass of SART over a slice exists for devices, full waveforms and reflection.
_SLICES = {"method": ("sart", "auto"), "decomposition": (None, "slices")}
ON_DEVICES: Uses = (
    {**_SLICES, "eikonal": (DEVIATION,)},
    {**_SLICES, "rays": ("straight",)},
    {"method": ("waveform",)},
    {"method": ("auto",), "minutes": ABOVE_ZERO},
    *ECHOES,
)


class Checked:
    """A record of settings, whose fields are checked against their choices and ranges."""

    # No unknown names in JSON.
    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}
    # Its name in the record that holds it, for errors.
    PLACE: ClassVar[str] = ""

    def __post_init__(self) -> None:
        check(self, place=self.PLACE)


@dataclass(frozen=True)
class GaussNewtonSettings(Checked):
    """Gauss–Newton: all emitters at once, with a penalty on the image."""

    PLACE: ClassVar[str] = "gauss_newton"

    penalty_strength: float = setting(
        0.3,
        "Weight of the penalty relative to the rms residual; 0 for none. The attenuation, by either method, "
        "is regularised by it as well.",
        Range(0.0, 10.0),
        label="Strength of the penalty",
        used_when=(
            {"method": GAUSS_NEWTON},
            LOSSES,
        ),
    )


@dataclass(frozen=True)
class PickingSettings(Checked):
    """Travel times from traces, where only traces were recorded."""

    PLACE: ClassVar[str] = "picking"

    picker: PickerName = setting(  # noqa: RUF009 - a string, by its alias
        DEFAULT_PICKER,
        "How the first arrival of a trace is picked.",
        label="Picker",
        used_when=({"scan_picks": (True,)},),
    )
    examine: bool = setting(
        True,
        "Check the quality of the scan first: swapped or inverted channels and a wrong time zero are "
        "corrected, dead elements, broken traces and contradicting times are left out, and the result states "
        "both. An unusable scan is rejected.",
        label="Check the scan first",
    )
    max_left_out: float = setting(
        MAX_LEFT_OUT,
        "Largest share of the pairs that the check may leave out; a scan of which more is left out is "
        "rejected. 1: whatever is left is used.",
        LEFT_OUT,
        label="Pairs that may be left out",
        used_when=({"examine": (True,)},),
    )


@dataclass(frozen=True)
class AttenuationSettings(Checked):
    """Attenuation, reconstructed along the rays of the speed image; experimental."""

    PLACE: ClassVar[str] = "attenuation"

    enabled: bool = setting(
        True,
        "Reconstruct the attenuation too (experimental), where there are amplitudes; with method waveform "
        "from the traces.",
        label="Reconstruct the attenuation",
    )
    amplitudes: Literal["recorded", "ratio", "spectrum"] = setting(
        "recorded",
        "recorded: amplitudes of the file; ratio: read from the traces, height of the first pulse relative "
        "to water; spectrum: read from the traces, loss of high frequencies relative to low ones.",
        label="Amplitudes",
        words={"recorded": "Recorded", "ratio": "Pulse height", "spectrum": "Spectrum"},
        used_when=({"attenuation": (True,)},),
    )


@dataclass(frozen=True)
class ReflectionSettings(Checked):
    """Reflection image: delay and sum of echoes along the rays of the speed image."""

    PLACE: ClassVar[str] = "reflection"

    enabled: bool = setting(
        False,
        "Also make a reflection image of each slice from the traces: echoes of all pairs, delayed by their "
        "travel times along bent rays and summed.",
        label="Make a reflection image",
    )


def _record(label: str, description: str) -> dict[str, Any]:
    """The metadata of a record of settings."""
    return {"description": description, "json_schema_extra": {"x-label": label}}


@dataclass(frozen=True)
class Settings(Checked):
    """How an image is reconstructed. Each field's metadata holds its description, range and choices.

    What is not here is decided automatically, see ``numerics``.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted.
    """

    method: Literal["sart", "gauss-newton", "auto", "waveform"] = setting(
        "auto",
        "auto: method, rays and coarser grids are chosen by held-out validation; sart: one emitter after the "
        "other; gauss-newton: all emitters at once, regularised; waveform: full-waveform refinement of the "
        "image of auto, for slices with traces.",
        label="Method",
        basic=True,
        words={
            "auto": "Automatic (recommended)",
            "sart": "SART",
            "gauss-newton": "Gauss-Newton",
            "waveform": "Full waveform",
        },
    )
    rays: Literal["curved", "straight"] = setting(
        "curved",
        "curved: corrected for refraction; straight: without refraction. Method auto compares both, unless "
        "straight is requested.",
        label="Rays",
        basic=True,
        words={"curved": "Bent", "straight": "Straight"},
    )
    eikonal: SolverName = setting(  # noqa: RUF009 - a string, by its alias
        DEVIATION,
        "Eikonal solver for bent rays. deviation is for SART on slices; elsewhere accurate replaces it.",
        label="Eikonal solver",
        used_when=({"rays": ("curved",)}, {"uncertainty": (True,)}),
    )
    decomposition: Literal["slices", "volume"] | None = setting(
        None,
        "slices: each height of the ring by itself; volume: all heights together, in 3-D.",
        unset="volume for elements in 3-D that are not rings at several heights, else slices",
        label="Decomposition",
        words={"slices": "Slices", "volume": "Volume"},
    )
    opening_angle_deg: float | None = setting(
        None,
        "Full opening angle of the elements about their directions (geometry/element_normal), degrees: pairs "
        "whose path leaves this cone at either end are left out.",
        Range(0.0, 180.0, above=True, unit="degrees"),
        unset="every direction",
        label="Opening angle",
        unit="degrees",
    )
    water_temperature_c: float | None = setting(
        None,
        "Temperature of the water, °C, in place of that of the scan; its speed of sound follows (Marczak "
        "1997). The file stays as it is, and the result states both.",
        WATER_C,
        unset="as the scan states it",
        label="Water temperature",
        basic=True,
        unit="°C",
    )
    nodes: int | None = setting(
        None,
        "Nodes along each side of the image.",
        Range(MIN_NODES, 2048),
        unset="from the width of the array, the pitch of its elements and the wavelength",
        label="Nodes per side",
        basic=True,
    )
    side_m: float | None = setting(
        None,
        "Side of the image, m.",
        Range(1e-4, 100.0, unit="m"),
        unset="the array and a margin",
        label="Side of the image",
        unit="m",
    )
    iterations: int = setting(
        5,
        "Iterations, each over all emitters. gauss-newton stops earlier once nothing is gained.",
        Range(1, 1000),
        label="Iterations",
    )
    speed_bounds_mps: tuple[float, float] = setting(
        (1300.0, 1800.0),
        "Lowest and highest speed of a node, m/s.",
        schema={"prefixItems": [SPEED, SPEED]},
        label="Speed bounds",
        unit="m/s",
    )
    roi: bool = setting(
        False,
        "Only the region of interest of the file may change (mask/roi).",
        label="Region of interest only",
    )
    device: Literal["auto", "cpu", "opencl"] = setting(
        "auto",
        "Where SART of slices, full waveforms and reflection are computed. auto: on an OpenCL device if it "
        "was faster in a timing trial on this machine; cpu: in compiled code; opencl: on a device, many "
        "slices or emitters at a time. The images differ by rounding; the result states which was used.",
        label="Compute on",
        words={"auto": "Automatic", "cpu": "Processor", "opencl": "OpenCL device"},
        used_when=ON_DEVICES,
        neutral=("cpu",),
    )
    resolution_check: bool = setting(
        False,
        "Also reconstruct a checkerboard along the same rays, and report its recovery at each node.",
        label="Resolution check",
    )
    uncertainty: bool | None = setting(
        None,
        "Also estimate the standard deviation of the speed at each node, and the resolution width of the "
        "image. Images by rays: from the misfit along bent rays and the differences of pairs measured both "
        "ways. Full waveforms: from two more inversions, each with half of the emitters, in about as much "
        "time again.",
        unset="yes for slices by auto or gauss-newton with bent rays, where it is cheap; else no",
        label="Uncertainty",
        basic=True,
    )
    minutes: float | None = setting(
        None,
        "Time budget of full-waveform refinement, minutes of one processor core: it sets how many bands of "
        "frequency are used and, below that, how many emitters. auto refines its image only within a budget, "
        "and keeps the refined image if it predicts held-out emitters clearly better.",
        Range(0.0, 1e6, unit="minutes"),
        unset="waveform: no limit; auto: no refinement",
        label="Time for full waveforms",
        basic=True,
        unit="minutes of one core",
        used_when=({"method": ("auto", "waveform"), "scan_traces": (True,)},),
    )
    gauss_newton: GaussNewtonSettings = field(
        default=GaussNewtonSettings(),
        metadata=_record("Gauss-Newton", "For gauss-newton, and the attenuation."),
    )
    picking: PickingSettings = field(
        default=PickingSettings(), metadata=_record("Picking", "For scans with traces.")
    )
    attenuation: AttenuationSettings = field(
        default=AttenuationSettings(),
        metadata=_record("Attenuation", "For scans with amplitudes or traces; experimental."),
    )
    reflection: ReflectionSettings = field(
        default=ReflectionSettings(),
        metadata=_record("Reflection", "For scans with traces; slices."),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_speeds("speed_bounds_mps", self.speed_bounds_mps)
        if self.method == "waveform" and self.decomposition == "volume":
            raise InvalidInput("decomposition", "'volume'", "slices, with method waveform")
        if self.reflection.enabled and self.decomposition == "volume":
            raise InvalidInput("decomposition", "'volume'", "slices, with reflection")

    @classmethod
    def from_values(cls, **values: Any) -> Settings:
        """The default settings with some values changed, see ``changed``."""
        return Settings().changed(**values)

    def changed(self, **values: Any) -> Settings:
        """These settings with some values changed.

        Args:
            values: by the name of the setting, whatever record it is in (``picker="threshold"`` for
                ``picking.picker``, ``attenuation=False`` for ``attenuation.enabled``), by the name of a
                record, or by that of a numerical parameter (see ``Numerics``) to fix it.

        Raises:
            TypeError: for a name that is none of these.
            InvalidInput: as the records.
        """
        own = {name: getattr(self, name) for name in PUBLIC}
        inner: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            record, _, leaf = PLACES.get(name, "").rpartition(".")
            if name in NUMERICAL:
                inner.setdefault("numerics", {})[name] = value
            elif record and not is_dataclass(value):
                inner.setdefault(record, {})[leaf] = value
            else:
                own[name] = value
        fixed = inner.pop("numerics", {})
        numerics = replace(self.numerics, **fixed) if fixed else self.numerics
        for record, changes in inner.items():
            own[record] = replace(own[record], **changes)
        return Settings(**own) if numerics == AUTOMATIC else FixedSettings(**own, numerics=numerics)

    @property
    def numerics(self) -> Numerics:
        """The numerical parameters that hold before the scan is known."""
        return AUTOMATIC

    @property
    def grid_nodes(self) -> int:
        """Nodes along each side of the image, once they are known.

        Raises:
            ValueError: before ``settled`` has set them.
        """
        if self.nodes is None:
            raise ValueError("the number of nodes is not set yet")
        return self.nodes

    @property
    def selects_model(self) -> bool:
        """Whether rays and method are chosen by held-out validation."""
        return self.method in ("auto", "waveform")

    @property
    def estimates_uncertainty(self) -> bool:
        """Whether an image by rays has standard deviations."""
        if self.uncertainty is not None:
            return self.uncertainty
        slices = self.decomposition != "volume"
        return slices and self.method in ("auto", "gauss-newton") and self.rays == "curved"

    @property
    def reads_amplitudes(self) -> bool:
        """Whether amplitudes are read from traces."""
        return self.attenuation.enabled and self.attenuation.amplitudes != "recorded"

    @property
    def ray_eikonal(self) -> str:
        """The method of ``bentray_kernels.eikonal`` where rays are traced one by one.

        In blocks times are computed by fast sweeping: no other method has them.
        """
        if self.eikonal != DEVIATION:
            return self.eikonal
        return "accurate" if self.numerics.blocks == 1 else "fsm"

    def to_dict(self) -> dict[str, Any]:
        """Plain nested values for JSON, without ``numerics``; ``from_stored`` reads them."""
        return {name: value for name, value in asdict(self).items() if name in PUBLIC}


@dataclass(frozen=True)
class FixedSettings(Settings):
    """Settings with some numerical parameters fixed; made by ``Settings.changed``, never from JSON."""

    numerics: Numerics = field(default=AUTOMATIC)

    def __post_init__(self) -> None:
        super().__post_init__()
        fixed = self.numerics
        if fixed.coarser_grids and self.nodes and self.nodes >> fixed.coarser_grids < MIN_NODES:
            accepted = f"few enough that the coarsest of {self.nodes} nodes has {MIN_NODES}"
            raise InvalidInput("coarser_grids", fixed.coarser_grids, accepted)
        if fixed.focusing and self.attenuation.amplitudes == "spectrum":
            raise InvalidInput("focusing", True, "false, with amplitudes spectrum, which it does not change")
        if fixed.ray_width_m > 0.0 and self.method != "gauss-newton":
            raise InvalidInput("ray_width_m", fixed.ray_width_m, "0, unless method is gauss-newton")


PUBLIC = tuple(field.name for field in fields(Settings))
NUMERICAL = tuple(field.name for field in fields(Numerics))
# Where each setting is, by the name that is its own: ``picker`` is ``picking.picker``.
PLACES = {name: setting.place for name, setting in declared(Settings).items()}
