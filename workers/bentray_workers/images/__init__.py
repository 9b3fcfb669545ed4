"""Pictures as PNG: one slice of a reconstruction or a volume, a report, a comparison with the truth."""

import os
from pathlib import Path

from bentray_kernels.compilation.cache_folder import use_writable_folder

# Before matplotlib is imported, which keeps a list of fonts and says on each start that it cannot.
_SETTINGS = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")  # noqa: PTH111
use_writable_folder("MPLCONFIGDIR", "matplotlib", Path(_SETTINGS, "matplotlib"))
