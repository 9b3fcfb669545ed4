"""The transducer dataset in memory: geometry, travel times, traces; validated on construction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import refuse_mask
from ..errors import InvalidInput
from ..requests.limits import (
    ATTENUATION_NP_M,
    FREQUENCY_HZ,
    SAMPLING_HZ,
    SPEED_MPS,
    TEMPERATURE_C,
    TIME_S,
    check_size,
)
from ..requests.ranges import check_ranges, ranged
from . import rules
from .impossible_times import Geometry, without_impossible
from .simulation.phantom_truth import Truth
from .water import speed_from_temperature
from .waveform import Waveform

__all__ = ["Dataset", "Truth", "Waveform"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

POSITION = "geometry/element_position_m"

# Positions beyond are refused when a scan is checked; their distances may overflow before.
FARTHEST_M = 1e9

ARRAY_TYPES = ("ring", "rings", "free")

# Arrays over pairs, by their paths in the file format.
OVER_PAIRS = {
    "tof_s": "traveltime/tof_s",
    "delta_tof_s": "traveltime/delta_tof_s",
    "sigma_s": "traveltime/sigma_s",
    "log_ratio_np": "amplitude/log_ratio_np",
    "valid": "mask/valid",
}


@dataclass(frozen=True)
class Dataset:
    """One transmission scan, in SI units; NaN means missing.

    Arrays over pairs are (ntx, nrx), or (nz, ntx, nrx) when ``slice_z_m`` is given. A dataset without
    travel times (``picked`` is false) needs its traces, which may remain in the file.

    Attributes:
        element_position_m: (elements, 2 or 3), m, origin at the centre of the ring.
        tx, rx: (ntx,), (nrx,) indices into ``element_position_m``.
        water_speed_mps: speed in the coupling water, m/s.
        tof_s: travel time through the object, s.
        delta_tof_s: travel time object minus water, s.
        sigma_s: standard deviation of the travel times, s.
        log_ratio_np: ln(A_water / A_object), Np.
        valid: pairs that may be used; NaN pairs are never used.
        water_temperature_assumed: whether nobody stated the speed or the temperature of the water.
        impossible_times: numbers of travel times that no sound can have and that became NaN, by their kind:
            0 or less, infinite, masked, placeholders such as -9999, and a difference of 0 where the other
            direction says otherwise; see ``impossible_times``.

    Masked arrays are taken: masked pairs are missing.

    Raises:
        InvalidInput: naming the field as in the file format.
    """

    element_position_m: Floats
    tx: Ints
    rx: Ints
    water_speed_mps: float = ranged(MISSING, SPEED_MPS, place="water@sound_speed_mps")
    tof_s: Floats | None = None
    delta_tof_s: Floats | None = None
    sigma_s: Floats | None = None
    log_ratio_np: Floats | None = None
    valid: Bools | None = None
    roi: NDArray[np.bool_] | None = None
    waveform: Waveform | None = None
    truth: Truth | None = None
    slice_z_m: Floats | None = None
    element_normal: Floats | None = None
    wavelet: Floats | None = None
    array_type: str = "ring"
    radius_m: float | None = None
    center_frequency_hz: float | None = ranged(None, FREQUENCY_HZ, place="acquisition@center_frequency_hz")
    sampling_rate_hz: float | None = ranged(None, SAMPLING_HZ, place="acquisition@sampling_rate_hz")
    t0_s: float = ranged(0.0, TIME_S, place="acquisition@t0_s")
    water_temperature_c: float | None = ranged(None, TEMPERATURE_C, place="water@temperature_c")
    water_temperature_assumed: bool = False
    water_attenuation_np_m: float | None = ranged(None, ATTENUATION_NP_M, place="water@attenuation_np_m")
    amplitude_frequency_hz: float | None = ranged(None, FREQUENCY_HZ, place="amplitude@frequency_hz")
    picker: str = ""
    title: str = ""
    source: str = ""
    license: str = field(default="")
    impossible_times: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._fill_masks()
        for path, shape in self.shapes().items():
            check_size(path, shape)
        position = self.element_position_m
        if position.ndim != 2 or position.shape[1] not in (2, 3) or len(position) < 3:
            raise InvalidInput(POSITION, f"shape {position.shape}", "(elements, 2 or 3), at least 3 elements")
        bad = np.flatnonzero(~np.isfinite(position).all(axis=1))
        if bad.size:
            raise InvalidInput(
                POSITION,
                f"{position[bad[0]].tolist()} for element {bad[0]} ({bad.size} such elements)",
                "finite coordinates in metres",
            )
        for name, index in (("tx", self.tx), ("rx", self.rx)):
            if index.ndim != 1 or index.size == 0:
                raise InvalidInput(
                    f"acquisition/{name}", f"shape {index.shape}", "a non-empty list of element indices"
                )
            wrong = np.flatnonzero((index < 0) | (index >= len(position)))
            if wrong.size:
                raise InvalidInput(
                    f"acquisition/{name}",
                    f"{index[wrong[0]]} at position {wrong[0]}",
                    f"element indices from 0 to {len(position) - 1}",
                )
        check_ranges(self)
        self._check_description()
        self._leave_out_impossible()
        self._check_pairs()

    def _fill_masks(self) -> None:
        """Replace masked arrays by plain ones: masked pairs are missing or not valid."""
        for name in ("sigma_s", "log_ratio_np"):
            array = getattr(self, name)
            if isinstance(array, np.ma.MaskedArray):
                object.__setattr__(self, name, np.ma.filled(array.astype(np.float64), np.nan))
        for name in ("valid", "roi"):
            array = getattr(self, name)
            if isinstance(array, np.ma.MaskedArray):
                object.__setattr__(self, name, np.ma.filled(array, False))
        for path, array in (
            (POSITION, self.element_position_m),
            ("acquisition/tx", self.tx),
            ("acquisition/rx", self.rx),
            ("acquisition/wavelet", self.wavelet),
            ("slice/z_m", self.slice_z_m),
            ("geometry/element_normal", self.element_normal),
        ):
            if array is not None:
                refuse_mask(path, array)

    def _leave_out_impossible(self) -> None:
        """Replace travel times that no sound can have by NaN, and count them."""
        if np.abs(self.element_position_m).max() > FARTHEST_M:
            return
        pairs = self._pairs
        counts = dict(self.impossible_times)
        for name in ("tof_s", "delta_tof_s"):
            times = getattr(self, name)
            # Another shape is refused below.
            if times is None or times.shape != pairs:
                continue
            kept, impossible = without_impossible(times, self.geometry, absolute=name == "tof_s")
            if kept is not times:
                object.__setattr__(self, name, kept)
            for kind, count in impossible.items():
                counts[kind] = counts.get(kind, 0) + count
        object.__setattr__(self, "impossible_times", counts)
        if self.sigma_s is not None and self.picked and self.sigma_s.shape == pairs:
            # What a missing time deviates by is of no interest.
            times = self.delta_tof_s if self.delta_tof_s is not None else self.tof_s
            assert times is not None
            unknown = ~np.isfinite(times) & ~np.isnan(self.sigma_s)
            if unknown.any():
                object.__setattr__(self, "sigma_s", np.where(unknown, np.nan, self.sigma_s))

    def _check_description(self) -> None:
        if self.array_type not in ARRAY_TYPES:
            raise InvalidInput(
                "geometry@array_type", repr(self.array_type), "one of " + ", ".join(ARRAY_TYPES)
            )
        if self.element_normal is not None:
            rules.shape("geometry/element_normal", self.element_normal, self.element_position_m.shape)
            rules.finite("geometry/element_normal", self.element_normal)
        if self.radius_m is not None and not 0.0 < self.radius_m < np.inf:
            raise InvalidInput("geometry@radius_m", self.radius_m, "a finite number > 0 m")
        for path, array, axis in (
            ("acquisition/wavelet", self.wavelet, "nt"),
            ("slice/z_m", self.slice_z_m, "nz"),
        ):
            if array is not None:
                if array.ndim != 1 or array.size == 0:
                    raise InvalidInput(path, f"shape {array.shape}", f"({axis},), not empty")
                rules.finite(path, array)
        if self.slice_z_m is not None and not (np.diff(self.slice_z_m) > 0.0).all():
            raise InvalidInput("slice/z_m", "positions that do not rise", "strictly rising positions in m")

    @property
    def _pairs(self) -> tuple[int, ...]:
        """Shape of the arrays over pairs."""
        return (*(() if self.slice_z_m is None else self.slice_z_m.shape), len(self.tx), len(self.rx))

    def _check_pairs(self) -> None:
        pairs = self._pairs
        for name, path in OVER_PAIRS.items():
            if (array := getattr(self, name)) is not None:
                rules.shape(path, array, pairs)
                rules.no_infinity(path, array)
        if self.sigma_s is not None:
            rules.positive_or_nan("traveltime/sigma_s", self.sigma_s)
        if self.waveform is not None:
            traces = self.waveform.object
            if traces.shape[:-1] != pairs:
                accepted = "(" + ", ".join(str(n) for n in pairs) + ", nt)"
                raise InvalidInput("waveform/object", f"shape {traces.shape}", f"shape {accepted}")
            if self.sampling_rate_hz is None:
                raise InvalidInput(
                    "acquisition@sampling_rate_hz", "nothing", "a rate in Hz > 0, since there are traces"
                )

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the arrays present, by their path in the file format."""
        traces, truth = self.waveform, self.truth
        arrays = {
            POSITION: self.element_position_m,
            "geometry/element_normal": self.element_normal,
            "acquisition/tx": self.tx,
            "acquisition/rx": self.rx,
            "acquisition/wavelet": self.wavelet,
            "slice/z_m": self.slice_z_m,
            "traveltime/tof_s": self.tof_s,
            "traveltime/delta_tof_s": self.delta_tof_s,
            "mask/valid": self.valid,
            "mask/roi": self.roi,
            "waveform/object": None if traces is None else traces.object,
            "truth/sound_speed_mps": None if truth is None else truth.sound_speed_mps,
        }
        return {path: array.shape for path, array in arrays.items() if array is not None}

    @property
    def traces(self) -> Waveform:
        """The traces of a scan that must have them."""
        assert self.waveform is not None
        return self.waveform

    @property
    def rate_hz(self) -> float:
        """Sampling rate of a scan with traces, Hz."""
        assert self.sampling_rate_hz is not None
        return self.sampling_rate_hz

    @property
    def frequency_hz(self) -> float:
        """Centre frequency of a scan that must state it, Hz."""
        assert self.center_frequency_hz is not None
        return self.center_frequency_hz

    @property
    def slices(self) -> int:
        """Number of axial slices, 1 for a plain 2-D scan."""
        return 1 if self.slice_z_m is None else len(self.slice_z_m)

    @property
    def geometry(self) -> Geometry:
        """Which elements the pairs are between."""
        return Geometry(self.element_position_m, self.tx, self.rx, self.water_speed_mps)

    @property
    def picked(self) -> bool:
        """Whether travel times are present; if not, they must be picked from the traces."""
        return self.tof_s is not None or self.delta_tof_s is not None

    def slice(self, index: int) -> Dataset:
        """The 2-D dataset of one axial slice; ``index`` counts from 0."""
        if not 0 <= index < self.slices:
            raise InvalidInput("slice", index, f"0 to {self.slices - 1}")
        if self.slice_z_m is None:
            return self
        return self.each_pair_changed(lambda array: array[index], truth=None, slice_z_m=None)

    def each_pair_changed(self, change: Callable[[Any], Any], **values: Any) -> Dataset:
        """This scan with all arrays over pairs and traces changed in the same way.

        Args:
            change: takes an array, or ``Emissions``, and returns the new one.
            values: of other fields.
        """
        arrays = {name: getattr(self, name) for name in OVER_PAIRS}
        changed = {name: change(array) for name, array in arrays.items() if array is not None}
        traces = None if self.waveform is None else self.waveform.changed(change)
        return replace(self, **changed, waveform=traces, **values)

    def in_water(self, speed_mps: float) -> Dataset:
        """This scan in water of a measured speed, m/s."""
        return replace(
            self, water_speed_mps=speed_mps, water_temperature_c=None, water_temperature_assumed=False
        )

    def in_water_of(self, temperature_c: float | None) -> Dataset:
        """This scan in water of a stated temperature, °C; None: in the water of the scan.

        Raises:
            InvalidInput: for a temperature outside 0 to 95 °C.
        """
        if temperature_c is None:
            return self
        return replace(
            self,
            water_speed_mps=speed_from_temperature(temperature_c),
            water_temperature_c=temperature_c,
            water_temperature_assumed=False,
        )

    def differential_tof(self) -> Floats:
        """Object minus water travel time, (…, ntx, nrx), s; NaN where missing, invalid or tx equals rx.

        Absolute times are converted to differences with the straight water path, which is exact in
        a homogeneous medium.

        Raises:
            InvalidInput: when the dataset contains only traces; pick them first.
        """
        if self.delta_tof_s is not None:
            delta = np.array(self.delta_tof_s, dtype=np.float64)
        elif self.tof_s is not None:
            delta = self.tof_s - self.distance_m() / self.water_speed_mps
        else:
            raise InvalidInput("traveltime", "no travel times", "picked travel times: run a picker first")
        if self.valid is not None:
            delta[~self.valid] = np.nan
        delta[..., self.tx[:, None] == self.rx[None, :]] = np.nan
        return delta

    def distance_m(self) -> Floats:
        """Straight distance of every pair, (ntx, nrx), m."""
        offset = self.element_position_m[self.tx][:, None, :] - self.element_position_m[self.rx][None, :, :]
        return np.asarray(np.linalg.norm(offset, axis=-1))
