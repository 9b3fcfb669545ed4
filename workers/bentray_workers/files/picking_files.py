"""Files of the picking in the folder of a job: the findings about the scan, and estimated water shots."""

import base64
import hashlib
import json
import math
import zipfile
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.quality import Finding
from bentray_kernels.acquisition.quality.finding import words
from bentray_kernels.acquisition.quality.recording import OF_TRACES, OF_WATER
from bentray_kernels.acquisition.reference.reference_shot import ReferenceShot
from bentray_kernels.arrays import Flags
from bentray_kernels.errors import InvalidInput

from .atomic import atomic_replace, write_bytes


class ScanFindings(NamedTuple):
    """Findings in a scan.

    Attributes:
        findings: of all slices.
        examined: whether the scan was examined.
        changed: whether the picked dataset differs from the file of the scan.
        pairs, usable: numbers of pairs of different elements, and of those with valid times.
        left_out: number of pairs with a time, or a trace to pick, that the findings leave out.
    """

    findings: tuple[Finding, ...]
    examined: bool
    changed: bool
    pairs: int = 0
    usable: int = 0
    left_out: int = 0

    @property
    def pairs_used(self) -> str:
        """Numbers of pairs in words, as the quality report counts them."""
        more = f", {self.left_out:,} left out" if self.examined else ", not examined"
        return f"{self.usable:,} of {self.pairs:,} pairs used{more}"

    def of_traces(self, index: int) -> tuple[Finding, ...]:
        """Findings in the traces of a slice, without those in picked times."""
        kinds = OF_TRACES + OF_WATER
        return tuple(item for item in self.findings if item.slice == index and item.check in kinds)

    def words(self, *, stacked: bool) -> str:
        """Summary in one line; see ``finding.words``."""
        return words(self.findings, stacked=stacked) if self.findings or self.examined else ""


def write_findings(path: Path, findings: ScanFindings, picked: Path | None = None) -> None:
    """Write findings; ``path`` is replaced atomically.

    Args:
        path: of the file.
        findings: the findings.
        picked: the picked dataset, if it differs from the scan; its SHA-256 is stored.

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    content = {**findings._asdict(), "findings": [_plain(finding) for finding in findings.findings]}
    content["picked_sha256"] = None if picked is None else _digest_of(picked)
    write_bytes(path, json.dumps({"sha256": _digest(content), "content": content}, allow_nan=False).encode())


def read_findings(path: Path, picked: Path | None = None) -> ScanFindings:
    """Read findings.

    Args:
        path: of the file.
        picked: the picked dataset; None: its SHA-256 is not compared.

    Raises:
        OSError, ValueError, KeyError, TypeError: for an absent or damaged file.
    """
    whole = json.loads(path.read_bytes())
    content = whole["content"]
    if _digest(content) != whole["sha256"]:
        raise ValueError(f"{path.name} is damaged")
    if picked is not None and content["changed"] and _digest_of(picked) != content["picked_sha256"]:
        raise ValueError(f"{picked.name} is damaged")
    findings = tuple(_finding(plain) for plain in content["findings"])
    counts = (int(content[name]) for name in ("pairs", "usable", "left_out"))
    return ScanFindings(findings, bool(content["examined"]), bool(content["changed"]), *counts)


def _digest(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _digest_of(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _plain(finding: Finding) -> dict[str, Any]:
    """Plain values, with one bit per pair."""
    pairs = None
    if finding.pairs is not None:
        packed = base64.b64encode(np.packbits(finding.pairs).tobytes()).decode()
        pairs = {"shape": finding.pairs.shape, "bits": packed}
    value = finding.value if math.isfinite(finding.value) else None
    return {**vars(finding), "value": value, "pairs": pairs}


def _finding(plain: dict[str, Any]) -> Finding:
    value = math.nan if plain["value"] is None else plain["value"]
    elements, pairs = tuple(plain["elements"]), _pairs(plain["pairs"])
    return Finding(**{**plain, "elements": elements, "value": value, "pairs": pairs})


def _pairs(plain: dict[str, Any] | None) -> Flags | None:
    if plain is None:
        return None
    shape = tuple(plain["shape"])
    bits = np.frombuffer(base64.b64decode(plain["bits"]), dtype=np.uint8)
    return np.unpackbits(bits, count=math.prod(shape)).reshape(shape).astype(np.bool_)


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
