"""`bentray download`: download a scan or a volume from a service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.export.registry import FORMATS, SUFFIXES, FormatName

from .export import AttenuationFrequency, AttenuationUnit, Quantity
from .options.paths import output_file
from .output.exit_codes import client_errors
from .output.terminal import AsJson, print_result, progress_bar, remark

DOWNLOADED = "; ".join(
    f"{form.title} {', '.join(suffix for suffix in form.suffixes if suffix not in form.local)}"
    for form in FORMATS.values()
)


def download(
    stored: Annotated[str, typer.Argument(metavar="ID", help="Id of a scan (ds-…) or volume (vol-…).")],
    output: Annotated[Path, typer.Option("--output", "-o", help=f"File to write: {DOWNLOADED}.")],
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            show_default="by the name",
            help=f"{', '.join(FORMATS)}, or h5 for hdf5.",
        ),
    ] = None,
    quantity: Quantity = "speed",
    attenuation: AttenuationUnit = "Np/m",
    frequency: AttenuationFrequency = None,
    url: Annotated[str, typer.Option(help="Address of the service.")] = "http://127.0.0.1:8000",
    force: Annotated[bool, typer.Option("--force", help="Replace OUTPUT if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Download a scan or a volume; the extension of OUTPUT selects the format.

    Scans are HDF5 files (.h5), as bentray reconstruct takes them.

    Example:  bentray download ds-0123456789abcdef0123 -o scan.h5
    """
    formats = {
        suffix: name
        for suffix, name in SUFFIXES.items()
        if suffix not in FORMATS[name].local and (stored.startswith("vol-") or name == "hdf5")
    }
    if not stored.startswith(("vol-", "ds-")):
        raise InvalidInput("id", repr(stored), "the id of a scan (ds-…) or a volume (vol-…)")
    names: dict[str, FormatName] = {**{name: name for name in formats.values()}, "h5": "hdf5"}
    if form is not None and form not in names:
        raise InvalidInput("format", repr(form), "one of " + ", ".join(names))
    chosen = formats.get(output.suffix.lower()) if form is None else names[form]
    if chosen is None:
        raise InvalidInput("output", output, "a name ending in " + ", ".join(formats) + ", or --format")
    target = output_file(output, force=force)
    defaults = {"quantity": "speed", "attenuation": "Np/m", "frequency_hz": None}
    requested = {"quantity": quantity, "attenuation": attenuation, "frequency_hz": frequency}
    how: dict[str, Any] = {name: value for name, value in requested.items() if value != defaults[name]}

    from ..client import Client

    with client_errors(), Client(url, on_wait=remark) as client, progress_bar("Downloading") as step:
        if stored.startswith("vol-"):
            client.download(stored, chosen, target, **how)
        else:
            client.download_dataset(stored, target, step)
    figures = {"id": stored, "output": str(target), "bytes": target.stat().st_size}
    print_result(figures, [str(target)], as_json=as_json)
