"""The paths a command is given: checked before the work starts."""

from __future__ import annotations

from collections.abc import Mapping
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
        _try_writing(path)
    except (FileExistsError, NotADirectoryError) as error:
        raise InvalidInput(
            "output", f"{path} (a file is in the way)", "a folder, or where one can be made"
        ) from error
    except OSError as error:
        raise InvalidInput("output", f"{path} ({error.strerror})", "a folder that can be written") from error
    return path


def output_file(path: Path, *, force: bool, suffix: str = "") -> Path:
    """``path`` if it may be written: absent, or a file that ``force`` gives up.

    Args:
        path: of the file.
        force: whether a file that is there may be replaced.
        suffix: how its name must end, in small letters or capitals; empty for any name.

    Raises:
        InvalidInput: for another name, where something is in the way, or nothing can be written.
    """
    if not path.name.lower().endswith(suffix):
        raise InvalidInput("output", path, f"a name that ends in {suffix}, the format of the file")
    if path.is_dir():
        raise InvalidInput("output", f"{path} (a folder)", "the path of a file")
    if path.exists() and not force:
        raise InvalidInput("output", f"{path} (exists)", "a new file, or --force to replace this one")
    if not path.parent.is_dir():
        raise InvalidInput("output", f"{path} (its folder is absent)", "a path in a folder that exists")
    try:
        _try_writing(path.parent)
    except OSError as error:
        found = f"{path} (its folder: {error.strerror})"
        raise InvalidInput("output", found, "a path in a folder that can be written") from error
    return path


def check_apart(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None]) -> None:
    """Refuse an output that would replace an input or another output, by whatever links it is reached.

    Args:
        outputs, inputs: paths by the words of the user's that gave them; None where there is none.

    Raises:
        InvalidInput: naming the output.
    """
    seen = {path.resolve(): name for name, path in inputs.items() if path is not None}
    for name, path in outputs.items():
        if path is None:
            continue
        other = seen.setdefault(path.resolve(), name)
        if other != name:
            raise InvalidInput(name, f"{path}, which is {other} too", "a path of its own")


def _try_writing(folder: Path) -> None:
    """Find out now, not when the work is done; permissions alone do not tell."""
    with TemporaryFile(dir=folder):
        pass
