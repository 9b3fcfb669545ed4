"""The paths a command is given: checked before the work starts."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryFile

from bentray_kernels.errors import InvalidInput


def input_file(path: Path, accepted: str = "the path of a dataset in HDF5") -> Path:
    """``path`` if it is a file.

    Raises:
        InvalidInput: saying what was found there.
    """
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no such file"
        raise InvalidInput("file", f"{path} ({found})", accepted)
    return path


def output_folder(path: Path) -> Path:
    """``path`` as a folder, made if it is absent.

    Raises:
        InvalidInput: where a file is in the way, or nothing can be written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        # Found out now, not when the work is done; permissions alone do not tell.
        with TemporaryFile(dir=path):
            pass
    except (FileExistsError, NotADirectoryError) as error:
        raise InvalidInput(
            "output", f"{path} (a file is in the way)", "a folder, or where one can be made"
        ) from error
    except OSError as error:
        raise InvalidInput("output", f"{path} ({error.strerror})", "a folder that can be written") from error
    return path


def output_file(path: Path, *, force: bool) -> Path:
    """``path`` if it may be written: absent, or a file that ``force`` gives up.

    Raises:
        InvalidInput: where something is in the way, or the folder is absent.
    """
    if path.is_dir():
        raise InvalidInput("output", f"{path} (a folder)", "the path of a file")
    if path.exists() and not force:
        raise InvalidInput("output", f"{path} (exists)", "a new file, or --force to replace this one")
    if not path.parent.is_dir():
        raise InvalidInput("output", f"{path} (its folder is absent)", "a path in a folder that exists")
    return path
