"""The files of one tenant: the path of each, made from checked ids only."""

from __future__ import annotations

import shutil
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

from ..rows.ids import PREFIXES, checked
from .disk import bytes_in
from .store import Store

# What a data folder of before there were tenants has at its top.
KINDS = ("incoming", "uploads", "datasets", "volumes", "exports", "animations", "meshes", "fields", "work")
# Those that a store keeps; the others can be made again, or are on their way.
KEPT = ("datasets", "volumes", "animations", "meshes", "fields")
# How the names of turntables end; those of bentray_workers.rendering.turntable, which takes long to import.
ANIMATIONS = ("zip", "apng")


class TenantFiles:
    """Folders of one tenant.

    ``incoming/`` holds uploads that no one has checked, ``uploads/`` those that come in pieces,
    ``datasets/`` the canonical files of scans,
    ``volumes/`` results and the canonical files of uploaded volumes, ``exports/`` volumes in other formats,
    ``animations/`` turntables, ``meshes/`` the canonical files of meshes, ``fields/`` a folder for each
    geometry field, ``work/`` one for each job that is not at its end, with its checkpoints. An upload is a
    dataset, a volume or a mesh, as its id tells.

    What is in ``KEPT`` may lie in a store only: ``Store.fetch`` lets it lie at its path again.
    """

    def __init__(self, root: Path, store: Store) -> None:
        self.root = root
        self._store = store
        self._incoming, self._datasets, self._volumes = root / "incoming", root / "datasets", root / "volumes"
        self._uploads = root / "uploads"
        self._exports, self._animations = root / "exports", root / "animations"
        self._meshes, self._fields, self._work = root / "meshes", root / "fields", root / "work"

    def prepare(self) -> None:
        """Make the folders."""
        # In this order, so that where the last one is the others are too.
        if not (self.root / KINDS[-1]).is_dir():
            for name in KINDS:
                (self.root / name).mkdir(parents=True, exist_ok=True)

    def drop_leftovers(self) -> None:
        """Remove what a dead process left half done."""
        for left in self._incoming.iterdir():
            if left.is_dir():
                shutil.rmtree(left)
            else:
                left.unlink()
        single = self._datasets, self._volumes, self._exports, self._animations, self._meshes, self._uploads
        for folder in single:
            for left in folder.glob("*.partial"):
                left.unlink()

    def incoming(self, upload_id: str) -> Path:
        """Where an upload lands, before anything has looked at it."""
        return self._incoming / f"{self._canonical(upload_id).stem}.upload"

    def candidate(self, upload_id: str) -> Path:
        """Where the ingest process writes the canonical file: in a folder of its own, made if needed."""
        folder = self._reading(upload_id)
        folder.mkdir(exist_ok=True)
        return folder / self._canonical(upload_id).name

    def upload(self, upload_id: str) -> Path:
        """What has come of an upload that comes in pieces; it outlives the service."""
        return self._uploads / checked("upload", upload_id)

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
        """Remove the folder of a job at its end, under the hands of tasks that still run."""
        ended = self._work / f"{checked('job', job_id)}.ended"
        with suppress(FileNotFoundError):
            # What they still want to write under the old name finds no folder.
            (self._work / job_id).rename(ended)
        shutil.rmtree(ended, ignore_errors=True)

    def keep_work(self, job_ids: Collection[str]) -> None:
        """Remove the folders of all jobs but these."""
        for folder in self._work.iterdir():
            if folder.name not in job_ids:
                shutil.rmtree(folder, ignore_errors=True)

    def discard_candidate(self, upload_id: str) -> None:
        """Remove a canonical file that was not adopted, with all that a killed process left beside it."""
        shutil.rmtree(self._reading(upload_id), ignore_errors=True)

    def adopt(self, upload_id: str) -> Path:
        """Move the checked canonical file to its place, and keep it for good.

        Raises:
            StorageAway: when it cannot be kept now; nothing is left then.
        """
        target = self._canonical(upload_id)
        self.candidate(upload_id).replace(target)
        try:
            self._store.publish(target)
        except BaseException:
            target.unlink(missing_ok=True)
            raise
        return target

    def remove(self, stored_ids: Collection[str]) -> None:
        """Remove all files of datasets, volumes, meshes, fields and jobs, in every format.

        Raises:
            StorageAway: when they cannot be removed now.
        """
        self._store.remove([path for one in stored_ids for path in self._kept(one)])
        for one in stored_ids:
            for folder in KINDS:
                for path in (self.root / folder).glob(f"{one}*"):
                    if path.is_dir():
                        shutil.rmtree(path)
                    else:
                        path.unlink(missing_ok=True)

    def drop(self, path: Path) -> None:
        """Remove one file or folder below this one.

        Raises:
            StorageAway: when it cannot be removed now.
        """
        if path.parent.name in KEPT:
            self._store.remove([path])
        else:
            path.unlink(missing_ok=True)

    def sizes(self) -> dict[str, int]:
        """Bytes of each stored thing that lies here, by its id; of a volume in another format by the name of
        the file."""
        found = {}
        for name in (*KEPT, "exports"):
            for path in (self.root / name).iterdir():
                key = path.name if name == "exports" else path.name.partition(".")[0]
                found[key] = bytes_in(path) if path.is_dir() else path.stat().st_size
        return found

    def bytes_used(self) -> int:
        """The size of all of it, bytes, wherever it is kept; raises StorageAway where that cannot be told."""
        return self._store.bytes_used(self.root)

    def _kept(self, stored_id: str) -> list[Path]:
        """Where a store may have something of this id."""
        place = {"vol": self.volume, "mesh": self.mesh, "field": self.field}
        prefix = stored_id.partition("-")[0]
        if prefix == PREFIXES["job"]:
            return [self.animation(stored_id, extension) for extension in ANIMATIONS]
        return [place.get(prefix, self.dataset)(stored_id)]

    def _reading(self, upload_id: str) -> Path:
        return self._incoming / f"{self._canonical(upload_id).stem}.reading"

    def _canonical(self, upload_id: str) -> Path:
        place = {PREFIXES["volume"]: self.volume, PREFIXES["mesh"]: self.mesh}
        return place.get(upload_id.partition("-")[0], self.dataset)(upload_id)
