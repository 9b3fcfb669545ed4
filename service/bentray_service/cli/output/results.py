"""The files of a result: `reconstruction.h5`, `.png` and `.json`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bentray_workers.files.atomic import write_bytes, write_json

from .terminal import print_json, print_lines, print_table, without_nan

if TYPE_CHECKING:
    from bentray_kernels.acquisition import Dataset
    from bentray_kernels.tomography import Reconstruction

# The misfits by which ``auto`` chooses.
CRITERIA = {"held_out_mean_s": "held-out misfit, mean", "held_out_rms_s": "held-out misfit, rms"}


def write_results(
    folder: Path,
    result: Reconstruction,
    dataset: Dataset,
    seconds: float,
    draw: Callable[[], bytes] | None = None,
    **more: object,
) -> dict[str, Any]:
    """Write the three files atomically and return the metrics, preceded by ``more``.

    The image is rendered here, or by ``draw`` after the ``.h5`` was written; the ``.json`` is written last.
    """
    from bentray_workers.files.reconstruction import write_reconstruction
    from bentray_workers.images.report import report_png

    from .figures import figures

    paths = {kind: folder / f"reconstruction.{kind}" for kind in ("h5", "png", "json")}
    facts = {
        **more,
        **figures(result, dataset, seconds),
        "outputs": {kind: str(path) for kind, path in paths.items()},
    }
    write_reconstruction(paths["h5"], result)
    png = report_png(result, dataset.truth, dataset.roi) if draw is None else draw()
    write_bytes(paths["png"], png)
    write_json(paths["json"], without_nan(facts))
    return facts


def show_results(title: str, facts: dict[str, Any], *, as_json: bool) -> None:
    """Print the summary table, the choice of ``auto`` and the paths; or all metrics as JSON.

    What makes the image doubtful comes first, then what offsets all speeds or blurs it: an assumption about
    the water, the geometry, and other cautions.
    """
    from .figures import summary

    if as_json:
        print_json(facts)
        return
    print_lines(filter(None, [facts["doubt"]]))
    print_lines(facts["provenance"][name] for name in ("water", "geometry") if name in facts["provenance"])
    print_lines(caution["text"] for caution in facts["cautions"] if not caution["doubtful"])
    print_table(title, ("figure", "value"), summary(facts))
    if facts["candidates"]:
        decides, heading = facts["criterion"], CRITERIA[facts["criterion"]]
        misfits = [row[decides] for row in facts["candidates"]]
        rows = [
            (row["label"], "" if misfit is None else f"{1e9 * misfit:.0f} ns", row["outcome"])
            for row, misfit in zip(facts["candidates"], misfits, strict=True)
        ]
        print_table("", ("candidate", heading, "result"), rows, {heading}, bold=heading)
    print_lines([*([facts["reason"]] if facts["reason"] else []), *facts["outputs"].values()])
