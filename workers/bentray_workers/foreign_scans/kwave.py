"""A scan simulated with k-Wave: a zip of its output files, one per emission, and of the geometry.

The zip holds ``geometry.npz``, with positions, emitters and receivers under the names of the upload format,
``object/*.h5`` and optionally ``water/*.h5`` of a second run without the object: outputs in the order of
``tx`` by name, each with the pressure ``p`` of a sensor mask (1, Nt, receivers) and the time step ``dt``.
k-Wave records in the order of its grid; ``rx`` lists the element of each receiver.
"""

import io
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..files.bounded_reading import LARGEST_ROW, LARGEST_TOTAL
from ..files.damage import rejecting_damage
from ..files.hdf5_reading import Reader, opened, rejecting_hdf5_damage
from ..files.npz import Npz
from ..files.zip_checks import WHOLE, check_zip, member_file, naming, read_member
from .arrays import LARGEST_WHOLE
from .open_scan import OpenScan, ScanReader, Variable

GEOMETRY = "geometry.npz"
OUTPUT = re.compile(r"(object|water)/[^/]+\.(h5|hdf5)")
MAX_OUTPUTS = 8192
PRESSURE = "(1, Nt, receivers) pressures of a sensor mask"
RATE = "acquisition/sampling_rate_hz"

# Time steps of all outputs agree within this part.
SAME_STEP = 1e-6


class KWave(Npz):
    """The arrays of one zip; see ``Arrays``: those of its geometry, and the traces from its outputs.

    Args:
        archive: open.
        scratch: folder for one output at a time.

    Raises:
        InvalidInput: for a zip without geometry, or different outputs.
    """

    kind = "outputs of k-Wave"

    def __init__(self, archive: zipfile.ZipFile, scratch: Path) -> None:
        self._archive = archive
        self._scratch = scratch
        with rejecting_damage("file", WHOLE):
            check_zip(archive, MAX_OUTPUTS)
        names = archive.namelist()
        if GEOMETRY not in names:
            raise InvalidInput(GEOMETRY, "nothing", "positions, tx and rx beside the outputs of k-Wave")
        self._outputs = {
            f"waveform/{which}": sorted(n for n in names if OUTPUT.fullmatch(n) and n.startswith(which))
            for which in ("object", "water")
        }
        super().__init__(io.BytesIO(read_member(archive, GEOMETRY, LARGEST_WHOLE)))
        first = self._outputs["waveform/object"] or self._outputs["waveform/water"]
        with self._output(first[0]) as reader:
            self._shape = self._pressure(first[0], reader).shape[::-1]
            self._step = self._time_step(first[0], reader)

    def names(self) -> tuple[str, ...]:
        traces = [name for name, outputs in self._outputs.items() if outputs]
        return (*super().names(), *traces, RATE)

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        if name == RATE:
            return (), np.dtype(np.float64)
        outputs = self._outputs.get(name)
        if not outputs:
            return super().declared(name)
        shape = (len(outputs), *self._shape)
        size = 4 * int(np.prod(shape, dtype=np.float64))
        if size > LARGEST_TOTAL:
            raise InvalidInput(name, f"{size} bytes", f"at most {LARGEST_TOTAL} bytes")
        return shape, np.dtype(np.float32)

    def whole(self, name: str) -> NDArray[Any]:
        return np.array(1.0 / self._step) if name == RATE else super().whole(name)

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        for output in self._outputs[name]:
            with self._output(output) as reader:
                pressure = self._pressure(output, reader)
                step = self._time_step(output, reader)
                if pressure.shape[::-1] != self._shape or abs(step - self._step) > SAME_STEP * self._step:
                    raise InvalidInput(
                        output,
                        f"shape {pressure.shape}, steps of {step:g} s",
                        f"shape {self._shape[::-1]}, steps of {self._step:g} s, as the first output",
                    )
            with np.errstate(over="ignore", invalid="ignore"):
                yield np.ascontiguousarray(pressure.T, dtype=np.float32)

    def _pressure(self, output: str, reader: Reader) -> NDArray[Any]:
        """(Nt, receivers)."""
        with _of(output):
            pressure = reader.array("p", "f", PRESSURE)
            if pressure is None or pressure.ndim != 3 or pressure.shape[0] != 1 or 0 in pressure.shape:
                shown = "nothing" if pressure is None else f"shape {pressure.shape}"
                raise InvalidInput("p", shown, PRESSURE)
        return np.asarray(pressure[0])

    def _time_step(self, output: str, reader: Reader) -> float:
        with _of(output):
            step = reader.array("dt", "f", "the time step in s")
            if step is None or step.size != 1 or not 0.0 < float(step.ravel()[0]) < 1.0:
                shown = "nothing" if step is None else f"{step.ravel()[:3]}"
                raise InvalidInput("dt", shown, "the time step in s")
            return float(step.ravel()[0])

    @contextmanager
    def _output(self, name: str) -> Iterator[Reader]:
        member = member_file(self._archive, name, LARGEST_ROW, self._scratch)
        with member as path, _of(name), opened(path) as reader:
            yield reader


@contextmanager
def _of(output: str) -> Iterator[None]:
    """Add the name of the output to errors, also those of HDF5."""
    with naming(output), rejecting_hdf5_damage(output, "an output of k-Wave"):
        yield


def _detect(scan: OpenScan) -> bool:
    return scan.archive is not None and any(map(OUTPUT.fullmatch, scan.members))


def _read(scan: OpenScan) -> KWave:
    assert scan.archive is not None
    return KWave(scan.archive, scan.scratch)


READER = ScanReader(
    title="Outputs of k-Wave (zip)",
    about="One HDF5 output for each emission, in the order of `tx` by name, of a sensor mask; beside them "
    "`geometry.npz`. k-Wave records in the order of its grid: `rx` lists the element of each receiver.",
    variables=(
        Variable("geometry.npz: element_position_m", "(elements, 2 or 3)", "m", "positions of the elements"),
        Variable("geometry.npz: tx, rx", "(ntx,), (nrx,) integers", "", "elements, counted from 0"),
        Variable("object/*.h5: p", "(1, Nt, receivers) in HDF5", "Pa", "pressure"),
        Variable("object/*.h5: dt", "number", "s", "time step"),
        Variable("water/*.h5", "as object", "", "the same without the object", "no"),
    ),
    detect=_detect,
    read=_read,
)
