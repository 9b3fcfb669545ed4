"""A device is traced to its library and to the package that brought it."""

from importlib import metadata
from pathlib import Path

import pytest

from bentray_kernels.opencl import select_device
from bentray_kernels.opencl.library import files_of, library_of, package_of


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
