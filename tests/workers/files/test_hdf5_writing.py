"""HDF5 files that are written whole, or fail with an ordinary error."""

import errno
import resource
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from bentray_workers.files.hdf5_writing import atomic_hdf5

# A file-size limit refuses writes half-way through a file, as a full disk does.
WRITER = """
import sys
from pathlib import Path
import numpy as np
from bentray_workers.files.hdf5_writing import atomic_hdf5
try:
    with atomic_hdf5(Path(sys.argv[1])) as file:
        for k in range(20):
            data = np.random.default_rng(k).random(4000)
            file.create_dataset(f"a{k}", data=data, chunks=True, compression="gzip")
except OSError as error:
    sys.exit(error.errno)
"""


def test_written_values_are_readable(tmp_path: Path) -> None:
    with atomic_hdf5(tmp_path / "a.h5") as file:
        file["x"] = np.arange(5)
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["x"][()].tolist() == [0, 1, 2, 3, 4]
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


@pytest.mark.parametrize("limit", [1, 800, 2048, 10_000, 100_000, 300_000])
def test_failed_write_is_an_error_and_leaves_no_file(tmp_path: Path, limit: int) -> None:
    def bound() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    done = subprocess.run(
        [sys.executable, "-B", "-c", WRITER, str(tmp_path / "a.h5")], preexec_fn=bound, capture_output=True
    )
    assert done.returncode == errno.EFBIG, done.stderr
    assert done.stderr == b""
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_the_writer_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a.h5"
    target.write_bytes(b"old")
    with pytest.raises(TypeError), atomic_hdf5(target) as file:
        file["x"] = object()
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]
