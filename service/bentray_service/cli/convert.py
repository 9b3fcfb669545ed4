"""`bentray convert`: convert a scan of another program to a dataset file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .options.paths import check_apart, input_file, output_file
from .output.terminal import AsJson, print_json, print_lines

ACCEPTED = "the path of a scan in MATLAB 5 or 7.3, .npz, a zip of k-Wave outputs, or HDF5"


def convert(
    file: Annotated[Path, typer.Argument(help="Scan file; the format is detected from its content.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset file to write (.h5).")],
    force: Annotated[bool, typer.Option("--force", help="Replace OUTPUT if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Convert a scan from another format (MATLAB, k-Wave, NumPy) into a dataset file.

    Supported are MATLAB files with delta_tof and element_positions, or with time, transducerPositionsXY and
    full_dataset; .npz files with the array names of the dataset format; and zip files of k-Wave outputs with
    geometry.npz, object/*.h5 and water/*.h5. The service accepts these formats directly.

    Example:  bentray convert scan.mat -o scan.h5
    """
    source, target = input_file(file, ACCEPTED), output_file(output, force=force, suffix=".h5")
    check_apart({"output": target}, {"file": source})

    from bentray_workers.foreign_scans import convert_dataset

    dataset = convert_dataset(source, target)
    summary: dict[str, Any] = {
        "file": str(source),
        "output": str(target),
        "source": dataset.source,
        "elements": len(dataset.element_position_m),
        "emissions": len(dataset.tx),
        "receptions": len(dataset.rx),
        "slices": dataset.slices,
        "traces": dataset.waveform is not None,
        "travel_times": dataset.picked,
        "water_speed_mps": dataset.water_speed_mps,
    }
    if as_json:
        print_json(summary)
        return
    print_lines([f"{name}: {value}" for name, value in summary.items() if value not in (str(target), "")])
    print_lines([str(target)])
