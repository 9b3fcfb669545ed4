"""The sandbox: a reader that crashes, hangs or eats the memory is a refused file, never more."""

import os
import signal
import sys
import threading
from pathlib import Path

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.errors import QuotaExceeded, StorageFull
from bentray_service.ingest import sandbox

LIMITS = {"memory_bytes": 4 * 1024**3, "seconds": 60.0}


@pytest.fixture
def program(monkeypatch, tmp_path):
    """Run a program of the test's own in place of the reader."""

    def use(text):
        stand_in = tmp_path / "python"
        (tmp_path / "program.py").write_text(text)
        stand_in.write_text(f'#!/bin/sh\nshift 3\nexec {sys.executable} {tmp_path / "program.py"} "$@"\n')
        stand_in.chmod(0o755)
        monkeypatch.setattr(sandbox.sys, "executable", str(stand_in))

    return use


def run(source, tmp_path, **more):
    return sandbox.ingest("dataset", source, tmp_path / "out.h5", scratch=tmp_path, **{**LIMITS, **more})


def test_a_good_file(scan, tmp_path):
    assert run(scan(), tmp_path)["elements"] == 16
    assert (tmp_path / "out.h5").exists()


def test_not_hdf5(tmp_path):
    (tmp_path / "in").write_bytes(b"no HDF5 at all")
    with pytest.raises(InvalidInput, match=r"; accepted: .*HDF5"):
        run(tmp_path / "in", tmp_path)


def test_a_killed_reader_is_a_refused_file(program, scan, tmp_path):
    program("import time; time.sleep(60)")

    def kill(process_id):
        threading.Timer(0.2, os.killpg, (process_id, signal.SIGKILL)).start()

    with pytest.raises(InvalidInput, match="SIGKILL"):
        run(scan(), tmp_path, started=kill)


def test_a_reader_that_hangs_is_ended_with_its_children(program, scan, tmp_path):
    program("import os, time\nopen('pid', 'w').write(str(os.fork() or os.getpid()))\ntime.sleep(60)")
    with pytest.raises(InvalidInput, match="takes longer than 1 s"):
        run(scan(), tmp_path, seconds=0.25)
    status = Path("/proc", (tmp_path / "pid").read_text(), "stat")
    # Gone, or dead and not yet collected by the process that inherited it.
    assert not status.exists() or status.read_text().split()[2] == "Z"


def test_size_is_reported_before_writing(scan, tmp_path):
    told = []

    def reserve(size):
        told.append((size, (tmp_path / "out.h5").exists()))

    run(scan(), tmp_path, reserve=reserve)
    # Positions, emitters and receivers, and a travel time a pair.
    assert told == [(16 * 2 * 8 + 2 * 16 * 8 + 16 * 16 * 8, False)]


def test_a_size_that_is_rejected_ends_the_reader_and_nothing_is_written(scan, tmp_path):
    running = []

    def reserve(size):
        raise QuotaExceeded("storage", f"{size} bytes", "fewer")

    with pytest.raises(QuotaExceeded):
        run(scan(), tmp_path, reserve=reserve, started=running.append)
    with pytest.raises(ProcessLookupError):
        os.kill(running[0], 0)
    assert {path.name for path in tmp_path.iterdir()} == {"scan.h5"}


def test_temporary_files_of_a_reader_lie_beside_the_file_it_makes(program, scan, tmp_path):
    """A reader that is killed does not remove them; the caller removes the folder."""
    program(
        "import tempfile, time\n"
        "with tempfile.NamedTemporaryFile() as file:\n"
        "    print('{\"reserve\": 1}', flush=True)\n    time.sleep(60)\n"
    )
    (tmp_path / "own").mkdir()

    def kill(size):
        raise QuotaExceeded("storage", f"{size} bytes", "fewer")

    with pytest.raises(QuotaExceeded):
        sandbox.ingest(
            "dataset", scan(), tmp_path / "own" / "out.h5", scratch=tmp_path, reserve=kill, **LIMITS
        )
    assert len(list((tmp_path / "own").iterdir())) == 1


def test_verbose_failing_reader_does_not_hang(program, scan, tmp_path, caplog):
    program("import sys; sys.stderr.write('x' * 1_000_000); raise SystemExit(7)")
    with pytest.raises(InvalidInput, match="exit code 7"):
        run(scan(), tmp_path)
    assert len(caplog.text) < 10_000


def test_a_large_file_has_more_time(program, tmp_path):
    program(
        "import sys, json; print(json.dumps({'ok': {'seconds': sys.argv[sys.argv.index('--seconds') + 1]}}))"
    )
    with (tmp_path / "large").open("wb") as file:
        file.truncate(100 * 2**20)
    assert run(tmp_path / "large", tmp_path, seconds=30.0) == {"seconds": "42.0"}


def test_a_canonical_file_may_be_larger_than_the_memory(program, scan, tmp_path):
    program(
        "import sys, json, resource\n"
        "from pathlib import Path\n"
        "from bentray_service.ingest import ingest_process\n"
        "most = lambda: resource.getrlimit(resource.RLIMIT_FSIZE)[0]\n"
        "ingest_process.convert_upload = lambda *given: {'ok': {'most': most()}}\n"
        "ingest_process.main()\n"
    )
    with (tmp_path / "large").open("wb") as file:
        file.truncate(3 * 2**30)
    assert run(tmp_path / "large", tmp_path) == {"most": 6 * 2**30}
    assert run(scan(), tmp_path) == {"most": LIMITS["memory_bytes"]}


def test_a_reader_that_crashes(program, scan, tmp_path):
    program("import os; os.abort()")
    with pytest.raises(InvalidInput, match="SIGABRT"):
        run(scan(), tmp_path)


def test_full_disk_is_reported(program, scan, tmp_path):
    program("print('{\"full\": true}')")
    with pytest.raises(StorageFull, match="no space"):
        run(scan(), tmp_path)


def test_memory_is_limited(program, scan, tmp_path):
    program(
        "import sys, json\n"
        "from bentray_service.ingest.ingest_process import limit_resources\n"
        "limit_resources(int(sys.argv[sys.argv.index('--memory') + 1]), 60)\n"
        "try:\n    bytearray(2 * 1024**3)\n    found = 'room'\n"
        "except MemoryError:\n    found = 'no room'\n"
        "print(json.dumps({'error': {'field': 'file', 'found': found, 'accepted': ''}}))\n"
    )
    with pytest.raises(InvalidInput, match="no room"):
        run(scan(), tmp_path, memory_bytes=1024**3)


def test_out_of_memory_is_reported(scan, tmp_path):
    with pytest.raises(InvalidInput, match="memory"):
        run(scan(), tmp_path, memory_bytes=48 * 1024**2)


def test_the_environment_is_not_handed_on(program, scan, tmp_path, monkeypatch):
    monkeypatch.setenv("BENTRAY_DATABASE_URL", "postgresql://user:secret@db/x")
    program("import os, json; print(json.dumps({'ok': dict(os.environ)}))")
    assert "BENTRAY_DATABASE_URL" not in run(scan(), tmp_path)
