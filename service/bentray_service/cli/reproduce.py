"""`bentray reproduce`: repeat a reconstruction and compare the result bit by bit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options.paths import input_file
from .output.exit_codes import WorkFailed
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar, progress_shown
from .reconstruct import run

if TYPE_CHECKING:
    from bentray_kernels.tomography import Reconstruction


def reproduce(
    result: Annotated[Path, typer.Argument(help="A reconstruction.h5, made here or on another machine.")],
    scan: Annotated[Path, typer.Argument(help="The dataset file it was made from.")],
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            show_default="number of parallel tasks, at most one per core",
            help="Worker processes; 1 runs in this process. The result does not depend on it.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Repeat a reconstruction with its own settings, and compare every array.

    The exit code is 0 if all arrays are identical, else 1. Other versions of Python, NumPy or Numba, or
    another processor, may round differently.

    Example:  bentray reproduce result/reconstruction.h5 scan.h5
    """
    from bentray_kernels.tomography.reconstruction import provenance
    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.files.reconstruction import read_reconstruction

    record, source = input_file(result), input_file(scan)
    before, dataset = read_reconstruction(record), read_dataset(source, traces=False)
    with progress_bar("Reproducing") as step:
        after = run(source, dataset, before.settings, workers, progress_shown(step))
    differences = compared(before, after)
    here = provenance()
    other = {
        name: {"then": then, "now": here[name]}
        for name, then in before.provenance.items()
        if name in here and then != here[name]
    }
    if as_json:
        print_json(
            {"result": str(record), "scan": str(source), "differences": differences, "versions": other}
        )
    else:
        print_table(
            f"{record.name}, made again",
            ("array", "difference"),
            [(k, difference_text(v)) for k, v in differences.items()],
        )
        print_lines(f"{name}: {was['then']} then, {was['now']} now" for name, was in other.items())
    if any(differences.values()):
        raise WorkFailed(f"{record.name} was not reproduced" + _reason(differences, bool(other)))


def compared(before: Reconstruction, after: Reconstruction) -> dict[str, Any]:
    """The difference of each array: None if identical, the maximum difference, or a description."""
    import numpy as np

    from bentray_workers.files.quantities import IMAGES, REFLECTION

    differences: dict[str, Any] = {}
    held: list[dict[str, Any]] = [
        {place: getattr(result, name) for name, place in {**IMAGES, "residuals": "residuals"}.items()}
        | {REFLECTION: result.reflection and result.reflection.db}
        for result in (before, after)
    ]
    for place, old in held[0].items():
        new = held[1][place]
        if old is None and new is None:
            continue
        if old is None or new is None:
            differences[place] = "only then" if new is None else "only now"
        elif old.shape != new.shape:
            differences[place] = f"shape {old.shape} then, {new.shape} now"
        elif np.array_equal(old, new, equal_nan=True):
            differences[place] = None
        else:
            differences[place] = float(np.nanmax(np.abs(old - new), initial=0.0)) or "NaN at other nodes"
    old_rms, new_rms = ([sweep.residual_rms_s for sweep in one.history] for one in (before, after))
    differences["history"] = None if old_rms == new_rms else "different residuals"
    return differences


def difference_text(difference: float | str | None) -> str:
    """Description of a difference."""
    if difference is None:
        return "identical"
    return difference if isinstance(difference, str) else f"at most {difference:.3g}"


def _reason(found: dict[str, Any], other_versions: bool) -> str:
    if other_versions:
        return ": it was created with other versions"
    if found["speed_mps"] and found["history"]:
        return ": the scan may be another one"
    return ""
