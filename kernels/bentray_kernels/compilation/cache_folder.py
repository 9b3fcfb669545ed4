"""Folders of what is kept between runs: another one takes the place of a folder that cannot be written."""

import hashlib
import os
import stat
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

# Folder of compiled kernels, read by numba.
VARIABLE = "NUMBA_CACHE_DIR"


class CacheFolderWarning(UserWarning):
    """A folder cannot be written, and another one, or none, takes its place."""


def cache_folder() -> Path | None:
    """The user's cache folder of this program, in a temporary folder if need be; None if none can be written.

    In the temporary case ``XDG_CACHE_HOME`` of this process and its children names it, so that the caches of
    libraries are there, too.

    Warns:
        CacheFolderWarning: once, where it is not the user's.
    """
    # Without a home the path is relative.
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111
    wanted = Path(home, "bentray")
    reason = fault_of(wanted)
    if not reason:
        return wanted
    temporary = _temporary_folder()
    _say(f"the cache folder {wanted} cannot be written ({reason})", temporary, "XDG_CACHE_HOME")
    if temporary is None:
        return None
    os.environ["XDG_CACHE_HOME"] = str(temporary)
    return temporary / "bentray"


def use_writable_folder(variable: str, name: str, usual: Path | None = None) -> Path | None:
    """Name a folder that can be written in the environment variable of a library, if its own cannot.

    Children of this process get the variable, too.

    Args:
        variable: names the folder.
        name: of the folder in ``cache_folder()`` that takes its place.
        usual: folder without the variable; None: beside ``cache_folder()``.

    Returns:
        The folder whose place was taken; None where it can be written, or there is no other one.

    Warns:
        CacheFolderWarning: once, where the named folder or the cache folder cannot be written.
    """
    named = os.environ.get(variable, "")
    found = cache_folder()
    wanted = Path(named).absolute() if named else usual or found
    reason = fault_of(wanted) if wanted else ""
    if not reason:
        return None
    if named:
        _say(f"{variable}={named} cannot be written ({reason})", found, variable)
    if found is None:
        return None
    os.environ[variable] = str(found / name)
    return wanted


def use_writable_kernel_cache(sources: Path) -> None:
    """Let numba keep compiled kernels where it can write: in ``NUMBA_CACHE_DIR``, or beside them.

    Another folder gets links to the kernels that exist there. Without any folder every process compiles.

    Args:
        sources: folder of the package with the kernels.

    Warns:
        CacheFolderWarning: as ``use_writable_folder``.
    """
    replaced = use_writable_folder(VARIABLE, "kernels", sources / "__pycache__")
    if replaced is not None:
        beside = replaced == sources / "__pycache__"
        with suppress(OSError):
            for relative, file in _links_beside(sources) if beside else _links_of_folder(replaced):
                link = Path(os.environ[VARIABLE], relative)
                if not os.path.lexists(link):
                    link.parent.mkdir(parents=True, exist_ok=True)
                    link.symlink_to(file)


def _links_of_folder(existing: Path) -> Iterator[tuple[Path, Path]]:
    """Files of a cache in one folder, with their paths in it."""
    return ((file.relative_to(existing), file) for file in existing.rglob("*") if file.is_file())


def _links_beside(sources: Path) -> Iterator[tuple[Path, Path]]:
    """Files of a cache beside the sources, with their paths in one folder, named as numba names them."""
    for compiled in sources.rglob("__pycache__"):
        folder = compiled.parent
        name = name_in_cache(folder)
        for file in compiled.glob("*.nb[ic]"):
            yield Path(name, file.name), file


def _temporary_folder() -> Path | None:
    """A temporary folder that only this user can write, the same in every process."""
    try:
        folder = Path(tempfile.gettempdir(), f"bentray-{os.getuid()}")
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
    except OSError:
        return None
    # Compiled code of another user must not run.
    own = stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o022
    return folder if own and not fault_of(folder / "bentray") else None


@cache
def fault_of(folder: Path) -> str:
    """Why a folder cannot be made or written; empty if it can."""
    if not folder.is_absolute():
        return "no home folder"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return error.strerror or type(error).__name__
    return ""


def name_in_cache(sources: Path) -> str:
    """Of the folder in ``NUMBA_CACHE_DIR`` for kernels of one folder of sources, as numba names it."""
    return f"{sources.name}_{hashlib.sha1(str(sources).encode(), usedforsecurity=False).hexdigest()}"


@cache
def _say(trouble: str, instead: Path | None, variable: str) -> None:
    goes_on = "nothing is kept" if instead is None else f"{instead} takes its place"
    warnings.warn(f"{trouble}: {goes_on}; {variable} names another one", CacheFolderWarning, stacklevel=4)
