"""Figure 31 of the dissertation and its errors, compared with ours."""

from collections.abc import Iterable

from bentray_kernels.phantoms import TABLE6_SIDE_M
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.simulation.plane import SimulationSettings

from ._ladder import BESIDE, FAT_MPS, LADDER, THEIRS, TUNED, WATER_MPS, ladder_step
from ._phantom_scan import PhantomScan, ReconstructionError
from ._sections_picture import Panel, picture

# Of the attenuation, as root mean square over the range; its prose says less than 7 %.
THEIR_ATTENUATION = 0.07

# Its hard case of noise.
SNR = 10.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Mean absolute errors of Figure 31, and with SNR 10, in two couplings; the goal is theirs."""
    nodes, elements = (64, 64) if context.quick else (128, 256)
    panels: list[Panel] = []
    for coupling in (FAT_MPS, WATER_MPS):
        for snr in (None, SNR):
            asked = SimulationSettings(
                nodes=nodes, elements=elements, coupling_mps=coupling, attenuation=True, snr=snr
            )
            scan = PhantomScan.of_table6(asked, context.progress)
            noise = "" if snr is None else f", SNR {snr:g}"
            where = f"coupling {coupling:g}{noise}"
            if snr is None:
                panels.append(Panel(f"phantom in {coupling:g} m/s", scan.truth))
            for name in LADDER:
                if snr is not None and name not in ("straight", "HAFMM data-driven"):
                    continue
                error = ladder_step(scan, name)
                detail = f"theirs {THEIRS[name]:g} %, noise-free; {error.how}"
                yield speed_row(scan, f"{name}, {where}", error, THEIRS[name], detail)
                panels.append(Panel(f"{name}{noise}\n{error.mae_percent:.1f} %", error.result.speed))
            for name in BESIDE if snr is None else ():
                error = ladder_step(scan, name)
                yield speed_row(scan, f"{name}, {where}", error, THEIRS["fixed"], error.how)
            images = {"default": scan.run_default(), "tuned": scan.run("tuned", **TUNED)}
            for name, error in images.items():
                goal = THEIRS["HAFMM data-driven"]
                yield speed_row(scan, f"{name}, {where}", error, goal, error.how, tuned=name == "tuned")
                panels.append(
                    Panel(f"{name}{noise}\n{error.mae_percent:.1f} %", error.result.speed, error.side_m)
                )
            loss = scan.compared(images["default"], scan.attenuation_rms)
            detail = f"theirs below 7 %; {images['default'].how}"
            target = f"Figure 31 attenuation, {where}"
            yield loss.row(target, loss.error, THEIR_ATTENUATION, "<=", "of range", detail)
    title = "2-D breast phantom (Li 2008, Table 6), mean absolute error"
    context.save_picture("chapter6.png", lambda: picture(title, panels, 11, TABLE6_SIDE_M))


def speed_row(
    scan: PhantomScan,
    label: str,
    error: ReconstructionError,
    goal: float,
    detail: str,
    *,
    tuned: bool = False,
) -> Row:
    """Mean absolute error beside its baselines."""
    mean = scan.compared(error, scan.mean_absolute)
    return mean.row(f"Figure 31 {label}", mean.error, goal, "<=", "% of range", detail, tuned=tuned)
