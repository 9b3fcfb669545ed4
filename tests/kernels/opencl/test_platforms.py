"""Drivers: Intel's is added where its package is installed, and a device is traced to its package."""

import os
from importlib import metadata
from pathlib import Path

import pyopencl as cl
import pytest

from bentray_kernels.opencl import platforms, select_device
from bentray_kernels.opencl.library import files_of, library_of, package_of


class Loader:
    """Keeps the lists that were there when it was asked, as the loader reads them at its first question."""

    def __init__(self):
        self.lists = []

    def __call__(self):
        folder = Path(os.environ["PYOPENCL_HOME"], ".libs")
        self.lists.append({file.name: file.read_text() for file in folder.glob("*.icd")})
        return ["a platform"]


@pytest.fixture
def loader(monkeypatch, tmp_path):
    """A wheel of pyopencl with PoCL on its list, a system without drivers, and nothing asked yet."""
    wheel = tmp_path / "pyopencl"
    (wheel / ".libs").mkdir(parents=True)
    (wheel / ".libs" / "pocl.icd").write_text("libpocl-1.so")
    loader = Loader()
    monkeypatch.setenv("PYOPENCL_HOME", str(wheel))
    monkeypatch.setattr(cl, "get_platforms", loader)
    monkeypatch.setattr(platforms, "SYSTEM", str(tmp_path / "vendors"))
    for word in platforms.SYSTEM_VARIABLES:
        monkeypatch.delenv(word, raising=False)
    platforms._register_intel.cache_clear()
    yield loader
    platforms._register_intel.cache_clear()


@pytest.fixture
def intel(monkeypatch, tmp_path):
    library = tmp_path / "lib" / "libintelocl.so"
    library.parent.mkdir()
    library.touch()
    monkeypatch.setattr(platforms, "files_of", lambda package, name: iter([library]))
    return library


def test_without_the_package_the_loader_is_used_unchanged(loader, monkeypatch):
    monkeypatch.setattr(platforms, "files_of", lambda package, name: iter(()))
    assert platforms.platforms() == ["a platform"]
    assert loader.lists == [{"pocl.icd": "libpocl-1.so"}]


def test_first_query_finds_both_platforms(loader, intel, tmp_path):
    for _ in range(2):
        assert platforms.platforms() == ["a platform"]
    both = {"pocl.icd": "libpocl-1.so", "intel.icd": f"{intel}\n"}
    assert loader.lists[0] == both
    assert both not in loader.lists[1:]
    assert os.environ["PYOPENCL_HOME"] == str(tmp_path / "pyopencl")


@pytest.mark.parametrize("variable", ["", *platforms.SYSTEM_VARIABLES])
def test_the_systems_own_is_not_added_twice(loader, intel, monkeypatch, tmp_path, variable):
    vendors = tmp_path / ("elsewhere" if variable else "vendors")
    vendors.mkdir()
    (vendors / "broken.icd").write_bytes(b"\xff\xfe")
    (vendors / "intel64.icd").write_text("/usr/lib/intel/libintelocl.so.2026\n")
    if variable:
        monkeypatch.setenv(variable, str(vendors))
    platforms.platforms()
    assert loader.lists == [{"pocl.icd": "libpocl-1.so"}]


def test_the_systems_other_drivers_do_not_matter(loader, intel, tmp_path):
    (tmp_path / "vendors").mkdir()
    (tmp_path / "vendors" / "nvidia.icd").write_text("libnvidia-opencl.so.1\n")
    platforms.platforms()
    assert "intel.icd" in loader.lists[0]


def test_another_loader_is_left_alone(loader, intel, monkeypatch):
    monkeypatch.delenv("PYOPENCL_HOME")
    monkeypatch.setattr(cl, "get_platforms", list)
    assert platforms.platforms() == []
    assert loader.lists == []


def test_without_a_folder_for_a_list_the_loader_is_used_unchanged(loader, intel, monkeypatch):
    def full(**_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(platforms.tempfile, "TemporaryDirectory", full)
    platforms.platforms()
    assert loader.lists == [{"pocl.icd": "libpocl-1.so"}]


@pytest.mark.opencl
def test_a_device_names_the_file_that_it_was_loaded_from():
    device = select_device().device
    assert Path(device.library).is_file()
    assert ".so" in Path(device.library).name
    if "site-packages" in device.library:
        assert device.package


def test_a_device_that_no_driver_made_has_no_library():
    class Handle:
        int_ptr = 0

    assert library_of(Handle()) == ""


def test_a_library_of_the_system_has_no_package():
    assert package_of("") == ""
    assert package_of("/usr/lib/x86_64-linux-gnu/libpocl.so.2.9.0") == ""


def test_the_package_is_the_one_whose_record_names_the_file():
    listed = list(files_of("pocl-binary-distribution", "libpocl-21062cec.so"))
    for file in listed:
        assert (
            package_of(str(file))
            == f"pocl-binary-distribution {metadata.version('pocl-binary-distribution')}"
        )
    assert list(files_of("no-such-package", "libpocl.so")) == []
