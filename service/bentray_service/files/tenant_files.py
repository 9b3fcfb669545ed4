"""Paths of the files of one tenant, built from validated ids only."""

import shutil
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path, PurePath

from ..rows.ids import PREFIXES, Tenant, checked
from .disk import bytes_in, remove_path
from .store import Store

# The folders of a tenant.
KINDS = (
    *("incoming", "uploads", "datasets", "volumes", "exports", "animations", "meshes", "fields", "work"),
    "reports",
)
# Folders kept by a store; the others are temporary or can be regenerated.
KEPT = ("datasets", "volumes", "animations", "meshes", "fields")
# File extensions of turntables, as in bentray_workers.rendering.turntable, whose import is slow.
ANIMATIONS = ("zip", "apng")
# Folder of a reconstruction in its work folder, as in bentray_workers.reconstruction.reconstruction_run.
CHECKPOINTS = "checkpoints"


def stored_files(root: Path, folders: Collection[str]) -> Iterator[Path]:
    """All complete files and folders in some folders of all tenants of the data folder ``root``."""
    for folder in root.glob("tenants/*/*"):
        if folder.name in folders and folder.is_dir():
            yield from (path for path in folder.iterdir() if path.suffix != ".partial")


def owner_of(path: PurePath) -> tuple[Tenant, str]:
    """Tenant and id of the path ``tenants/TENANT/KIND/ID.…``, or of such a path in a bucket."""
    return Tenant(path.parts[-3]), path.name.partition(".")[0]


