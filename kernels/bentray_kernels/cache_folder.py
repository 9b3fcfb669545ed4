"""Folders of what is kept between runs: another one takes the place of a folder that cannot be written."""

from __future__ import annotations

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
    """The user's cache folder of this program, else a temporary one of this user, else None.

    Warns:
        CacheFolderWarning: once, where it is not the user's.
    """
    wanted = _user_folder()
    found, reason = _writable(wanted)
    if reason:
        _say_once(f"the cache folder {wanted} cannot be written ({reason})", str(found), "XDG_CACHE_HOME")
    return found


def use_writable_kernel_cache(sources: Path) -> None:
    """Let numba keep compiled kernels where it can write: in ``NUMBA_CACHE_DIR``, or beside them.

    Otherwise ``NUMBA_CACHE_DIR`` of this process and its children becomes a folder in ``cache_folder()``,
    with links to the kernels that exist in the other place. Without any folder every process compiles.

    Args:
        sources: folder of the package with the kernels.

    Warns:
        CacheFolderWarning: once, where ``NUMBA_CACHE_DIR`` or the cache folder cannot be written.
    """
    named = os.environ.get(VARIABLE, "")
    compiled = sources / "__pycache__"
    if named:
        reason = _fault_of(Path(named).absolute())
        if not reason:
            return
        found = _writable(_user_folder())[0]
        _say_once(f"{VARIABLE}={named} cannot be written ({reason})", str(found), VARIABLE)
    elif os.access(compiled if compiled.exists() else sources, os.W_OK):
        return
    else:
        found = cache_folder()
    if found is not None:
        folder = found / "kernels"
        links = _links_of_folder(Path(named).absolute()) if named else _links_beside(sources)
        with suppress(OSError):
            for relative, file in links:
                link = folder / relative
                if not os.path.lexists(link):
                    link.parent.mkdir(parents=True, exist_ok=True)
                    link.symlink_to(file)
        os.environ[VARIABLE] = str(folder)


def _links_of_folder(existing: Path) -> Iterator[tuple[Path, Path]]:
    """Files of a cache in one folder, with their paths in it."""
    return ((file.relative_to(existing), file) for file in existing.rglob("*") if file.is_file())


def _links_beside(sources: Path) -> Iterator[tuple[Path, Path]]:
    """Files of a cache beside the sources, with their paths in one folder, named as numba names them."""
    for compiled in sources.rglob("__pycache__"):
        folder = compiled.parent
        name = f"{folder.name}_{hashlib.sha1(str(folder).encode(), usedforsecurity=False).hexdigest()}"
        for file in compiled.glob("*.nb[ic]"):
            yield Path(name, file.name), file


def _user_folder() -> Path:
    # Without a home the path is relative.
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111
    return Path(home, "bentray")


@cache
def _writable(wanted: Path) -> tuple[Path | None, str]:
    """A folder, or a temporary one of this user, or None; and why it is not the folder."""
    reason = _fault_of(wanted)
    if not reason:
        return wanted, ""
    try:
        folder = Path(tempfile.gettempdir(), f"bentray-{os.getuid()}")
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
        # Compiled code of another user must not run.
        own = stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o022
        return (None if not own or _fault_of(folder) else folder), reason
    except OSError:
        return None, reason


def _fault_of(folder: Path) -> str:
    """Why a folder cannot be made or written; empty if it can."""
    if not folder.is_absolute():
        return "no home folder"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return error.strerror or type(error).__name__
    return ""


_SAID: list[str] = []


def _say_once(trouble: str, instead: str, variable: str) -> None:
    if not _SAID:
        _SAID.append(trouble)
        goes_on = "kernels are compiled again in every process" if instead == "None" else f"{instead} is used"
        warnings.warn(f"{trouble}: {goes_on}; {variable} names another one", CacheFolderWarning, stacklevel=3)
