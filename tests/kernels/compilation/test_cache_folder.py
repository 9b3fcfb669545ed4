"""Where compiled kernels and records are kept if a folder cannot be written: elsewhere or nowhere."""

import os
import sys
import tempfile
import warnings
from importlib import util
from pathlib import Path

import numba
import pytest

from bentray_kernels.compilation import cache_folder as module
from bentray_kernels.compilation.cache_folder import (
    CacheFolderWarning,
    cache_folder,
    use_writable_folder,
    use_writable_kernel_cache,
)
from bentray_kernels.opencl.records import read_record, record_file, write_record


@pytest.fixture(autouse=True)
def fresh(monkeypatch, tmp_path):
    """Nothing said or known yet; temporary files below ``tmp_path``."""
    for name in ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "MPLCONFIGDIR"):
        # Set first, so that what the code sets is taken back.
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    known = module.fault_of, module._say
    for function in known:
        function.cache_clear()
    yield
    for function in known:
        function.cache_clear()
    monkeypatch.undo()
    numba.config.reload_config()


@pytest.fixture
def occupied(tmp_path):
    """A path at which no folder can be made, also by root."""
    (tmp_path / "file").touch()
    return tmp_path / "file" / "x"


def own(tmp_path):
    """The temporary folder of this user."""
    return tmp_path / "temporary" / f"bentray-{os.getuid()}"


def test_the_users_folder_is_used_in_silence(monkeypatch, tmp_path):
    assert cache_folder() == tmp_path / "home" / ".cache" / "bentray"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "bentray"


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "HOME"])
def test_a_private_temporary_folder_takes_the_place_of_one_that_cannot_be_written(
    monkeypatch, tmp_path, occupied, variable
):
    monkeypatch.setenv(variable, str(occupied))
    with pytest.warns(CacheFolderWarning, match=f"{occupied}.* cannot be written .*{own(tmp_path)} takes"):
        assert cache_folder() == own(tmp_path) / "bentray"
    assert own(tmp_path).stat().st_mode & 0o777 == 0o700
    assert cache_folder() == own(tmp_path) / "bentray", "said once"
    assert os.environ["XDG_CACHE_HOME"] == str(own(tmp_path)), "libraries and children use it too"


def test_without_a_home_nothing_is_written_below_the_working_folder(monkeypatch, tmp_path):
    monkeypatch.delenv("HOME")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.chdir(tmp_path)
    with pytest.warns(CacheFolderWarning, match="no home folder"):
        assert cache_folder() == own(tmp_path) / "bentray"
    assert not (tmp_path / "~").exists()


@pytest.mark.parametrize("trick", ["link", "open to all", "file", "no temporary folder"])
def test_nothing_is_kept_where_others_could_write(monkeypatch, tmp_path, occupied, trick):
    monkeypatch.setenv("XDG_CACHE_HOME", str(occupied))
    if trick == "link":
        (tmp_path / "elsewhere").mkdir()
        own(tmp_path).symlink_to(tmp_path / "elsewhere")
    elif trick == "open to all":
        own(tmp_path).mkdir()
        own(tmp_path).chmod(0o777)
    elif trick == "file":
        own(tmp_path).touch()
    else:
        monkeypatch.setattr(tempfile, "tempdir", str(occupied))
    with pytest.warns(CacheFolderWarning, match="nothing is kept"):
        assert cache_folder() is None


def test_records_without_a_folder_are_not_kept(monkeypatch, occupied):
    monkeypatch.setenv("XDG_CACHE_HOME", str(occupied))
    monkeypatch.setattr(tempfile, "tempdir", str(occupied))
    with pytest.warns(CacheFolderWarning):
        file = record_file("trial", "a device", ())
    write_record(file, {"a": 1})
    assert (file, read_record(file)) == (None, None)


PACKAGE = "import numba\n@numba.njit(cache=True)\ndef twice(x):\n    return 2 * x\n"


def imported(folder):
    (folder / "a.py").write_text(PACKAGE)
    spec = util.spec_from_file_location("a", folder / "a.py")
    found = util.module_from_spec(spec)
    sys.modules["a"] = found
    spec.loader.exec_module(found)
    return found.twice


@pytest.mark.parametrize("named", [False, True])
def test_kernels_of_a_read_only_package_are_used_and_new_ones_kept_elsewhere(monkeypatch, tmp_path, named):
    package = tmp_path / "package"
    package.mkdir()
    if named:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "image"))
        numba.config.reload_config()
    imported(package)(1)
    read_only = str(tmp_path / "image" if named else package / "__pycache__")
    real = module.fault_of
    monkeypatch.setattr(
        module, "fault_of", lambda path: "Read-only file system" if str(path) == read_only else real(path)
    )
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        use_writable_kernel_cache(package)
    kept = tmp_path / "home" / ".cache" / "bentray" / "kernels"
    lines = [str(one.message) for one in said]
    reason = f"NUMBA_CACHE_DIR={read_only} cannot be written (Read-only file system)"
    where = f"{tmp_path}/home/.cache/bentray takes its place; NUMBA_CACHE_DIR names another one"
    assert lines == ([f"{reason}: {where}"] if named else [])
    assert os.environ["NUMBA_CACHE_DIR"] == str(kept)
    numba.config.reload_config()
    twice = imported(package)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.nb[ic]") if not path.is_symlink()}
    twice(1)
    assert sum(twice.stats.cache_hits.values()) == 1
    twice(1.5)
    assert {path: path.read_bytes() for path in before} == before
    assert Path(twice.stats.cache_path).is_relative_to(kept)
    assert any(not path.is_symlink() for path in kept.rglob("*.nbc"))


def test_other_libraries_get_a_folder_only_if_theirs_cannot_be_written(monkeypatch, tmp_path, occupied):
    assert use_writable_folder("MPLCONFIGDIR", "matplotlib") is None
    assert "MPLCONFIGDIR" not in os.environ
    monkeypatch.setenv("MPLCONFIGDIR", str(occupied))
    with pytest.warns(CacheFolderWarning, match=f"MPLCONFIGDIR={occupied} cannot be written"):
        assert use_writable_folder("MPLCONFIGDIR", "matplotlib") == occupied
    assert os.environ["MPLCONFIGDIR"] == str(tmp_path / "home" / ".cache" / "bentray" / "matplotlib")


def test_a_package_that_can_be_written_keeps_its_kernels(tmp_path):
    use_writable_kernel_cache(tmp_path)
    assert "NUMBA_CACHE_DIR" not in os.environ
