"""Files of a measurement in a folder or in a zip, opened one at a time."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bentray_kernels.errors import InvalidInput

from ..files.bounded_reading import LARGEST_ROW
from ..files.damage import rejecting_damage
from ..files.zip_checks import WHOLE, check_zip, member_file, naming
from .matlab5 import Matlab5
from .open_scan import OpenScan

MAX_FILES = 65_536
# Of a file with descriptions, of which single variables are read whole.
LARGEST_DESCRIPTION = 64 * 2**20


class MeasurementFolder:
    """The MATLAB files of a measurement by their paths.

    Args:
        scan: an open zip or folder.

    Raises:
        InvalidInput: for too many files, or a damaged zip.
    """

    def __init__(self, scan: OpenScan) -> None:
        self._scan = scan
        if scan.archive is not None:
            with rejecting_damage("file", WHOLE):
                check_zip(scan.archive, MAX_FILES)
        if len(scan.members) > MAX_FILES:
            raise InvalidInput("file", f"{len(scan.members)} files", f"at most {MAX_FILES}")
        self.names = scan.members

    @contextmanager
    def opened(self, name: str) -> Iterator[Matlab5]:
        """The plain arrays of a file."""
        with self._path(name, LARGEST_ROW) as path, naming(name):
            yield Matlab5(path)

    def description(self, name: str, variables: tuple[str, ...]) -> dict[str, Any]:
        """Some variables of a small file, also texts and structures; absent ones are left out.

        Of an absent file these are all.
        """
        from scipy.io import loadmat

        if name not in self.names:
            return {}
        with self._path(name, LARGEST_DESCRIPTION) as path, rejecting_damage(name, "a MATLAB 5 file"):
            loaded = loadmat(path, variable_names=list(variables), appendmat=False, chars_as_strings=True)
        return {variable: loaded[variable] for variable in variables if variable in loaded}

    @contextmanager
    def _path(self, name: str, most: int) -> Iterator[Path]:
        """A file on disk, extracted up to ``most`` bytes."""
        archive: zipfile.ZipFile | None = self._scan.archive
        if archive is None:
            assert self._scan.folder is not None
            path = self._scan.folder / name
            if path.stat().st_size > most:
                raise InvalidInput(name, f"{path.stat().st_size} bytes", f"at most {most}")
            yield path
            return
        with member_file(archive, name, most, self._scan.scratch) as path:
            yield path
