"""Options for scans of other programs, and their conversion before use."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from bentray_kernels.errors import InvalidInput

if TYPE_CHECKING:
    from bentray_workers.foreign_scans import ScanMetadata

ACCEPTED = "the path of a scan, see the documentation of scan files"

Map = Annotated[
    list[str] | None,
    typer.Option(
        "--map",
        metavar="FIELD=VARIABLE",
        show_default=False,
        help="Own variable of a MATLAB, HDF5 or NumPy file, e.g. element_position=pos; repeatable.",
    ),
]
Unit = Annotated[
    list[str] | None,
    typer.Option("--unit", show_default="m and s", help="Unit of lengths or times in FILE; repeatable."),
]
Temperature = Annotated[
    float | None,
    typer.Option("--temperature", show_default="of FILE, else 20", help="Temperature of the water, °C."),
]
SoundSpeed = Annotated[
    float | None,
    typer.Option("--sound-speed", show_default="by the temperature", help="Speed of the water, m/s."),
]
Frequency = Annotated[
    float | None, typer.Option("--frequency", show_default="of FILE", help="Centre frequency, Hz.")
]


def scan_metadata(
    map: Sequence[str] | None,  # noqa: A002 - the name of the option
    unit: Sequence[str] | None,
    temperature: float | None,
    sound_speed: float | None,
    frequency: float | None,
) -> ScanMetadata:
    """The values of the options; raises InvalidInput naming the first invalid one."""
    from bentray_workers.foreign_scans import ScanMetadata

    return ScanMetadata.of(map or (), unit or (), temperature, sound_speed, frequency)


def input_scan(path: Path) -> Path:
    """Return ``path`` if it is a file or a folder.

    Raises:
        InvalidInput: otherwise.
    """
    if not path.exists():
        raise InvalidInput("file", f"{path} (no such file)", ACCEPTED)
    return path


@contextmanager
def dataset_file(source: Path, given: ScanMetadata, beside: Path) -> Iterator[Path]:
    """A dataset file with the scan: the file itself, or a temporary conversion of a foreign one.

    Args:
        source: of the scan.
        given: values of the options.
        beside: existing folder for the temporary file.

    Raises:
        InvalidInput: naming the first missing or wrong field.
    """
    from bentray_workers.foreign_scans import convert_dataset, is_upload_format

    if is_upload_format(source) and not given:
        yield source
        return
    with TemporaryDirectory(dir=beside, prefix=".converted-") as folder:
        converted = Path(folder) / f"{source.stem}.h5"
        convert_dataset(source, converted, given=given)
        yield converted
