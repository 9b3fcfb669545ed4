"""Travel times through a phantom from a finer grid; each emitter is kept in a file."""

import hashlib
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path

import numpy as np

from bentray_kernels.acquisition.simulation.ring_scan import TravelTimeScan
from bentray_kernels.acquisition.simulation.volume_scan import VolumeScan
from bentray_kernels.arrays import Floats
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.atomic import write_bytes

# A folder of each scan; deleting it only costs the time.
FOLDER = Path(__file__).resolve().parents[2] / "build" / "kept_times"


def travel_times(
    scan: TravelTimeScan | VolumeScan, emitters: Sequence[int], progress: Step, threads: int | None = None
) -> Floats:
    """Object minus water travel time to every element, (emitters, elements), s; those in files are read.

    Those of ``FineMedium.arrivals``, of factored second order.

    Args:
        scan: of a slice, or in space.
        emitters: indices into its elements.
        progress: called after each emitter.
        threads: of this process; None: one for each core.
    """
    # The representation holds all numbers of phantom, ring and grid.
    folder = FOLDER / hashlib.sha256(repr(scan).encode()).hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{emitter}.npy" for emitter in emitters]
    missing = [emitter for emitter, file in zip(emitters, files, strict=True) if not file.exists()]
    if missing:
        medium, elements = scan.medium(), scan.elements()

        def front(emitter: int) -> Floats:
            return medium.arrivals(elements, np.array([emitter]))[0][0]

        with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
            for done, (emitter, delta) in enumerate(zip(missing, pool.map(front, missing), strict=True)):
                content = BytesIO()
                np.save(content, delta)
                write_bytes(folder / f"{emitter}.npy", content.getvalue())
                progress(done + 1, len(missing), f"fronts, {scan.refinement} times finer")
    return np.stack([np.load(file) for file in files])