class TenantFiles:
    """Folders of one tenant.

    ``incoming/`` has unchecked uploads, ``uploads/`` resumable uploads, ``datasets/``, ``volumes/`` and
    ``meshes/`` canonical files, ``exports/`` volumes in other formats, ``animations/`` turntables,
    ``fields/`` geometry fields, ``work/`` the checkpoints of unfinished jobs, ``reports/`` quality reports.

    Items in ``KEPT`` may exist in the store only; ``Store.fetch`` makes them available at their path.
    """

    def __init__(self, root: Path, store: Store) -> None:
        self.root = root
        self._store = store

    def prepare(self) -> None:
        """Create the folders."""
        # The last folder exists only if all others do.
        if not (self.root / KINDS[-1]).is_dir():
            for name in KINDS:
                (self.root / name).mkdir(parents=True, exist_ok=True)

    def drop_leftovers(self) -> None:
        """Delete incomplete files of a dead process."""
        for left in (self.root / "incoming").iterdir():
            remove_path(left)
        for name in ("datasets", "volumes", "exports", "animations", "meshes", "uploads", "reports"):
            for left in (self.root / name).glob("*.partial"):
                left.unlink()

    def incoming(self, upload_id: str) -> Path:
        """Path of a one-shot upload before ingestion."""
        return self.root / "incoming" / f"{self.stored(upload_id).stem}.upload"

    def candidate(self, upload_id: str) -> Path:
        """Path of a new canonical file, in its own folder, which is created."""
        folder = self._reading(upload_id)
        folder.mkdir(exist_ok=True)
        return folder / self.stored(upload_id).name

    def upload(self, upload_id: str) -> Path:
        """Path of the data of a resumable upload."""
        return self.root / "uploads" / checked("upload", upload_id)

    def stored(self, stored_id: str) -> Path:
        """The canonical file of a dataset, volume or mesh, or the folder of a geometry field."""
        place = {"volume": self.volume, "mesh": self.mesh, "field": self.field}
        kind = next((what for what in place if stored_id.startswith(f"{PREFIXES[what]}-")), "")
        return place.get(kind, self.dataset)(stored_id)

    def dataset(self, dataset_id: str) -> Path:
        """The canonical file of a dataset."""
        return self.root / "datasets" / f"{checked('dataset', dataset_id)}.h5"

    def volume(self, volume_id: str) -> Path:
        """The canonical file of a volume, reconstructed or uploaded."""
        return self.root / "volumes" / f"{checked('volume', volume_id)}.h5"

    def export(self, volume_id: str, extension: str) -> Path:
        """Path of a volume in another format."""
        return self.root / "exports" / f"{checked('volume', volume_id)}.{extension}"

    def report(self, dataset_id: str, name: str) -> Path:
        """Path of a quality report of a dataset."""
        return self.root / "reports" / f"{checked('dataset', dataset_id)}.{name}"

    def animation(self, job_id: str, extension: str) -> Path:
        """Path of a turntable animation."""
        return self.root / "animations" / f"{checked('job', job_id)}.{extension}"

    def mesh(self, mesh_id: str) -> Path:
        """The canonical file of a mesh."""
        return self.root / "meshes" / f"{checked('mesh', mesh_id)}.h5"

    def field(self, field_id: str) -> Path:
        """The folder of a geometry field; it is complete or absent."""
        return self.root / "fields" / checked("field", field_id)

    def work(self, job_id: str) -> Path:
        """The work folder of a job; created if needed."""
        folder = self.root / "work" / checked("job", job_id)
        folder.mkdir(exist_ok=True)
        return folder

    def checkpoints(self, job_id: str) -> Path:
        """The folder where a reconstruction keeps its checkpoints; it may be absent."""
        return self.root / "work" / checked("job", job_id) / CHECKPOINTS

    def drop_work(self, job_id: str) -> None:
        """Delete the work folder of a job, even if its tasks are still running."""
        ended = self.root / "work" / f"{checked('job', job_id)}.ended"
        with suppress(FileNotFoundError):
            # Running tasks can no longer write to the old path.
            (self.root / "work" / job_id).rename(ended)
        shutil.rmtree(ended, ignore_errors=True)

    def keep_work(self, job_ids: Collection[str]) -> None:
        """Delete the work folders of all other jobs."""
        for folder in (self.root / "work").iterdir():
            if folder.name not in job_ids:
                shutil.rmtree(folder, ignore_errors=True)

    def discard_candidate(self, upload_id: str) -> None:
        """Delete a canonical file that was not adopted, and temporary files next to it."""
        shutil.rmtree(self._reading(upload_id), ignore_errors=True)

    def adopt(self, upload_id: str) -> Path:
        """Move a canonical file to its final path, and publish it in the store.

        Raises:
            StorageUnavailable: when that is not possible now; no file is left.
        """
        target = self.stored(upload_id)
        self.candidate(upload_id).replace(target)
        try:
            self._store.publish(target)
        except BaseException:
            target.unlink(missing_ok=True)
            raise
        return target

    def remove(self, stored_ids: Collection[str]) -> None:
        """Delete all files of items and jobs, in every format.

        Raises:
            StorageUnavailable: when that is not possible now.
        """
        self._store.remove([path for one in stored_ids for path in self._kept(one)])
        for one in stored_ids:
            for folder in KINDS:
                for path in (self.root / folder).glob(f"{one}*"):
                    remove_path(path)

    def drop(self, path: Path) -> None:
        """Delete one file or folder of the tenant.

        Raises:
            StorageUnavailable: when that is not possible now.
        """
        if path.parent.name in KEPT:
            self._store.remove([path])
        else:
            path.unlink(missing_ok=True)

    def sizes(self) -> dict[str, int]:
        """Sizes of the stored items in this folder, bytes by id, or by file name for exports."""
        sizes = {}
        for name in (*KEPT, "exports"):
            for path in (self.root / name).iterdir():
                key = path.name if name == "exports" else path.name.partition(".")[0]
                sizes[key] = bytes_in(path) if path.is_dir() else path.stat().st_size
        return sizes

    def _kept(self, stored_id: str) -> list[Path]:
        """Paths where a store may have files of an id."""
        if stored_id.startswith(f"{PREFIXES['job']}-"):
            return [self.animation(stored_id, extension) for extension in ANIMATIONS]
        return [self.stored(stored_id)]

    def _reading(self, upload_id: str) -> Path:
        return self.root / "incoming" / f"{self.stored(upload_id).stem}.reading"
