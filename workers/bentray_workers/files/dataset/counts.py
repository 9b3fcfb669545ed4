"""Counts and sizes of a dataset for plans, and its record for the database, in plain values."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bentray_kernels.acquisition.element_pitch import element_pitch
from bentray_kernels.acquisition.impossible_times import impossible_words
from bentray_kernels.tomography.decomposition import automatic_decomposition
from bentray_kernels.tomography.image_grid import automatic_nodes

# These load compiled kernels, which takes seconds: the reader of an upload starts without them.
if TYPE_CHECKING:
    from bentray_kernels.acquisition import Dataset
    from bentray_kernels.tomography.settings import Settings

# Largest size of emissions in the same chunks.
BLOCK_BYTES = 32 * 2**20
# Characters of a text in a record.
LONGEST_TEXT = 200


@dataclass(frozen=True)
class Traces:
    """Traces of a dataset for plans.

    Attributes:
        emissions, receivers: of one slice.
        samples: of each trace.
        sample_bytes: of one.
        rate_hz: of the samples.
        frequency_hz: centre frequency of the pulse.
        water_mps: speed of sound in water.
        water_shot: whether there are traces of the water alone.
    """

    emissions: int
    receivers: int
    samples: int
    sample_bytes: int
    rate_hz: float
    frequency_hz: float
    water_mps: float
    water_shot: bool = True

    def bytes_of(self, emissions: int) -> int:
        """Size of object traces of some emissions of one slice."""
        return min(emissions, self.emissions) * self.receivers * self.samples * self.sample_bytes

    @property
    def read_bytes(self) -> int:
        """Size of a read of object or water: an emission, or those in the same chunks."""
        return max(self.bytes_of(1), min(self.bytes_of(self.emissions), BLOCK_BYTES))


@dataclass(frozen=True)
class Summary:
    """Dataset for plans.

    Attributes:
        emitters, receivers: of one slice, or of the array with reciprocity.
        pairs: in all slices.
        slices: heights of the ring; 1 for a plain scan, and for an array in space.
        in_space: whether the elements have 3-D positions.
        height_m: from the lowest height to the highest, m.
        width_m: of the array, m.
        traces_bytes: of the waveforms that are examined or picked.
        amplitudes: whether there are amplitudes.
        traces: for a full-waveform refinement; None without traces of the object.
        period: whether the centre frequency is known, so that times are examined.
        nodes: along each side of an image, at most, where the settings leave them open.
        decomposition: where the settings leave it open.
        normals: whether the directions of the elements are known.
        echoes: traces of the object for a reflection image; None if there are none, or none is requested.
        recorded: traces that are examined or picked; None if there are none, or the frequency is unknown.
    """

    emitters: int
    receivers: int
    pairs: int
    slices: int
    in_space: bool
    height_m: float
    width_m: float
    traces_bytes: int
    amplitudes: bool
    traces: Traces | None = None
    period: bool = False
    nodes: int = 128
    decomposition: str = "slices"
    normals: bool = False
    echoes: Traces | None = None
    recorded: Traces | None = None


@dataclass(frozen=True)
class DatasetCounts:
    """Counts and sizes of a dataset.

    Attributes:
        emissions, receivers: of one slice.
        elements: that emit, receive or both.
        slices: heights of the ring; 1 for a plain scan, and for an array in space.
        in_space: whether the elements have 3-D positions.
        height_m, width_m: of the array with all of its heights, m.
        times: whether there are travel times.
        amplitudes: whether there are recorded amplitudes.
        traces_bytes: of the traces of object and water.
        samples, sample_bytes: of each trace; 0 without traces of the object.
        rate_hz, frequency_hz: sampling rate and centre frequency; None if unknown.
        water_mps: speed of sound in water.
        water_shot: whether there are traces of the water alone; older records do not state it.
        pitch_m: median distance of neighbouring elements, m; 0: not stated, in older records.
        decomposition: where the settings leave it open.
        normals: whether the directions of the elements are known.
    """

    emissions: int
    receivers: int
    elements: int
    slices: int
    in_space: bool
    height_m: float
    width_m: float
    times: bool
    amplitudes: bool
    traces_bytes: int
    samples: int
    sample_bytes: int
    rate_hz: float | None
    frequency_hz: float | None
    water_mps: float
    water_shot: bool = True
    pitch_m: float = 0.0
    decomposition: str = "slices"
    normals: bool = False

    @classmethod
    def from_dataset(cls, dataset: Dataset) -> DatasetCounts:
        """Counts of a dataset; its traces may be placeholders."""
        traces = dataset.waveform
        both = [] if traces is None else [data for data in (traces.object, traces.water) if data is not None]
        position, heights = dataset.element_position_m, dataset.slice_z_m
        in_space = position.shape[1] == 3
        z = position[:, 2] if in_space else np.zeros(1) if heights is None else heights
        return cls(
            emissions=len(dataset.tx),
            receivers=len(dataset.rx),
            elements=len(np.union1d(dataset.tx, dataset.rx)),
            slices=dataset.slices,
            in_space=in_space,
            height_m=float(np.ptp(z)),
            width_m=float(np.ptp(position[:, :2], axis=0).max()),
            pitch_m=element_pitch(position),
            decomposition=automatic_decomposition(position),
            times=dataset.picked,
            amplitudes=dataset.log_ratio_np is not None,
            traces_bytes=sum(array.size * array.dtype.itemsize for array in both),
            samples=0 if traces is None else int(traces.object.shape[-1]),
            sample_bytes=both[0].dtype.itemsize if both else 0,
            rate_hz=dataset.sampling_rate_hz,
            frequency_hz=dataset.center_frequency_hz,
            water_mps=float(dataset.water_speed_mps),
            water_shot=len(both) == 2,
            normals=dataset.element_normal is not None,
        )

    def summary(self, settings: Settings) -> Summary:
        """The dataset for the plan of a reconstruction.

        Args:
            settings: with ``reciprocity``, all elements emit and receive; and whether amplitudes are read
                from traces.
        """
        both = (self.elements, self.elements)
        emitters, receivers = both if settings.numerics.reciprocity else (self.emissions, self.receivers)
        reads = not self.times or settings.reads_amplitudes
        # As ``quality.examination.examines_traces`` decides.
        reads |= settings.picking.examine and self.frequency_hz is not None
        estimated = not self.times or settings.reads_amplitudes or settings.method == "waveform"
        return Summary(
            emitters=emitters,
            receivers=receivers,
            pairs=self.slices * self.emissions * self.receivers,
            slices=self.slices,
            in_space=self.in_space,
            height_m=self.height_m,
            width_m=self.width_m,
            traces_bytes=self.traces_bytes if reads else 0,
            recorded=self._traces() if reads else None,
            amplitudes=self.amplitudes or settings.reads_amplitudes,
            traces=self._traces() if self.water_shot or estimated else None,
            period=self.frequency_hz is not None,
            nodes=self._nodes(settings),
            decomposition=self.decomposition,
            normals=self.normals,
            echoes=self._traces() if settings.reflection.enabled else None,
        )

    def _nodes(self, settings: Settings) -> int:
        wavelength = self.water_mps / self.frequency_hz if self.frequency_hz else None
        # The noise of the times, unknown here, may allow fewer.
        pitch = self.pitch_m or math.pi * self.width_m / self.elements
        volume = (settings.decomposition or self.decomposition) == "volume"
        return automatic_nodes(settings.side_m or self.width_m, pitch, wavelength, volume=volume)[0]

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; ``DatasetCounts(**plain)`` gives the same."""
        return asdict(self)

    def _traces(self) -> Traces | None:
        if not self.samples or self.rate_hz is None or self.frequency_hz is None:
            return None
        return Traces(
            self.emissions,
            self.receivers,
            self.samples,
            self.sample_bytes,
            self.rate_hz,
            self.frequency_hz,
            self.water_mps,
            self.water_shot,
        )


def record_of(dataset: Dataset) -> dict[str, Any]:
    """Fields of the record by name; ``counts`` is for plans."""
    return {
        "title": text(dataset.title),
        "source": text("; ".join(note for note in (left_out(dataset), dataset.source) if note)),
        "license": text(dataset.license),
        "dimension": int(dataset.element_position_m.shape[1]),
        "elements": len(dataset.element_position_m),
        "ntx": len(dataset.tx),
        "nrx": len(dataset.rx),
        "slices": dataset.slices,
        "has_traces": dataset.waveform is not None,
        "has_travel_times": dataset.picked,
        "has_truth": dataset.truth is not None,
        "water_speed_mps": float(dataset.water_speed_mps),
        "counts": DatasetCounts.from_dataset(dataset).to_dict(),
    }


def left_out(dataset: Dataset) -> str:
    """Values that became missing, in words; empty for none."""
    words = impossible_words(dataset.impossible_times)
    return f"impossible times left out: {words}" if words else ""


def text(value: str) -> str:
    """A text of a file, printable and truncated."""
    return "".join(c for c in value if c.isprintable())[:LONGEST_TEXT]
