"""The package gives its public names, and imports what they need only when they are asked for."""

import subprocess
import sys

import pytest

import bentray_kernels.geometry_field as package


@pytest.mark.parametrize("name", package.__all__)
def test_every_name_is_there_and_from_here(name):
    found = getattr(package, name)
    assert found.__name__ == name
    assert found.__module__.startswith(package.__name__)


def test_what_is_not_there_is_told():
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        package.nothing  # noqa: B018


def test_to_read_a_mesh_takes_no_libigl():
    program = "import sys; from bentray_kernels.meshes.defects import sound; sys.exit('igl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
