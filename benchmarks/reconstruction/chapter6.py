"""Figure 31 of the dissertation and its errors, compared with ours."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bentray_kernels.phantoms import TABLE6_SIDE_M
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.atomic import write_bytes
from bentray_workers.simulation.plane import SimulationSettings

from ._ladder import BESIDE, BEST, FAT_MPS, LADDER, THEIRS, WATER_MPS, ladder_step
from ._phantom_scan import PhantomScan
from ._sections_picture import Panel, picture

PICTURE = Path(__file__).parents[1] / "results" / "chapter6.png"

# Of the attenuation, as root mean square over the range; its prose says less than 7 %.
THEIR_ATTENUATION = 0.07

# Its hard case of noise.
SNR = 10.0


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """Mean absolute errors of Figure 31, and with SNR 10, in two couplings; the goal is theirs."""
    nodes, elements = (64, 64) if quick else (128, 256)
    panels: list[Panel] = []
    for coupling in (FAT_MPS, WATER_MPS):
        for snr in (None, SNR):
            asked = SimulationSettings(
                nodes=nodes, elements=elements, coupling_mps=coupling, attenuation=True, snr=snr
            )
            scan = PhantomScan.of_table6(asked, progress)
            noise = "" if snr is None else f", SNR {snr:g}"
            where = f"coupling {coupling:g}{noise}"
            if snr is None:
                panels.append(Panel(f"phantom in {coupling:g} m/s", scan.truth))
            for name in LADDER:
                if snr is not None and name not in ("straight", "HAFMM data-driven"):
                    continue
                found = ladder_step(scan, name, progress)
                detail = f"theirs {THEIRS[name]:g} %, noise-free; {found.how}"
                yield Row(
                    f"Figure 31 {name}, {where}", found.mae_percent, THEIRS[name], "<=", "% of range", detail
                )
                panels.append(Panel(f"{name}{noise}\n{found.mae_percent:.1f} %", found.result.speed))
            for name in BESIDE if snr is None else ():
                found = ladder_step(scan, name, progress)
                goal = THEIRS["fixed"]
                yield Row(
                    f"Figure 31 {name}, {where}", found.mae_percent, goal, "<=", "% of range", found.how
                )
            default = scan.run(progress, "default")
            panels.append(Panel(f"default{noise}\n{default.mae_percent:.1f} %", default.result.speed))
            best = scan.run(progress, "best", **BEST)
            panels.append(Panel(f"best{noise}\n{best.mae_percent:.1f} %", best.result.speed))
            goal = THEIRS["HAFMM data-driven"]
            yield Row(f"Figure 31 best, {where}", best.mae_percent, goal, "<=", "% of range", best.how)
            detail = f"theirs below 7 %; {default.how}"
            yield Row(
                f"Figure 31 attenuation, {where}",
                default.attenuation_rmse,
                THEIR_ATTENUATION,
                "<=",
                "of range",
                detail,
            )
    if not quick:
        PICTURE.parent.mkdir(exist_ok=True)
        write_bytes(
            PICTURE,
            picture(
                "2-D breast phantom (Li 2008, Table 6), mean absolute error",
                panels,
                11,
                TABLE6_SIDE_M,
            ),
        )
