"""`bentray correct`: a corrected copy of a dataset file with wrong units, frequency or order of elements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options.paths import check_apart, output_file
from .options.scan_options import input_scan
from .output.terminal import AsJson, print_json, print_lines

TIMES, LENGTHS = "<s|ms|us|ns>", "<m|cm|mm|um>"


def correct(
    file: Annotated[Path, typer.Argument(help="Dataset file; it stays as it is.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Corrected dataset file to write (.h5).")],
    times_in: Annotated[
        str | None, typer.Option("--times-in", metavar=TIMES, help="Unit of the times in the original file.")
    ] = None,
    times_read_as: Annotated[
        str, typer.Option("--times-read-as", metavar=TIMES, help="Unit in which they were read.")
    ] = "s",
    positions_in: Annotated[
        str | None, typer.Option("--positions-in", metavar=LENGTHS, help="Unit of the lengths in it.")
    ] = None,
    positions_read_as: Annotated[
        str, typer.Option("--positions-read-as", metavar=LENGTHS, help="Unit in which they were read.")
    ] = "m",
    sampling_rate_hz: Annotated[
        float | None, typer.Option("--sampling-rate", help="Sampling rate of the traces, Hz.")
    ] = None,
    frequency_hz: Annotated[float | None, typer.Option("--frequency", help="Centre frequency, Hz.")] = None,
    arrangement: Annotated[
        str | None,
        typer.Option(
            "--arrangement",
            help="Fault in the order of the elements or in their positions, as the refusal of the scan names "
            "it, such as receivers-shifted-by-1, elements-grid-yx, positions-in-degrees.",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUTPUT if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Write a corrected copy of a dataset file whose units, frequency or order of elements are wrong.

    The copy passes the checks of an upload and states the correction in its source. The times are travel
    times, their deviations, the time of the first sample and the sample interval.

    Example:  bentray correct scan.h5 -o corrected.h5 --positions-in mm --positions-read-as cm
    """
    source, target = input_scan(file), output_file(output, force=force, suffix=".h5")
    check_apart({"output": target}, {"file": source})

    from bentray_workers.files.dataset import Correction, correct_dataset

    correction = Correction(
        times_in,
        times_read_as,
        positions_in,
        positions_read_as,
        sampling_rate_hz,
        frequency_hz,
        arrangement,
    )
    dataset = correct_dataset(source, target, correction)
    if as_json:
        print_json({"file": str(source), "output": str(target), "source": dataset.source})
        return
    print_lines([dataset.source, str(target)])
