"""Figures 32 and 33 of the dissertation and their errors, compared with ours, with SNR 10."""

from collections.abc import Iterable

from bentray_kernels.phantoms import TABLE7_SIDE_M
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ._ladder import FAT_MPS, TUNED, WATER_MPS
from ._phantom_scan import PhantomScan
from ._sections_picture import Panel, picture

# Root mean square errors over the range, on data of a wave equation; ours are on Eikonal times.
THEIRS = {"straight": 0.25, "SART": 0.04, "default": 0.04, "tuned": 0.04}
THEIR_ATTENUATION = 0.075

# Heights of Figure 32, m: near the centre, and near the bottom.
HEIGHTS = {"centre": 0.0, "bottom": 0.02}
WAYS: dict[str, dict[str, object]] = {"straight": {"rays": "straight"}, "SART": {}, "tuned": TUNED}
SNR = 10.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Errors of two slices in two couplings, and of the one at the centre with SNR 10; the goal is theirs."""
    nodes, elements = (64, 64) if context.quick else (128, 256)
    panels: list[Panel] = []
    cases = [(c, z, None) for c in (FAT_MPS, WATER_MPS) for z in HEIGHTS]
    cases += [(c, "centre", SNR) for c in (FAT_MPS, WATER_MPS)]
    for coupling, height, snr in cases:
        scan = PhantomScan.of_table7(HEIGHTS[height], nodes, elements, coupling, snr, context.progress)
        where = f"{height}, coupling {coupling:g}" + ("" if snr is None else f", SNR {snr:g}")
        panels.append(Panel(f"{height} in {coupling:g} m/s", scan.truth))
        images = {name: scan.run(name, **changes) for name, changes in WAYS.items()}
        for name, error in (images | {"default": scan.run_default()}).items():
            noise = "" if snr is None else f", SNR {snr:g}"
            panels.append(
                Panel(f"{name}{noise}\n{error.whole_image_rmse:.3f}", error.result.speed, error.side_m)
            )
            detail = f"theirs {THEIRS[name]:g} of the whole image; {error.how}"
            tuned = name == "tuned"
            for region, error_on in (("whole image", scan.whole_image_rms), ("inside the breast", scan.rms)):
                shown = scan.compared(error, error_on)
                target = f"Figure 32 {name}, {region}, {where}"
                yield shown.row(target, shown.error, THEIRS[name], "<=", "of range", detail, tuned=tuned)
            if name == "default":
                loss = scan.compared(error, scan.attenuation_rms)
                detail = f"inside the breast; theirs {THEIR_ATTENUATION:g} of the whole image"
                target = f"Figure 33 attenuation, {where}"
                yield loss.row(target, loss.error, THEIR_ATTENUATION, "<=", "of range", detail)
    title = "3-D breast phantom (Li 2008, Table 7), rms error over the range"
    columns = 2 * (2 + len(WAYS))
    context.save_picture("chapter7.png", lambda: picture(title, panels, columns, TABLE7_SIDE_M))
