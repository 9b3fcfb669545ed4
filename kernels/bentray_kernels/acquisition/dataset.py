"""The transducer dataset in memory: geometry, travel times, traces; checked when it is made."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PLAUSIBLE_SPEED_MPS = (200.0, 10_000.0)


@dataclass(frozen=True)
class Waveform:
    """Raw traces of the object scan and of the same scan in water alone.

    Attributes:
        object: (ntx, nrx, nt), with a leading nz axis for several slices; int16 or float32.
        water: as ``object``, or None.
        scale: pressure per count; the traces are ``scale * object`` in pascal (or any one unit).
        object_scale, water_scale: (ntx, nrx), optional further factor per trace.
    """

    object: NDArray[np.int16] | NDArray[np.float32]
    water: NDArray[np.int16] | NDArray[np.float32] | None = None
    scale: float = 1.0
    object_scale: Floats | None = None
    water_scale: Floats | None = None


@dataclass(frozen=True)
class Truth:
    """What a phantom really is, on nodes ``origin_m + index * spacing_m`` in (x, y[, z]) order."""

    sound_speed_mps: Floats
    spacing_m: tuple[float, ...]
    origin_m: tuple[float, ...]
    attenuation_np_m: Floats | None = None
    axes: str = "x,y"


@dataclass(frozen=True)
class Dataset:
    """One transmission scan, in SI units; NaN means missing.

    Arrays over pairs are (ntx, nrx), or (nz, ntx, nrx) when ``slice_z_m`` is given.

    Attributes:
        element_position_m: (elements, 2 or 3), m, origin at the centre of the ring.
        tx, rx: (ntx,), (nrx,) indices into ``element_position_m``.
        water_speed_mps: speed in the coupling water, m/s.
        tof_s: travel time through the object, s.
        delta_tof_s: travel time object minus water, s.
        sigma_s: standard deviation of the travel times, s.
        log_ratio_np: ln(A_water / A_object), Np.
        valid: pairs that may be used; NaN pairs are never used.

    Raises:
        InvalidInput: naming the field in the words of the file format.
    """

    element_position_m: Floats
    tx: Ints
    rx: Ints
    water_speed_mps: float
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
    center_frequency_hz: float | None = None
    sampling_rate_hz: float | None = None
    t0_s: float = 0.0
    water_temperature_c: float | None = None
    water_attenuation_np_m: float | None = None
    amplitude_frequency_hz: float | None = None
    picker: str = ""
    title: str = ""
    source: str = ""
    license: str = field(default="")

    def __post_init__(self) -> None:
        position = self.element_position_m
        if position.ndim != 2 or position.shape[1] not in (2, 3) or len(position) < 3:
            raise InvalidInput(
                "geometry/element_position_m", f"shape {position.shape}", "(elements, 2 or 3), at least 3 elements"
            )
        bad = np.flatnonzero(~np.isfinite(position).all(axis=1))
        if bad.size:
            raise InvalidInput(
                "geometry/element_position_m",
                f"{position[bad[0]].tolist()} for element {bad[0]} ({bad.size} such elements)",
                "finite coordinates in metres",
            )
        for name, index in (("tx", self.tx), ("rx", self.rx)):
            if index.ndim != 1 or index.size == 0:
                raise InvalidInput(f"acquisition/{name}", f"shape {index.shape}", "a non-empty list of element indices")
            wrong = np.flatnonzero((index < 0) | (index >= len(position)))
            if wrong.size:
                raise InvalidInput(
                    f"acquisition/{name}",
                    f"{index[wrong[0]]} at position {wrong[0]}",
                    f"element indices from 0 to {len(position) - 1}",
                )
        low, high = PLAUSIBLE_SPEED_MPS
        if not low <= self.water_speed_mps <= high:
            raise InvalidInput("water/sound_speed_mps", self.water_speed_mps, f"a speed from {low:g} to {high:g} m/s")
        if self.tof_s is None and self.delta_tof_s is None and self.waveform is None:
            raise InvalidInput("traveltime", "neither travel times nor traces", "traveltime/… or waveform/object")
        self._check_pairs()

    def _check_pairs(self) -> None:
        pairs: tuple[int, ...] = (len(self.tx), len(self.rx))
        if self.slice_z_m is not None:
            pairs = (len(self.slice_z_m), *pairs)
        for name, array in (
            ("traveltime/tof_s", self.tof_s),
            ("traveltime/delta_tof_s", self.delta_tof_s),
            ("traveltime/sigma_s", self.sigma_s),
            ("amplitude/log_ratio_np", self.log_ratio_np),
            ("mask/valid", self.valid),
        ):
            if array is not None and array.shape != pairs:
                raise InvalidInput(name, f"shape {array.shape}", f"shape {pairs}")
        if self.waveform is not None:
            for name, traces in (("object", self.waveform.object), ("water", self.waveform.water)):
                if traces is not None and traces.shape[:-1] != pairs:
                    raise InvalidInput(f"waveform/{name}", f"shape {traces.shape}", f"shape {(*pairs, 'nt')}")
            if self.sampling_rate_hz is None or not self.sampling_rate_hz > 0:
                raise InvalidInput("acquisition@sampling_rate_hz", self.sampling_rate_hz, "a rate in Hz > 0")

    @property
    def slices(self) -> int:
        """Number of axial slices, 1 for a plain 2-D scan."""
        return 1 if self.slice_z_m is None else len(self.slice_z_m)

    @property
    def picked(self) -> bool:
        """Whether travel times are there already; if not, they must be picked from the traces."""
        return self.tof_s is not None or self.delta_tof_s is not None

    def slice(self, index: int) -> Dataset:
        """The 2-D dataset of one axial slice; ``index`` counts from 0."""
        if not 0 <= index < self.slices:
            raise InvalidInput("slice", index, f"0 to {self.slices - 1}")
        if self.slice_z_m is None:
            return self

        def one(array: NDArray | None) -> NDArray | None:  # type: ignore[type-arg]
            return None if array is None else array[index]

        traces = self.waveform
        if traces is not None:
            traces = Waveform(
                traces.object[index], one(traces.water), traces.scale, one(traces.object_scale), one(traces.water_scale)
            )
        return replace(
            self,
            tof_s=one(self.tof_s),
            delta_tof_s=one(self.delta_tof_s),
            sigma_s=one(self.sigma_s),
            log_ratio_np=one(self.log_ratio_np),
            valid=one(self.valid),
            waveform=traces,
            truth=None,
            slice_z_m=None,
        )

    def differential_tof(self) -> Floats:
        """Object minus water travel time, (…, ntx, nrx), s; NaN where missing, invalid or tx equals rx.

        Absolute times are turned into differences with the straight water path, which is exact in
        a homogeneous medium.

        Raises:
            InvalidInput: when the dataset holds traces only; pick them first.
        """
        if self.delta_tof_s is not None:
            delta = np.array(self.delta_tof_s, dtype=np.float64)
        elif self.tof_s is not None:
            delta = self.tof_s - self.distance_m() / self.water_speed_mps
        else:
            raise InvalidInput("traveltime", "traces only", "picked travel times: run a picker first")
        if self.valid is not None:
            delta[~self.valid] = np.nan
        delta[..., self.tx[:, None] == self.rx[None, :]] = np.nan
        return delta

    def distance_m(self) -> Floats:
        """Straight distance of every pair, (ntx, nrx), m."""
        offset = self.element_position_m[self.tx][:, None, :] - self.element_position_m[self.rx][None, :, :]
        return np.asarray(np.linalg.norm(offset, axis=-1))
