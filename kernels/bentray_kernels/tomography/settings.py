"""The settings of a reconstruction: one frozen record that a job stores and a result repeats."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar, Literal

from ..acquisition import PICKERS
from ..eikonal import methods
from ..errors import InvalidInput
from ..limits import SPEED_MPS
from ..ranges import SEED, Range, check_ranges, ranged

METHODS = ("sart", "gauss-newton", "auto", "waveform")
RAYS = ("curved", "straight")

# The wave front of the compiled pass over a slice; see ``eikonal.deviation``.
DEVIATION = "deviation"

DECOMPOSITIONS = ("slices", "volume")
PENALTIES = ("total-variation", "laplacian", "tikhonov")
SPEED_UPDATES = ("fixed", "data-driven")
AMPLITUDES = ("recorded", "ratio", "spectrum")
LEAST_NODES = 16
# What a speed may be, as JSON Schema says it.
SPEED = {"type": "number", **SPEED_MPS.schema}
WAVE_BANDS = 4


@dataclass(frozen=True)
class Settings:
    """How to reconstruct the speed image.

    Attributes:
        method: ``sart`` uses one emitter after the other (chapter 6); ``gauss-newton`` all at once, with bent
            rays and a penalty; ``auto`` tries several on part of the pairs and takes the one that predicts
            the others best, see ``model_selection``; ``waveform`` does so too, and then refines that image
            until the traces that waves through it would make agree with those recorded. It needs slices
            with traces of object and water; its image has the finest grid that its waves ask for, ``nodes``
            is that of the rays.
        rays: ``curved`` traces down the travel time of the current image; ``straight`` ignores refraction.
        eikonal: the wave-front method for curved rays: ``deviation``, made for slices, or one of
            ``bentray_kernels.eikonal.methods()``. Where ``deviation`` does not serve, which is in volumes,
            for ``gauss-newton`` and the attenuation, ``accurate`` stands in for it.
        decomposition: ``slices`` reconstructs each height of the ring by itself; ``volume`` all in space.
        axial_room_nodes: in a volume, how far above and below an emitter and its receivers the wave front is
            tracked, nodes; None: everywhere. Fast skin can guide first arrivals far out of a ring's plane.
        nodes: nodes along each side of the square image.
        side_m: side of the image, m; None: the array with a margin.
        sweeps: how often every emitter is used; ``gauss-newton`` ends sooner once nothing is gained.
        straight_sweeps: sweeps along straight rays that curved ones begin from.
        coarser_grids: grids of half as many nodes each that are gone through first.
        stop_rms_s: stop once the rms of the receiver misfit is below this, s (discrepancy principle).
        speed_bounds_mps: (lowest, highest) speed a node may take, m/s.
        speed_update: for SART; ``fixed`` propagates in the reconstructed speed as it is (chapter 6,
            equation 5); ``data-driven`` stretches it to ``speed_range_mps`` first (equation 6).
        speed_range_mps: (lowest, highest) speed known to be in the object, m/s; for ``data-driven``.
        front_smoothing_nodes: standard deviation, nodes, of a Gaussian on the speed that the wave front runs
            in, which bends rays as a band-limited wave would; 0: none.
        ray_width_m: of ``gauss-newton``: standard deviation of the Gaussian across a ray under which its time
            sees the slowness, m; 0: thin rays. Waves see about a wavelength so; the ray then bends in what
            twice the width leaves, unless ``front_smoothing_nodes`` says otherwise, and the image is what
            the penalty makes of it. ``auto`` sets it by the scan's frequency.
        relaxation: the λ of SART (chapter 6, equation 1), in (0, 2).
        relaxation_decay: what λ is multiplied by after each sweep, in (0, 1].
        subset: emitters that make one update of SART together.
        smoothing_nodes: standard deviation, nodes, of the Gaussian applied to each update of SART; 0: none.
        seed: seed of the random emitter order of SART.
        penalty: of ``gauss-newton``: ``total-variation`` keeps edges, ``laplacian`` prefers smooth images,
            ``tikhonov`` ones near to the iteration's start.
        penalty_strength: of the penalty, and of the attenuation's total variation, over the rms misfit;
            0: none. Attenuation from traces is as smooth as waves are wide, by more or less of it too.
        edge_mps: with total variation, speeds that differ by much more than this from node to node cost
            little more for differing further: images become flat parts with sharp edges. For objects that are
            such, as phantoms; 0: every difference costs.
        huber_spreads: residuals beyond this count in proportion to their size, not to its square, for
            ``gauss-newton`` and the attenuation after it, in standard deviations of the residuals, which
            their median tells: rays that no image explains do not decide; 0: none.
        roi: let only the dataset's region of interest change (``mask/roi``).
        reciprocity: use a missing pair's reverse (emitter and receiver exchanged) in its place.
        picker: how travel times are read where only traces were uploaded.
        examine: before that, put swapped channels, inverted ones and a wrong time zero right, leave dead
            elements and broken traces out, and after it times that others contradict; see
            ``acquisition.quality``. A scan that must not be used is refused. It says what it found.
        guided_rounds: how often, where only traces were uploaded, times are read again about those that the
            image of the rays predicts; fewer once they stay. For slices; see ``guided_picking``.
        attenuation: reconstruct it too, where there are amplitudes; with ``waveform`` from the traces,
            once the speed is refined. Experimental there.
        amplitudes: where they come from: ``recorded`` takes those of the file (``amplitude/log_ratio_np``);
            ``ratio`` reads from the traces how much lower the first pulse is than in water; ``spectrum`` how
            much more its high frequencies have lost than its low ones, which focusing and spreading leave
            alone, but which only loss in proportion to the frequency shows. See
            ``acquisition.picking.amplitudes``.
        focusing: take off the amplitudes what refraction does to them, by the spreading of ray tubes in the
            speed image; needs its frequency (``amplitude@frequency_hz``). Experimental.
        resolution_check: also tell how much of a checkerboard the rays recover, node by node.
        wave_bands: of ``waveform``, how many of the bands of frequency are gone through, from the lowest; the
            last two of the four take nearly all of the time.
        wave_emitters: of ``waveform``, how many are drawn in each band, other ones in each; 0: 32 or 40.
        wave_minutes: of ``auto``, how long a core may work on ``waveform``. Where the scan has what that
            needs and the estimate is not above it, waves follow the rays, and their image is given if it
            predicts emitters that were held out clearly better. Else ``auto`` only says whether they are
            advised.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    method: Literal["sart", "gauss-newton", "auto", "waveform"] = "sart"
    rays: Literal["curved", "straight"] = "curved"
    eikonal: str = field(default=DEVIATION, metadata={"json_schema_extra": {"enum": [DEVIATION, *methods()]}})
    decomposition: Literal["slices", "volume"] = "slices"
    axial_room_nodes: int | None = ranged(None, Range(2, 4096))
    nodes: int = ranged(128, Range(LEAST_NODES, 2048))
    side_m: float | None = ranged(None, Range(1e-4, 100.0, unit="m"))
    sweeps: int = ranged(5, Range(1, 1000))
    straight_sweeps: int = ranged(0, Range(0, 1000))
    coarser_grids: int = ranged(0, Range(0, 6))
    stop_rms_s: float = ranged(0.0, Range(0.0, 1.0, unit="s"))
    speed_bounds_mps: tuple[float, float] = field(
        default=(1300.0, 1800.0), metadata={"json_schema_extra": {"prefixItems": [SPEED, SPEED]}}
    )
    speed_update: Literal["fixed", "data-driven"] = "fixed"
    speed_range_mps: tuple[float, float] | None = None
    front_smoothing_nodes: float = ranged(0.0, Range(0.0, 32.0))
    ray_width_m: float = ranged(0.0, Range(0.0, 0.1, unit="m"))
    relaxation: float = ranged(0.1, Range(0.0, 2.0, above=True, below=True))
    relaxation_decay: float = ranged(1.0, Range(0.0, 1.0, above=True))
    subset: int = ranged(1, Range(1, 4096))
    smoothing_nodes: float = ranged(1.0, Range(0.0, 32.0))
    seed: int = ranged(0, SEED)
    penalty: Literal["total-variation", "laplacian", "tikhonov"] = "total-variation"
    penalty_strength: float = ranged(0.3, Range(0.0, 10.0))
    edge_mps: float = ranged(0.0, Range(0.0, 1000.0, unit="m/s"))
    huber_spreads: float = ranged(3.0, Range(0.0, 100.0))
    roi: bool = False
    reciprocity: bool = True
    picker: Literal["aic", "threshold", "energy-ratio", "sta-lta", "correlation", "matched"] = "aic"
    examine: bool = True
    guided_rounds: int = ranged(0, Range(0, 10))
    attenuation: bool = True
    amplitudes: Literal["recorded", "ratio", "spectrum"] = "recorded"
    focusing: bool = False
    resolution_check: bool = False
    wave_bands: int = ranged(4, Range(1, WAVE_BANDS))
    wave_emitters: int = ranged(0, Range(0, 4096))
    wave_minutes: float = ranged(0.0, Range(0.0, 1e6))

    def __post_init__(self) -> None:
        check_ranges(self)
        _one_of("method", self.method, METHODS)
        _one_of("rays", self.rays, RAYS)
        _one_of("eikonal", self.eikonal, (DEVIATION, *methods()))
        _one_of("speed_update", self.speed_update, SPEED_UPDATES)
        _one_of("picker", self.picker, tuple(PICKERS))
        _one_of("decomposition", self.decomposition, DECOMPOSITIONS)
        _one_of("penalty", self.penalty, PENALTIES)
        _one_of("amplitudes", self.amplitudes, AMPLITUDES)
        if self.amplitudes == "spectrum" and self.focusing:
            raise InvalidInput("focusing", True, f"false: there is none in amplitudes {self.amplitudes}")
        _speeds("speed_bounds_mps", self.speed_bounds_mps)
        if self.speed_range_mps is not None:
            _speeds("speed_range_mps", self.speed_range_mps)
        if self.method != "sart" and self.speed_update != "fixed":
            raise InvalidInput("speed_update", repr(self.speed_update), f"fixed, with method {self.method}")
        if self.speed_range_mps is None and self.speed_update == "data-driven":
            raise InvalidInput(
                "speed_range_mps", None, "(lowest, highest) in m/s, since speed_update is data-driven"
            )
        if self.method == "waveform" and self.decomposition == "volume":
            raise InvalidInput("decomposition", "'volume'", "slices, with method waveform")
        if self.guided_rounds and self.decomposition == "volume":
            raise InvalidInput("guided_rounds", self.guided_rounds, "0, with decomposition volume")
        if self.coarser_grids and self.nodes >> self.coarser_grids < LEAST_NODES:
            accepted = f"few enough that the coarsest of {self.nodes} nodes has {LEAST_NODES}"
            raise InvalidInput("coarser_grids", self.coarser_grids, accepted)
        if self.ray_width_m > 0.0 and self.method != "gauss-newton":
            raise InvalidInput("ray_width_m", self.ray_width_m, "0, unless method is gauss-newton")

    @property
    def tries(self) -> bool:
        """Whether rays and method are chosen by trials."""
        return self.method in ("auto", "waveform")

    @property
    def listens(self) -> bool:
        """Whether amplitudes are read from traces."""
        return self.attenuation and self.amplitudes != "recorded"

    @property
    def front(self) -> str:
        """The method of ``bentray_kernels.eikonal`` that the settings ask for where rays are traced."""
        return "accurate" if self.eikonal == DEVIATION else self.eikonal

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; ``Settings(**settings.to_dict())`` gives the same settings."""
        return asdict(self)


def _one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InvalidInput(name, repr(value), "one of " + ", ".join(known))


def _speeds(name: str, pair: tuple[float, float]) -> None:
    slowest, fastest = SPEED_MPS.least, SPEED_MPS.most
    if len(pair) != 2 or not slowest <= pair[0] < pair[1] <= fastest:
        accepted = f"(lowest, highest) in m/s, {slowest:g} <= lowest < highest <= {fastest:g}"
        raise InvalidInput(name, tuple(pair), accepted)
