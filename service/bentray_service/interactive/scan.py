"""A scan that was read or simulated: a dataset file, with its description in memory."""

from __future__ import annotations

import os
import shutil
import weakref
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import atomic_replace
from bentray_workers.files.dataset.scan import read_header

from ..html_tables import figures_html

ACCEPTED = "the path of a scan, see the documentation of scan files"
# Of temporary folders.
PREFIX = "bentray-"


class Scan:
    """One transmission scan. Its traces, which may be large, stay in the file until they are needed.

    A scan is a path for other functions: ``client.upload(scan)`` sends its file.

    Attributes:
        path: of the file in the upload format; a temporary file for other formats and simulations.
        dataset: geometry, times and water in SI units, without the traces.
        name: of the file that was read, or of the phantom.
        samples: samples of each trace; 0 without traces.
    """

    def __init__(self, path: Path, name: str) -> None:
        """Args:
        path: of a file in the upload format.
        name: to show.

        Raises:
            InvalidInput: naming the first field that is missing or wrong.
        """
        self.path = path
        self.name = name
        header = read_header(path, estimate=False)
        self.dataset: Dataset = header.dataset
        self.samples = header.samples

    @property
    def title(self) -> str:
        """The title in the file, else the name of the file."""
        return self.dataset.title or self.name

    @property
    def position_m(self) -> NDArray[np.float64]:
        """Positions of the elements, (elements, 2 or 3), m."""
        return self.dataset.element_position_m

    @property
    def water_speed_mps(self) -> float:
        """Speed of sound in the water, m/s."""
        return self.dataset.water_speed_mps

    @property
    def truth(self) -> Truth | None:
        """The true image of a phantom, or None."""
        return self.dataset.truth

    def delta_tof_s(self) -> NDArray[np.float64]:
        """Travel times object minus water, ([nz,] ntx, nrx), s; NaN where missing.

        Raises:
            InvalidInput: for a scan with traces alone.
        """
        return self.dataset.differential_tof()

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Copy the scan to a file in the upload format (``.h5``), which is replaced atomically.

        Raises:
            InvalidInput: for another suffix.
            OSError: where the folder cannot be written to or the disk is full.
        """
        target = Path(path)
        if target.suffix.lower() not in (".h5", ".hdf5"):
            raise InvalidInput("path", target, "a name ending in .h5, .hdf5")
        with atomic_replace(target) as partial:
            shutil.copyfile(self.path, partial)
        return target

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        *counts, (_, content) = self._counts()
        words = ", ".join(
            f"{value} {name.removesuffix('s') if value == '1' else name}" for name, value in counts
        )
        return f"<bentray.Scan {self.name!r}: {words}; {content}>"

    def _repr_html_(self) -> str:
        own = self.dataset
        water = f"{own.water_speed_mps:.1f} m/s"
        if own.water_temperature_c is not None:
            assumed = ", assumed" if own.water_temperature_assumed else ""
            water += f", {own.water_temperature_c:g} °C{assumed}"
        rows = [*self._counts(), ("water", water)]
        if own.center_frequency_hz is not None:
            rows.append(("centre frequency", f"{1e-6 * own.center_frequency_hz:.3g} MHz"))
        if own.sampling_rate_hz is not None:
            rows.append(("sampling rate", f"{1e-6 * own.sampling_rate_hz:.3g} MHz"))
        size = np.ptp(own.element_position_m, axis=0) * 1e3
        rows.append(("array", " x ".join(f"{length:.1f}" for length in size) + " mm"))
        rows += [("source", own.source), ("licence", own.license)]
        return figures_html(self.title, [row for row in rows if row[1]])

    def _counts(self) -> list[tuple[str, str]]:
        own = self.dataset
        held = {"times": own.picked, "traces": self.samples > 0, "truth": own.truth is not None}
        counts = {
            "elements": len(own.element_position_m),
            "emitters": len(own.tx),
            "receivers": len(own.rx),
            "slices": own.slices,
        }
        content = " and ".join(name for name, present in held.items() if present)
        return [*((name, str(count)) for name, count in counts.items()), ("content", content)]


def read(
    path: str | os.PathLike[str],
    *,
    map: Mapping[str, str] | None = None,  # noqa: A002 - as the option of the command line
    unit: str | Iterable[str] = (),
    temperature_c: float | None = None,
    sound_speed_mps: float | None = None,
    frequency_hz: float | None = None,
) -> Scan:
    """Read a scan in any format that the service takes, detected by content.

    Args:
        path: of a file, or of a folder of measurements.
        map: own variables of a MATLAB, HDF5 or NumPy file, such as ``{"element_position": "pos"}``.
        unit: of lengths and of times in the file, such as ``("mm", "us")``; default: m and s.
        temperature_c: of the water, °C; default: that of the file, else 20.
        sound_speed_mps: of the water, m/s; default: by the temperature.
        frequency_hz: centre frequency, Hz; default: that of the file.

    Returns:
        The scan; a file of another program is converted to a temporary file first.

    Raises:
        InvalidInput: naming the first field that is missing or wrong, the value found and what is accepted.
    """
    from bentray_workers.foreign_scans import ScanMetadata, convert_dataset, is_upload_format

    source = Path(path)
    if not source.exists():
        raise InvalidInput("file", f"{source} (no such file)", ACCEPTED)
    given = ScanMetadata.from_options(
        [f"{name}={variable}" for name, variable in (map or {}).items()],
        (unit,) if isinstance(unit, str) else unit,
        temperature_c,
        sound_speed_mps,
        frequency_hz,
    )
    if is_upload_format(source) and not given:
        return Scan(source, source.name)
    return temporary_scan(source.name, lambda target: convert_dataset(source, target, given=given))


def temporary_scan(name: str, write: Callable[[Path], object]) -> Scan:
    """A scan in a temporary file, removed with the object or at the end of the program.

    Args:
        name: to show.
        write: writes the file; on its errors nothing stays.
    """
    folder = Path(mkdtemp(prefix=PREFIX))
    try:
        write(folder / "scan.h5")
        scan = Scan(folder / "scan.h5", name)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    weakref.finalize(scan, shutil.rmtree, folder, ignore_errors=True)
    return scan
