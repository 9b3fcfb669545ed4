"""Reading a mesh does not load libigl."""

import subprocess
import sys


def test_to_read_a_mesh_takes_no_libigl():
    program = "import sys; from bentray_kernels.meshes.defects import sound; sys.exit('igl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
