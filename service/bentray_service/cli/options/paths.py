"""Validation of input and output paths before the work starts."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryFile

from bentray_kernels.errors import InvalidInput


def input_file(path: Path, accepted: str = "the path of a dataset in HDF5") -> Path:
    """Return ``path`` if it is a file.

    Raises:
        InvalidInput: otherwise.
    """
    if not path.is_file():
        reason = "a folder" if path.is_dir() else "no such file"
        raise InvalidInput("file", f"{path} ({reason})", accepted)
    return path


def output_folder(path: Path) -> Path:
    """Return ``path`` as a folder, created if needed.

    Raises:
        InvalidInput: when it cannot be created or written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        _try_writing(path)
    except (FileExistsError, NotADirectoryError) as error:
        raise InvalidInput(
            "output", f"{path} (a file is in the way)", "a folder, or where one can be made"
        ) from error
    except OSError as error:
        raise InvalidInput("output", f"{path} ({error.strerror})", "a writable folder") from error
    return path


def output_file(path: Path, *, force: bool, suffix: str = "") -> Path:
    """Return ``path`` if it may be written.

    Args:
        path: of the file.
        force: whether an existing file may be replaced.
        suffix: required extension, case-insensitive; empty for any name.

    Raises:
        InvalidInput: for another name, an existing file, or a folder that cannot be written.
    """
    if not path.name.lower().endswith(suffix):
        raise InvalidInput("output", path, f"a name ending in {suffix}")
    if path.is_dir():
        raise InvalidInput("output", f"{path} (a folder)", "the path of a file")
    if path.exists() and not force:
        raise InvalidInput("output", f"{path} (exists)", "a new file, or --force to replace it")
    if not path.parent.is_dir():
        raise InvalidInput("output", f"{path} (its folder does not exist)", "a path in an existing folder")
    try:
        _try_writing(path.parent)
    except OSError as error:
        given = f"{path} (its folder: {error.strerror})"
        raise InvalidInput("output", given, "a path in a writable folder") from error
    return path


def check_apart(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None]) -> None:
    """Reject an output that would replace an input or another output, also through links.

    Args:
        outputs, inputs: paths by option; None if absent.

    Raises:
        InvalidInput: naming the output.
    """
    seen = {path.resolve(): name for name, path in inputs.items() if path is not None}
    for name, path in outputs.items():
        if path is None:
            continue
        other = seen.setdefault(path.resolve(), name)
        if other != name:
            raise InvalidInput(name, f"{path}, the same file as {other}", "a separate file")


def _try_writing(folder: Path) -> None:
    """Test write access now; permissions alone are not reliable."""
    with TemporaryFile(dir=folder):
        pass
