"""Hostile and damaged files: each is refused by the name of a field, cheaply, without echoing its content."""

import json
from pathlib import Path

import pytest

from bentray_kernels.errors import LONGEST_VALUE
from bentray_workers.files.dataset import write_dataset

from ...effort import effort
from ...workers.files.datasets import small
from . import hostile_datasets, hostile_meshes, hostile_variants, hostile_volumes
from .damage import damaged
from .forked_reader import Read, read_all

# Of resident memory: what the libraries take, and some hundred megabytes for a file of a few.
MAX_BYTES = 700 * 2**20
# What stands in some of the files, and in no answer.
SECRETS = ("passwd", "\\u001b", "..\\\\x")

MIN_REJECTED = effort(25, 200)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("hostile")


@pytest.fixture(scope="module")
def sound(folder) -> bytes:
    write_dataset(folder / "sound.h5", small())
    return (folder / "sound.h5").read_bytes()


@pytest.fixture(scope="module")
def reads(folder, sound) -> dict[str, Read]:
    written = {
        **{
            f"scan: {name}": ("dataset", path, {})
            for name, path in hostile_datasets.files(sound, folder).items()
        },
        **{f"volume: {name}": ("volume", *file) for name, file in hostile_volumes.files(folder).items()},
        **{f"mesh: {name}": ("mesh", *file) for name, file in hostile_meshes.files(folder).items()},
        **{f"variant of {name}": file for name, file in hostile_variants.files(folder).items()},
    }
    return dict(zip(written, read_all(list(written.values()), folder), strict=True))


FIELDS = {
    **{f"scan: {name}": refused[-1] for name, refused in hostile_datasets.REFUSED.items()},
    **{f"scan: {name}": "file" for name in hostile_datasets.FOREIGN},
    **{f"volume: {name}": refused[-1] for name, refused in hostile_volumes.REFUSED.items()},
    **{f"mesh: {name}": refused[-1] for name, refused in hostile_meshes.REFUSED.items()},
    **{f"variant of {name}": refused[-1] for name, refused in hostile_variants.REFUSED.items()},
}


@pytest.mark.parametrize("name", FIELDS)
def test_a_hostile_file_is_rejected_by_name(reads, name):
    read = reads[name]
    assert read.status == 0, read
    assert set(read.answer) == {"error"}, read.answer
    error = read.answer["error"]
    assert error["field"] == FIELDS[name], error
    assert 0 < len(error["found"]) <= LONGEST_VALUE
    assert error["accepted"]
    assert not any(secret in json.dumps(error) for secret in SECRETS)
    assert read.most_bytes < MAX_BYTES


@pytest.mark.parametrize("name", hostile_datasets.TAKEN)
def test_unknown_members_are_ignored(reads, name):
    assert set(reads[f"scan: {name}"].answer) == {"ok"}, reads[f"scan: {name}"]


def test_there_are_many():
    assert len(hostile_variants.REFUSED) > 150


@pytest.mark.parametrize("name", hostile_meshes.TAKEN)
def test_a_scene_is_read_once(reads, name):
    assert reads[f"mesh: {name}"].answer["ok"]["faces"] == 1


@pytest.mark.slow
def test_damaged_scans_are_rejected(folder, sound):
    files = []
    for name, content in damaged(
        sound, flips=effort(35, 280), cuts=effort(8, 60), losses=effort(8, 60), seed=1
    ):
        path = folder / f"{name}.upload"
        path.write_bytes(content)
        files.append(("dataset", path, {}))
    reads = read_all(files, folder)
    refused = [read for read in reads if read.refused]
    assert len(refused) >= MIN_REJECTED
    for read in refused:
        # HDF5 goes round in circles in a few of them, or crashes; the sandbox then refuses them as a whole.
        if read.status == 0:
            error = read.answer["error"]
            assert error["field"]
            assert error["found"]
            assert error["accepted"]
    # The others were damaged where it does not show, and hold a scan of the same shape.
    for read in [read for read in reads if not read.refused]:
        assert (read.answer["ok"]["dimension"], read.answer["ok"]["ntx"]) == (2, 12)
    assert max(read.most_bytes for read in reads) < MAX_BYTES
