"""A scan that ends every process that looks at it, but for the one that made it."""

import os
import signal
from pathlib import Path
from typing import NamedTuple

from bentray_kernels.tomography import Problem, Settings
from bentray_kernels.tomography.scan import Scan
from bentray_workers.reconstruction.file_scan import FileSource


class PoisonedScan(NamedTuple):
    """Stand-in for ``bentray_workers.reconstruction.file_scan.FileScan``."""

    path: Path
    settings: Settings
    maker: int

    def stages(self) -> tuple[Settings, ...]:
        """See ``Scan``."""
        return (self.settings,)

    def problem(self, index: int, stage: int = -1) -> Problem:
        """See ``Scan``."""
        if os.getpid() != self.maker:
            # As the kernel ends it for lack of memory.
            os.kill(os.getpid(), signal.SIGKILL)
        return Scan(FileSource(self.path, 0, self.path, 0, self.path), self.settings).problem(index, stage)
