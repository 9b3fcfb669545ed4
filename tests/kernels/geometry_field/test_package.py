"""Reading a mesh does not load libigl."""

import subprocess
import sys


def test_reading_a_mesh_does_not_import_libigl():
    program = "import sys; from bentray_kernels.meshes.defects import sound; sys.exit('igl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
