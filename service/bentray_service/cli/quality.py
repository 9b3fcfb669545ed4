"""`bentray quality`: check the data quality of a scan."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from bentray_kernels.requests.limits import MAX_LEFT_OUT
from bentray_kernels.requests.names import DEFAULT_PICKER, PickerName

from .options.paths import output_folder
from .options.scan_options import dataset_file, input_scan, metadata_of, with_scan_options
from .output.exit_codes import WorkFailed
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar


@with_scan_options
def quality(
    file: Annotated[Path, typer.Argument(help="Dataset file, or a scan of another program.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output folder; created if missing.")],
    scan_options: dict[str, Any],
    picker: Annotated[
        PickerName, typer.Option(help="Picker of first arrivals in raw traces.")
    ] = DEFAULT_PICKER,
    calibrate: Annotated[
        Literal["stated", "fitted"] | None,
        typer.Option(
            help="Calibrate positions and delays from the water shot, with stated or fitted water speed, "
            "the size of the array as drawn.",
            show_default="no calibration",
        ),
    ] = None,
    max_left_out: Annotated[
        float, typer.Option(help="Largest share of the pairs that may be left out of a usable scan, 0 to 1.")
    ] = MAX_LEFT_OUT,
    as_json: AsJson = False,
) -> None:
    """Check the data quality of a scan: report in OUTPUT/quality.json and .png, corrected scan in picked.h5.

    Finds dead elements, swapped and inverted channels, wrong time zeros, cycle skips, outliers and more;
    they are left out or corrected in picked.h5. The exit code is 1 for an unusable scan, as one of which more
    than a third of the pairs is left out.
    With --calibrate, also writes calibration.json; picked.h5 has the fitted positions and water speed.

    Example:  bentray quality scan.h5 -o report
    """
    source, folder = input_scan(file), output_folder(output)
    given = metadata_of(scan_options)

    from bentray_workers.files.atomic import write_bytes, write_json
    from bentray_workers.files.dataset import write_dataset
    from bentray_workers.reconstruction.quality_report import calibrate_file, examine_file

    calibration = None
    with dataset_file(source, given, folder) as scan, progress_bar("Examining") as step:
        if calibrate is None:
            report = examine_file(scan, picker, step, max_left_out=max_left_out)
        else:
            fitted_speed = calibrate == "fitted"
            report, calibration = calibrate_file(
                scan, picker, step, fit_speed=fitted_speed, max_left_out=max_left_out
            )
    paths = {kind: folder / f"quality.{kind}" for kind in ("json", "png")}
    if report.picked is not None:
        paths["h5"] = folder / "picked.h5"
        write_dataset(paths["h5"], report.picked)
    if calibration is not None:
        paths["calibration"] = folder / "calibration.json"
        write_json(paths["calibration"], calibration.to_dict())
    summary: dict[str, Any] = {
        "file": str(source),
        **report.report,
        "outputs": {kind: str(path) for kind, path in paths.items()},
    }
    write_bytes(paths["png"], report.page)
    write_json(paths["json"], summary)
    if as_json:
        print_json(summary)
    else:
        lines = [(f["check"], f["found"], _elements(f), f["action"]) for f in report.report["findings"]]
        title = f"{source.name}: {report.report['verdict']}"
        if lines:
            print_table(title, ("check", "found", "elements", "done"), lines)
        else:
            print_lines([title])
        checked = f"checked: {', '.join(report.report['checked'])}"
        usable = f"{report.report['usable_pairs']} of {report.report['pairs']} pairs usable"
        excluded = [f"not checked: {name}, {why}" for name, why in report.report["not_checked"].items()]
        print_lines([checked, *excluded, usable, *summary["outputs"].values()])
    if report.picked is None:
        refused = next(f for f in report.report["findings"] if f["action"] == "refused")
        raise WorkFailed(f"{refused['check']}: {refused['found']}; accepted: {refused['accepted']}")


def _elements(finding: dict[str, Any]) -> str:
    return ", ".join(map(str, finding["elements"][:8])) + (", …" if len(finding["elements"]) > 8 else "")
