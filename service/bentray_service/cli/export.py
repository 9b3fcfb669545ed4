"""`bentray export`: write a result or a volume in the format of another program."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import typer

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.export.registry import FORMATS, SINGLE_SUFFIXES, format_of

from .options.paths import check_apart, input_file, output_file
from .output.terminal import AsJson, print_result

WRITTEN = "; ".join(f"{form.title} {', '.join(form.suffixes)}" for form in FORMATS.values())
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
