"""Reconstruction of a scan in this process, by the pipeline of the service."""

from __future__ import annotations

import os
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from bentray_kernels.tomography.result import Reconstruction

from .interruption import OnProgress, Stop, run_interruptibly
from .progress_bar import progress_bar, progress_shown
from .result import Result, result_of
from .scan import Scan, read

if TYPE_CHECKING:
    from .setting_types import Method, ReconstructionSettings

MOST_THREADS = 1024


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
    from bentray_workers.compilation.cache_misses import announce
    from bentray_workers.reconstruction.reconstruction_run import reconstruct as run

    from ..settings_request import nested, plain_numbers, settings_of

    chosen = settings_of(nested(plain_numbers({"method": method, **settings})))
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
