"""`bentray convert` and `bentray correct`: dataset files of scans of other programs, or with wrong units."""

from pathlib import Path
from typing import Annotated, Any

import typer

from .options.paths import check_apart, output_file
from .options.scan_options import input_scan, metadata_of, with_scan_options
from .output.terminal import AsJson, print_result

TIMES, LENGTHS = "<s|ms|us|ns>", "<m|cm|mm|um>"


@with_scan_options
def convert(
    file: Annotated[Path, typer.Argument(help="Scan; the format is detected from its content.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset file to write (.h5).")],
    scan_options: dict[str, Any],
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
    given = metadata_of(scan_options)

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
    lines = [f"{name}: {value}" for name, value in summary.items() if value not in (str(target), "")]
    print_result(summary, [*lines, str(target)], as_json=as_json)


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

    units = times_in, times_read_as, positions_in, positions_read_as
    correction = Correction(*units, sampling_rate_hz, frequency_hz, arrangement)
    dataset = correct_dataset(source, target, correction)
    figures = {"file": str(source), "output": str(target), "source": dataset.source}
    print_result(figures, [dataset.source, str(target)], as_json=as_json)
