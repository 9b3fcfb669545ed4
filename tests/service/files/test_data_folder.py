"""The data folder: prepared, cleaned, locked, and closed to invented names."""

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.errors import UnknownId
from bentray_service.files.data_folder import Files, lock
from bentray_service.rows.ids import LOCAL, Tenant, new_id


def test_half_done_work_is_dropped(tmp_path):
    root = Files(tmp_path)
    root.prepare()
    files = root.of(Tenant("acme"))
    left = files.incoming(new_id("dataset"))
    left.write_bytes(b"half")
    kept = files.dataset(new_id("dataset"))
    kept.write_bytes(b"whole")
    cut_off = files.volume(volume := "vol-" + 20 * "0").with_suffix(".h5.1f.partial")
    cut_off.write_bytes(b"half")
    files.volume(volume).write_bytes(b"whole")
    torn = files.mesh(mesh := new_id("mesh")).with_suffix(".h5.1f.partial")
    torn.write_bytes(b"half")
    files.mesh(mesh).write_bytes(b"whole")
    (root.scratch / "job").mkdir()
    (root.scratch / "job" / "picked.h5").write_bytes(b"x")
    root.drop_leftovers()
    assert not left.exists()
    assert not cut_off.exists()
    assert not torn.exists()
    assert files.volume(volume).exists()
    assert files.mesh(mesh).exists()
    assert not list(root.scratch.iterdir())
    assert kept.exists()


def test_stale_candidates_are_removed_with_partial_files(tmp_path):
    root = Files(tmp_path)
    root.prepare()
    files = root.of(LOCAL)
    mine, other = files.candidate(new_id("dataset")), files.candidate(new_id("dataset"))
    for path in (mine, mine.with_name(f"{mine.name}.1f.partial"), mine.with_name("tmp7x.h5"), other):
        path.write_bytes(b"x")
    files.discard_candidate(mine.stem)
    assert list(files.root.glob("incoming/*/*")) == [other]
    root.drop_leftovers()
    assert not list(files.root.glob("incoming/*"))


@pytest.mark.parametrize("what", ["dataset", "volume", "mesh"])
def test_adopt_moves_the_checked_file(tmp_path, what):
    files = Files(tmp_path).of(LOCAL)
    upload = new_id(what)
    place = getattr(files, what)(upload)
    files.candidate(upload).write_bytes(b"x")
    assert files.adopt(upload) == place
    assert place.read_bytes() == b"x"
    assert not files.candidate(upload).exists()


@pytest.mark.parametrize("name", ["incoming", "candidate", "dataset", "mesh", "field"])
def test_no_invented_string_becomes_a_path(tmp_path, name):
    with pytest.raises(UnknownId):
        getattr(Files(tmp_path).of(LOCAL), name)("../../etc/passwd")


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInput, match="data_dir"):
        Files(tmp_path / "file").prepare()


def test_the_lock_is_given_back(tmp_path):
    first = lock(tmp_path)
    with pytest.raises(InvalidInput, match="another service"):
        lock(tmp_path)
    first.close()
    lock(tmp_path).close()


@pytest.mark.parametrize("name", ["", ".", "..", "../local", "a/b", "A", "a\n", "-a", "é", "a" * 65])
def test_no_invented_tenant_becomes_a_path(tmp_path, name):
    with pytest.raises(InvalidInput, match="tenant"):
        Files(tmp_path).of(Tenant(name))
    assert not list(tmp_path.iterdir())


def test_tenants_are_isolated_on_disk(tmp_path):
    files = Files(tmp_path)
    mine, theirs = files.of(LOCAL), files.of(Tenant("other"))
    field = "field-" + "0" * 20
    mine.field(field).mkdir()
    (mine.field(field) / "a").write_bytes(bytes(1000))
    assert not theirs.field(field).exists()
    assert (mine.sizes(), theirs.sizes()) == ({field: 1000}, {})
