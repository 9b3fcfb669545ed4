"""The record of a reader of foreign scans, and of what its documentation states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bentray_kernels.acquisition import Dataset

from .arrays import Arrays
from .open_scan import OpenScan


@dataclass(frozen=True)
class Layout:
    """A dataset with placeholders for traces, and the names of the arrays with the traces."""

    dataset: Dataset
    traces: Mapping[str, str]


@dataclass(frozen=True)
class Variable:
    """A variable of a format: name, shape in the order of its program, unit, and meaning.

    Attributes:
        required: "yes", "no", or a condition.
    """

    name: str
    shape: str
    unit: str
    meaning: str
    required: str = "yes"


def _arrays(scan: OpenScan) -> Arrays:
    assert scan.arrays is not None
    return scan.arrays


@dataclass(frozen=True)
class ScanReader:
    """A format of scans.

    Attributes:
        title: heading of its documentation.
        about: container, source of the format, and conventions.
        variables: its documentation.
        detect: whether an open file has this format, by its content.
        read: its arrays; by default those of the file as they are.
        layout: the dataset in the arrays; None: under the names of the upload format.
    """

    title: str
    about: str
    variables: tuple[Variable, ...]
    detect: Callable[[OpenScan], bool]
    read: Callable[[OpenScan], Arrays] = _arrays
    layout: Callable[[Arrays], Layout] | None = None
