"""`bentray export` and `bentray download`: write a result in the format of another program, or get one."""

import shutil
from pathlib import Path
from typing import Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.export.registry import FORMATS, SINGLE_SUFFIXES, SUFFIXES, FormatName, format_of

from .options.paths import check_apart, input_file, output_file
from .output.exit_codes import client_errors
from .output.terminal import AsJson, print_result, progress_bar, remark

WRITTEN = "; ".join(f"{form.title} {', '.join(form.suffixes)}" for form in FORMATS.values())
DOWNLOADED = "; ".join(
    f"{form.title} {', '.join(suffix for suffix in form.suffixes if suffix not in form.local)}"
    for form in FORMATS.values()
)
ACCEPTED = "a reconstruction.h5, its folder, or a volume of Bentray in HDF5"

Quantity = Annotated[
    str,
    typer.Option(
        help=f"Quantity of {SINGLE_SUFFIXES}, e.g. speed or reflection; others hold all, "
        "but for the reflection, which has a grid of its own."
    ),
]
AttenuationUnit = Annotated[str, typer.Option("--attenuation", metavar="<Np/m|dB/cm/MHz>", help="Its unit.")]
AttenuationFrequency = Annotated[
    float | None,
    typer.Option("--frequency", show_default="of the scan", help="Frequency for dB/cm/MHz, Hz."),
]


def export(
    result: Annotated[Path, typer.Argument(help="reconstruction.h5, its folder, or a volume in HDF5.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help=f"File to write; the suffix is the format: {WRITTEN}.")
    ],
    quantity: Quantity = "speed",
    attenuation: AttenuationUnit = "Np/m",
    frequency: AttenuationFrequency = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUTPUT if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Write a result in the format of another program; the suffix of OUTPUT selects it.

    Example:  bentray export result/reconstruction.h5 -o speed.nii
    """
    source = input_file(result / "reconstruction.h5" if result.is_dir() else result, ACCEPTED)
    name = format_of(output)
    if output.suffix.lower() == ".zarr" and output.exists():
        raise InvalidInput("output", f"{output} (exists)", "a new folder, or a .zip with --force")
    target = output_file(output, force=force)
    check_apart({"output": target}, {"result": source})

    from bentray_workers.files.atomic import atomic_replace
    from bentray_workers.files.hdf5_reading import opened
    from bentray_workers.files.volume_export import Selection, export_volume

    selection = Selection(quantity, attenuation, frequency)
    if name == "hdf5":
        if selection.attenuation != "Np/m":
            raise InvalidInput("attenuation", attenuation, "Np/m, which HDF5 results hold, or another format")
        with opened(source), atomic_replace(target) as partial:
            shutil.copyfile(source, partial)
    else:
        export_volume(source, target=target, name=name, selection=selection)
    figures = {"result": str(source), "output": str(target), "format": name}
    print_result(figures, [str(target)], as_json=as_json)


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
