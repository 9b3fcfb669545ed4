"""`bentray compare`: compare a result with the truth, or with another result."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .options.paths import check_apart, input_file, output_file
from .output.terminal import AsJson, print_json, print_lines, print_table

if TYPE_CHECKING:
    from bentray_kernels.tomography import RegionStatistics

    from ..interactive.comparison import Comparison

ACCEPTED = "a reconstruction.h5 or its folder"
REGION = "X,Y,RADIUS or X,Y,Z,RADIUS in mm, e.g. -20,12,6"


def compare(
    result: Annotated[Path, typer.Argument(help="reconstruction.h5, or its folder.")],
    truth: Annotated[
        Path,
        typer.Argument(
            help="Dataset with a truth, another reconstruction.h5, or speeds in m/s as .npy, .npz, .nrrd, "
            ".nii or a volume in HDF5."
        ),
    ],
    quantity: Annotated[str, typer.Option(metavar="<speed|attenuation>", help="Quantity.")] = "speed",
    region: Annotated[
        list[str] | None,
        typer.Option(
            help="Statistics and contrast of a disc or ball: " + REGION + "; repeatable.",
            metavar="X,Y[,Z],RADIUS",
            show_default="none",
        ),
    ] = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            help="Node spacing of a NumPy file, m; it is then centred on 0.", show_default="nodes of RESULT"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File for the picture, .png.", show_default="no picture"),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the picture if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Compare a result with the truth: errors inside the object, similarity, statistics and lesion contrast.

    RMSE, mean absolute error (MAE), bias, SSIM (windows of 7 by 7 nodes) and Pearson's correlation (PCC) over
    the region of interest of the file, else the object. Without registration: both have one system of
    coordinates.

    Example:  bentray compare result scan.h5 --region -20,12,6 -o comparison.png
    """
    source = input_file(result / "reconstruction.h5" if result.is_dir() else result, ACCEPTED)
    other = truth / "reconstruction.h5" if truth.is_dir() else truth
    regions = [_region(text) for text in region or ()]
    if output is not None:
        output = output_file(output, force=force, suffix=".png")
        check_apart({"output": output}, {"result": source, "truth": other})

    from bentray_kernels.tomography import RoundRegion
    from bentray_workers.files.atomic import write_bytes

    from ..interactive.result import load

    compared = load(source).compare(other, quantity, spacing_m=spacing)
    record = _figures(compared, regions)
    if output is not None:
        write_bytes(output, compared.to_png())
    if as_json:
        paths = {"result": str(source), "truth": str(other), "output": output and str(output)}
        print_json({**paths, **record})
        return
    unit = compared.unit
    rows = [
        ("RMSE", f"{record['rmse']:.4g} {unit}"),
        ("MAE", f"{record['mean_absolute_error']:.4g} {unit}"),
        ("bias", f"{record['bias']:.4g} {unit}"),
        ("SSIM", _number(record["ssim"])),
        ("PCC", _number(record["correlation"])),
        ("region", f"{record['region']}, {record['nodes']} nodes"),
    ]
    print_table(f"{result}: {quantity} against {truth}", ("figure", "value"), rows)
    columns = ("statistics", "size", "result", "truth", "contrast: result", "truth")
    shown = [(compared.region_choice, *compared.statistics())]
    shown += [(str(RoundRegion(*region)), *compared.statistics(*region)) for region in regions]
    print_table("", columns, [_row(*row, unit, compared.image.ndim) for row in shown])
    if output is not None:
        print_lines([str(output)])


def _figures(compared: Comparison, regions: list[tuple[tuple[float, ...], float]]) -> dict[str, Any]:
    names = ("image", "truth")
    return {
        "quantity": compared.quantity,
        "unit": compared.unit,
        "region": compared.region_choice,
        "nodes": int(compared.region.sum()),
        "rmse": compared.rms,
        "mean_absolute_error": compared.mean_absolute,
        "bias": compared.bias,
        "largest": compared.largest,
        "ssim": compared.ssim,
        "correlation": compared.correlation,
        "statistics": dict(zip(names, map(asdict, compared.statistics()), strict=True)),
        "regions": [
            {"centre_m": list(centre), "radius_m": radius}
            | dict(zip(names, map(asdict, compared.statistics(centre, radius)), strict=True))
            for centre, radius in regions
        ],
    }


def _region(text: str) -> tuple[tuple[float, ...], float]:
    """Centre and radius, m, of an option in mm."""
    try:
        *centre, radius = (1e-3 * float(number) for number in text.split(","))
    except ValueError:
        raise InvalidInput("--region", repr(text), REGION) from None
    if len(centre) not in (2, 3) or not all(map(math.isfinite, centre)) or not 0.0 < radius < math.inf:
        raise InvalidInput("--region", repr(text), REGION)
    return tuple(centre), radius


def _row(
    name: str, image: RegionStatistics, truth: RegionStatistics, unit: str, dimensions: int
) -> tuple[str, ...]:
    size = f"{1e6 * image.size:.4g} mm²" if dimensions == 2 else f"{1e9 * image.size:.4g} mm³"
    means = [f"{region.mean:.6g} ± {region.spread:.3g} {unit}" for region in (image, truth)]
    if image.uncertainty is not None:
        means[0] += f", uncertain by {image.uncertainty:.2g}"
    contrasts = ["none" if one.contrast is None else f"{one.contrast:+.4g} {unit}" for one in (image, truth)]
    return (name, size, *means, *contrasts)


def _number(value: float) -> str:
    return f"{value:.4f}" if math.isfinite(value) else "none"
