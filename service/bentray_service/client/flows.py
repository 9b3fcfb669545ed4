"""What a client can be asked for, as flows: requests in order, and what they give."""

from __future__ import annotations

import tempfile
import uuid
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any, Literal

from .errors import ClientError
from .results import Result, read_result
from .steps import Ask, Fetch, Step
from .uploading import PLACES, OnBytes

Record = dict[str, Any]
Format = Literal["hdf5", "h5", "nifti", "metaimage", "mat", "npy"]

PREFIXES = {"ds": "dataset", "vol": "volume", "mesh": "mesh"}


def record(method: str, path: str, **options: Any) -> Generator[Step, Any, Record]:
    """The JSON that one request gives."""
    return dict((yield Ask(method, path, options, repeatable=method == "GET")).json())


def submit(dataset_id: str, settings: Mapping[str, Any] | None) -> Generator[Step, Any, Record]:
    asked = {"kind": "reconstruction", "dataset": dataset_id, "settings": dict(settings or {})}
    return (yield from _job(asked))


def simulate(settings: Mapping[str, Any] | None) -> Generator[Step, Any, Record]:
    return (yield from _job({"kind": "simulation", "settings": dict(settings or {})}))


def _job(asked: Record) -> Generator[Step, Any, Record]:
    """Start a job; its key makes sure that it is one, however often the request has to be sent."""
    options = {"json": asked, "headers": {"Idempotency-Key": str(uuid.uuid4())}}
    return dict((yield Ask("POST", "/v1/jobs", options, repeatable=True)).json())


def picture(path: str, how: Mapping[str, str | float]) -> Generator[Step, Any, bytes]:
    return bytes((yield Ask("GET", path, {"params": dict(how)}, repeatable=True)).content)


def download(volume_id: str, kind: Format, target: Path) -> Generator[Step, Any, Path]:
    yield Fetch(f"/v1/volumes/{volume_id}/data", {"params": {"format": kind}}, target)
    return target


def download_dataset(dataset_id: str, target: Path, told: OnBytes | None) -> Generator[Step, Any, Path]:
    yield Fetch(f"/v1/datasets/{dataset_id}/file", {}, target, told)
    return target


def result(volume_id: str) -> Generator[Step, Any, Result]:
    about = yield from record("GET", f"/v1/volumes/{volume_id}")
    with tempfile.TemporaryDirectory() as folder:
        path = yield from download(volume_id, "hdf5", Path(folder) / "volume.h5")
        return read_result(path, about)


def delete(stored_id: str) -> Generator[Step, Any, None]:
    kind = PREFIXES.get(stored_id.partition("-")[0])
    if kind is None:
        raise ClientError(f"{stored_id!r} is not the id of a dataset, a volume or a mesh")
    yield Ask("DELETE", f"{PLACES[kind]}/{stored_id}")
