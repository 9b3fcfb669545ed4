"""Options for scans of other programs, and their conversion before use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from bentray_kernels.errors import InvalidInput

from .option_tables import Option, with_options

if TYPE_CHECKING:
    from bentray_kernels.acquisition import Dataset
    from bentray_kernels.tomography import Settings
    from bentray_workers.foreign_scans import ScanMetadata

ACCEPTED = "the path of a scan, see the documentation of scan files"

# By the arguments of ``ScanMetadata.from_options``.
OPTIONS = {
    "map": Option(
        "--map",
        list[str],
        "",
        "Own variable of a MATLAB, HDF5 or NumPy file, e.g. element_position=pos; repeatable.",
        "FIELD=VARIABLE",
    ),
    "unit": Option("--unit", list[str], "m and s", "Unit of lengths or times in FILE; repeatable."),
    "temperature_c": Option("--temperature", float, "of FILE, else 20", "Temperature of the water, °C."),
    "sound_speed_mps": Option("--sound-speed", float, "by the temperature", "Speed of the water, m/s."),
    "frequency_hz": Option("--frequency", float, "of FILE", "Centre frequency, Hz."),
}

# The command with the options about a scan in place of its parameter ``scan_options``.
with_scan_options = with_options(OPTIONS, "scan_options")


def metadata_of(options: dict[str, Any]) -> ScanMetadata:
    """The given options as metadata of a scan; raises InvalidInput naming the first invalid one."""
    from bentray_workers.foreign_scans import ScanMetadata

    return ScanMetadata.from_options(**options)


def input_scan(path: Path) -> Path:
    """Return ``path`` if it is a file or a folder.

    Raises:
        InvalidInput: otherwise.
    """
    if not path.exists():
        raise InvalidInput("file", f"{path} (no such file)", ACCEPTED)
    return path


@contextmanager
def dataset_file(source: Path, given: ScanMetadata, folder_of: Path) -> Iterator[Path]:
    """A dataset file with the scan: the file itself, or a temporary conversion of a foreign one.

    Args:
        source: of the scan.
        given: values of the options.
        folder_of: existing folder for the temporary file.

    Raises:
        InvalidInput: naming the first missing or wrong field.
    """
    from bentray_workers.foreign_scans import convert_dataset, is_upload_format

    if is_upload_format(source) and not given:
        yield source
        return
    with TemporaryDirectory(dir=folder_of, prefix=".converted-") as folder:
        converted = Path(folder) / f"{source.stem}.h5"
        convert_dataset(source, converted, given=given)
        yield converted


def checked_dataset(scan: Path, settings: Settings) -> Dataset:
    """A dataset file without its traces; raises InvalidInput unless it has what the settings require."""
    from bentray_kernels.tomography.requirements import check_scan
    from bentray_workers.files.dataset.scan import read_header

    header = read_header(scan, estimate=False)
    check_scan(header.dataset, settings, header.samples)
    return header.dataset
