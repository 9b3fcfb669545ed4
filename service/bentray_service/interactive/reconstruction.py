"""Reconstruction of a scan and simulation of one in this process, by the pipelines of the service."""

from __future__ import annotations

import os
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, Unpack

from bentray_kernels.tomography.result import Progress, Reconstruction

from .progress_bar import progress_bar, progress_shown
from .result import Result, result_of
from .scan import Scan, read, temporary_scan

if TYPE_CHECKING:
    from .setting_types import Method, PhantomName, ReconstructionSettings, SimulationSettings

MOST_THREADS = 1024
# Between two looks at the progress, and between two calls of ``show`` without a new one, s.
LOOK_S, SHOW_S = 0.1, 1.0

T = TypeVar("T")
OnProgress = Callable[[Progress], None]
Stop = Callable[[], bool]


class DoubtfulWarning(UserWarning):
    """A result is doubtful; ``Result.cautions`` has the reasons."""


def reconstruct(
    scan: Scan | str | os.PathLike[str],
    method: Method = "auto",
    *,
    progress: bool = True,
    threads: int | None = None,
    **settings: Unpack[ReconstructionSettings],
) -> Result:
    """Reconstruct the sound speed, and the attenuation where there are amplitudes (experimental).

    The computation is that of the service and of ``bentray reconstruct``: the same scan and settings give the
    same bits.

    Args:
        scan: of ``bentray.read`` or ``bentray.simulate``, or the path of a scan.
        method: ``auto`` chooses method and rays by held-out validation; ``sart``; ``gauss-newton``;
            ``waveform``: full-waveform inversion of traces.
        progress: show a progress bar.
        threads: of this process; None: one for each core.
        settings: as in the table of settings, each by the last part of its name: ``rays="straight"``,
            ``iterations=8``, ``penalty_strength=0.5``, ``attenuation=False``.

    Returns:
        The result: ``speed`` (nx, ny[, nz]) in m/s and ``coverage`` in m; with amplitudes ``attenuation`` in
        Np/m; and, by their settings, ``recovery``, ``uncertainty`` in m/s and ``reflection`` in dB. Of a
        doubtful image a warning says why, as do ``cautions`` and the first line of its text.

    Raises:
        InvalidInput: naming the setting or the field of the scan, its value and what is accepted; for an
            unknown setting the one that is spelt most like it.
        KeyboardInterrupt: once the tasks have stopped, which takes up to a few seconds.
    """
    from bentray_kernels.requests.ranges import Range
    from bentray_kernels.tomography.requirements import check_scan
    from bentray_kernels.tomography.settings import Settings
    from bentray_workers.compilation.cache_misses import announce
    from bentray_workers.reconstruction.reconstruction_run import reconstruct as run

    from ..settings_request import nested, plain_numbers, record_of

    chosen = record_of(Settings, nested(plain_numbers({"method": method, **settings})))
    if threads is not None:
        Range(1, MOST_THREADS).check("threads", threads)
    source = scan if isinstance(scan, Scan) else read(scan)
    check_scan(source.dataset, chosen, source.samples)
    announce()
    begun = time.perf_counter()
    with progress_bar("Reconstructing", shown=progress) as step:

        def work(report: OnProgress, stop: Stop) -> Reconstruction:
            return run(None, Path(source), chosen, report, stop, threads=threads)

        image = run_interruptibly(work, progress_shown(step))
    if image.doubt:
        warnings.warn(image.doubt, DoubtfulWarning, stacklevel=2)
    told = {"title": source.title, "scan": source.name, "seconds": f"{time.perf_counter() - begun:.2f}"}
    given = {name: text for name, text in told.items() if text}
    return result_of(image, given, truth=source.truth, roi=source.dataset.roi)


def run_interruptibly(work: Callable[[OnProgress, Stop], T], show: OnProgress) -> T:
    """Run ``work`` in a thread, so that an interruption never breaks into its files and tasks.

    Args:
        work: called with a function that reports progress, and one that it polls several times a second;
            once this is true it raises ``Cancelled``.
        show: called with the latest progress in the calling thread, where notebooks expect output; at least
            once a second, so that a clock moves.

    Returns:
        The result of ``work``.

    Raises:
        KeyboardInterrupt: after ``work`` has stopped; a second Ctrl-C does not wait for it.
        BaseException: what ``work`` raises.
    """
    stop, reported, result = threading.Event(), deque[Progress](maxlen=1), Future[T]()

    def run() -> None:
        try:
            result.set_result(work(reported.append, stop.is_set))
        except BaseException as error:
            result.set_exception(error)

    # Of a daemon nobody waits for the end, unlike of the threads of an executor.
    running = threading.Thread(target=run, name="bentray", daemon=True)
    running.start()
    shown, at = Progress(0, 0), time.monotonic()
    try:
        while running.is_alive():
            running.join(LOOK_S)
            newest = reported[-1] if reported else shown
            if newest is not shown or (running.is_alive() and time.monotonic() - at >= SHOW_S):
                shown, at = newest, time.monotonic()
                show(shown)
    except KeyboardInterrupt:
        stop.set()
        running.join()
        raise
    return result.result()


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
