"""The data folder: the path of every file, made from checked ids only."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Collection
from pathlib import Path
from typing import IO

from bentray_kernels.errors import InvalidInput

from .ids import PREFIXES, checked


class Files:
    """Folders of one service under ``data_dir``.

    ``incoming/`` holds uploads that no one has checked, ``datasets/`` the canonical files of scans,
    ``volumes/`` results and the canonical files of uploaded volumes, ``exports/`` volumes in other formats,
    ``animations/`` turntables, ``meshes/`` the canonical files of meshes, ``fields/`` a folder for each
    geometry field, ``work/`` one for each job that is not at its end, with its checkpoints, ``scratch/``
    what workers need while they work. An upload is a dataset, a volume or a mesh, as its id tells.
    """

    def __init__(self, data_dir: Path) -> None:
        self.root = data_dir.resolve()
        self._incoming = self.root / "incoming"
        self._datasets = self.root / "datasets"
        self._volumes = self.root / "volumes"
        self._exports = self.root / "exports"
        self._animations = self.root / "animations"
        self._meshes = self.root / "meshes"
        self._fields = self.root / "fields"
        self._work = self.root / "work"
        self.scratch = self.root / "scratch"

    def prepare(self) -> None:
        """Make the folders.

        Raises:
            InvalidInput: when the folder cannot be made or written.
        """
        try:
            results = (self._volumes, self._exports, self._animations, self._meshes, self._fields)
            for folder in (self._incoming, self._datasets, *results, self._work, self.scratch):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidInput(
                "data_dir", f"{self.root} ({error.strerror})", "a folder that can be written"
            ) from error

    def drop_leftovers(self) -> None:
        """Remove what a dead process left half done; call it once the folder is locked."""
        for left in self._incoming.iterdir():
            left.unlink()
        for folder in (self._volumes, self._exports, self._animations, self._meshes):
            for left in folder.glob("*.partial"):
                left.unlink()
        for left in self.scratch.iterdir():
            if left.is_dir():
                shutil.rmtree(left)
            else:
                left.unlink()

    def incoming(self, upload_id: str) -> Path:
        """Where an upload lands, before anything has looked at it."""
        return self._incoming / f"{self._canonical(upload_id).stem}.upload"

    def candidate(self, upload_id: str) -> Path:
        """Where the ingest process writes the canonical file."""
        return self._incoming / self._canonical(upload_id).name

    def dataset(self, dataset_id: str) -> Path:
        """The canonical file of a dataset."""
        return self._datasets / f"{checked('dataset', dataset_id)}.h5"

    def volume(self, volume_id: str) -> Path:
        """The file of a volume: a reconstruction, or what was uploaded."""
        return self._volumes / f"{checked('volume', volume_id)}.h5"

    def export(self, volume_id: str, extension: str) -> Path:
        """A volume in another format; made on demand."""
        return self._exports / f"{checked('volume', volume_id)}.{extension}"

    def animation(self, job_id: str, extension: str) -> Path:
        """The result of a turntable."""
        return self._animations / f"{checked('job', job_id)}.{extension}"

    def mesh(self, mesh_id: str) -> Path:
        """The canonical file of a mesh."""
        return self._meshes / f"{checked('mesh', mesh_id)}.h5"

    def field(self, field_id: str) -> Path:
        """The folder of a geometry field; it is there as a whole or not at all."""
        return self._fields / checked("field", field_id)

    def work(self, job_id: str) -> Path:
        """A folder for what a job makes on its way, which outlives the service; made if needed."""
        folder = self._work / checked("job", job_id)
        folder.mkdir(exist_ok=True)
        return folder

    def drop_work(self, job_id: str) -> None:
        """Remove the folder of a job at its end."""
        shutil.rmtree(self._work / checked("job", job_id), ignore_errors=True)

    def keep_work(self, job_ids: Collection[str]) -> None:
        """Remove the folders of all jobs but these."""
        for folder in self._work.iterdir():
            if folder.name not in job_ids:
                shutil.rmtree(folder, ignore_errors=True)

    def discard_candidate(self, upload_id: str) -> None:
        """Remove a canonical file that was not adopted, also what a killed process left of it."""
        for left in self._incoming.glob(f"{self.candidate(upload_id).name}*"):
            left.unlink(missing_ok=True)

    def adopt(self, upload_id: str) -> Path:
        """Move the checked canonical file to its place, durably."""
        target = self._canonical(upload_id)
        self.candidate(upload_id).replace(target)
        sync_folder(target.parent)
        return target

    def _canonical(self, upload_id: str) -> Path:
        place = {PREFIXES["volume"]: self.volume, PREFIXES["mesh"]: self.mesh}
        return place.get(upload_id.partition("-")[0], self.dataset)(upload_id)


def sync_folder(folder: Path) -> None:
    """Make a rename in ``folder`` survive a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def lock(root: Path) -> IO[bytes]:
    """Take the data folder for this process; closing the returned file, or dying, gives it back.

    Raises:
        InvalidInput: when another service has it. Two would run each other's jobs.
    """
    handle = (root / "service.lock").open("ab")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        handle.close()
        raise InvalidInput(
            "data_dir", f"{root}, which another service is using", "a folder of its own for every service"
        ) from error
    return handle
