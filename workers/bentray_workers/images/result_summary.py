"""Summary of a reconstruction: its quantities, the choice of the model, and the errors against the truth."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..files.dataset.read import read_dataset
from ..files.quantities import QUANTITIES
from ..files.reconstruction import read_reconstruction


def result_summary(volume: Path, *, scan: Path) -> dict[str, Any]:
    """Task: the summary of a reconstruction as plain values.

    Args:
        volume: its file.
        scan: file of its scan.

    Returns:
        ``quantities``: those in the file, and ``truth`` if the scan has one on comparable axes;
        ``trust``: how far to trust the image, in one line;
        ``resolution_width_m``: of each slice, or one, m; empty without uncertainty;
        ``cautions``: what the reader must know, each with ``code``, ``text`` and whether it makes the image
        ``doubtful``;
        ``grids``: shape, spacing and origin of quantities whose grid is not that of the speed;
        ``candidates``: rows of ``choice_table``; ``criterion``: the name of the misfit that decided;
        ``reason``: of this choice; all empty without candidates; ``misfit_over_noise``: of held-out data,
        where full waveforms are advised, else None; ``automatic``: what was decided automatically, and why,
        empty in older files; ``truth``: None without a truth, else ``region``,
        ``nodes``, errors, similarities (None if they do not exist), mean and spread of image and truth there;
        or ``region`` with the reason why it is not compared, and ``nodes``.

    Raises:
        InvalidInput: naming the field of a file.
    """
    # Loaded only where it runs.
    from bentray_kernels.tomography.comparison import NotComparable, compare
    from bentray_kernels.tomography.model_selection.selection import advice_of, choice_table, criterion
    from bentray_kernels.tomography.result import EXCESS

    own, dataset = read_reconstruction(volume), read_dataset(scan, traces=False)
    held = {name: image for name in QUANTITIES if (image := own.image(name)) is not None}
    quantities = list(held)
    errors: dict[str, Any] | None = None
    if dataset.truth is not None:
        try:
            comparison = compare(own, dataset.truth, dataset.roi)
        except NotComparable as reason:
            errors = {"region": f"not compared: {reason}", "nodes": 0}
        else:
            quantities.append("truth")
            here, true = comparison.statistics()
            errors = {
                "region": comparison.region_choice,
                "nodes": int(comparison.region.sum()),
                "rmse_mps": comparison.rms,
                "mean_absolute_error_mps": comparison.mean_absolute,
                "ssim": _number(comparison.ssim),
                "correlation": _number(comparison.correlation),
                "mean_mps": here.mean,
                "spread_mps": here.spread,
                "uncertainty_mps": here.uncertainty,
                "true_mean_mps": true.mean,
                "true_spread_mps": true.spread,
            }
    return {
        "quantities": quantities,
        "trust": own.trust,
        "resolution_width_m": list(own.resolution_width_m),
        "cautions": [asdict(caution) for caution in own.cautions],
        "grids": {
            name: {
                "shape": list(image.values.shape),
                "spacing_m": _or_none(image.spacing_m),
                "origin_m": _or_none(image.origin_m),
            }
            for name, image in held.items()
            if image.values.shape != own.speed.shape
        },
        "reason": advice_of(own),
        "automatic": own.provenance.get("automatic", ""),
        "candidates": choice_table(own),
        "criterion": criterion(own.trials),
        "misfit_over_noise": float(own.provenance[EXCESS]) if EXCESS in own.provenance else None,
        "truth": errors,
    }


def _number(value: float) -> float | None:
    """A number for JSON."""
    return value if math.isfinite(value) else None


def _or_none(lengths: tuple[float, ...]) -> list[float | None]:
    """Lengths for JSON; None for the uneven spacing of heights."""
    return [_number(length) for length in lengths]
