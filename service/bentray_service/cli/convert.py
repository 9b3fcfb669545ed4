"""`bentray convert`: convert a scan of another program to a dataset file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .options.paths import check_apart, output_file
from .options.scan_options import ScanOptions, input_scan, with_scan_options
from .output.terminal import AsJson, print_json, print_lines


@with_scan_options
def convert(
    file: Annotated[Path, typer.Argument(help="Scan; the format is detected from its content.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset file to write (.h5).")],
    scan_options: ScanOptions,
    force: Annotated[bool, typer.Option("--force", help="Replace OUTPUT if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Convert a scan of another program into a dataset file.

    The documentation of scan files lists the formats with their variables and units: MATLAB, NumPy, k-Wave,
    zea (OpenH-RF), openUSCT, KIT 3D USCT. They are detected by content; reconstruct and submit take them too.

    Own variables are named by --map, with a field of element_position, delta_tof, tof, sigma, object (the
    traces), water, time, sampling_rate, t0, tx, rx, center_frequency, temperature, sound_speed, log_ratio
    and valid.

    Example:  bentray convert scan.mat -o scan.h5 --map element_position=pos --map delta_tof=dtof --unit mm
    """
    source, target = input_scan(file), output_file(output, force=force, suffix=".h5")
    check_apart({"output": target}, {"file": source})
    given = scan_options.metadata()

    from bentray_workers.foreign_scans import convert_dataset

    dataset = convert_dataset(source, target, given=given)
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
