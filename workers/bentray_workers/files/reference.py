"""The estimated water shot of a slice, as a file in the folder of its job."""

from __future__ import annotations

import zipfile
from dataclasses import fields
from pathlib import Path

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.reference.reference_shot import ReferenceShot
from bentray_kernels.errors import InvalidInput

from .atomic import atomic_replace


def reference_path(folder: Path, index: int) -> Path:
    """The file of a slice, from 0, in the folder of a job."""
    return folder / f"{index}-reference.npz"


def with_reference(dataset: Dataset, folder: Path, index: int) -> Dataset:
    """The dataset of one slice with its estimated water shot, where it has traces and no recorded one.

    Raises:
        InvalidInput: for an absent or damaged file.
    """
    if dataset.waveform is None or dataset.waveform.water is not None:
        return dataset
    return read_reference(reference_path(folder, index)).applied(dataset)


def write_reference(path: Path, reference: ReferenceShot) -> None:
    """Write a reference shot; ``path`` is replaced atomically.

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    arrays = {field.name: np.asarray(getattr(reference, field.name)) for field in fields(reference)}
    with atomic_replace(path) as partial, partial.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def read_reference(path: Path) -> ReferenceShot:
    """Read a reference shot.

    Raises:
        InvalidInput: for an absent or damaged file.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            values = {field.name: stored[field.name] for field in fields(ReferenceShot)}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InvalidInput("reference", f"{path.name}: {error}", "the estimated water shot") from error
    plain = {name: value.item() if value.ndim == 0 else value for name, value in values.items()}
    return ReferenceShot(**plain)
