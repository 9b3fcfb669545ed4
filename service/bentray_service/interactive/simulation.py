"""Simulation of the scan of a phantom in this process."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from .interruption import OnProgress, Stop, run_interruptibly
from .progress_bar import progress_bar
from .scan import Scan, temporary_scan

if TYPE_CHECKING:
    from .setting_types import PhantomName, SimulationSettings


def simulate(
    phantom: PhantomName = "table6", *, progress: bool = True, **settings: Unpack[SimulationSettings]
) -> Scan:
    """Simulate travel times or traces of a phantom; the scan includes the truth.

    Args:
        phantom: ``table6``: 2-D breast (Li 2008, Table 6); ``table6-vertical``: its vertical slice;
            ``detailed``: 2-D with skin and glandular texture; ``breast``: the same with large lesions;
            ``table7``: 3-D breast (Li 2008, Table 7).
        progress: show a progress bar.
        settings: ``nodes`` along a side of the truth (128), ``elements`` of the ring (256), ``coupling_mps``,
            the speed of the water (1500), ``snr``, a ratio of amplitudes (no noise), ``seed``,
            ``attenuation`` (record amplitudes too), ``noise_s``, the standard deviation of the times, s;
            ``waveform`` (traces in place of times) with ``frequency_hz`` of the pulse, ``emissions``, the
            number of emitting elements, and ``side_m`` of the simulated square, m; of table7 ``slices``,
            ``array`` and ``three_d``.

    Returns:
        The scan, with times or traces over (emitters, receivers) and the truth (nx, ny[, nz]), in SI units.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted; for an unknown name the one that is
            spelt most like it.
        KeyboardInterrupt: once the tasks have stopped.
    """
    from bentray_workers.compilation.cache_misses import announce
    from bentray_workers.simulation.request import PhantomScan
    from bentray_workers.simulation.simulation_run import simulate_to_file

    from ..settings_request import plain_numbers, record_of

    request = record_of(PhantomScan, plain_numbers({"phantom": phantom, **settings})).chosen()
    announce()

    def write(target: Path) -> None:
        with progress_bar("Simulating", shown=progress) as step:

            def work(report: OnProgress, stop: Stop) -> None:
                simulate_to_file(None, request, target, on_progress=report, stop=stop)

            run_interruptibly(work, lambda now: step(now.done, now.total, "tasks"))

    return temporary_scan(phantom, write)
