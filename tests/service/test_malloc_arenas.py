"""However many threads a service has, the allocator divides its memory into few arenas."""

import os
import subprocess
import sys

import pytest

from bentray_service.cli.serve import MAX_ARENAS

# Prints how many arenas there are once many threads have allocated.
PROGRAM = """
import ctypes, sys, tempfile, threading
from bentray_service.cli.serve import limit_arenas

if sys.argv[1] == "limited":
    limit_arenas()
libc = ctypes.CDLL(None)
libc.malloc.restype = libc.fdopen.restype = ctypes.c_void_p
libc.malloc_info.argtypes = [ctypes.c_int, ctypes.c_void_p]
libc.fflush.argtypes = [ctypes.c_void_p]
together = threading.Barrier(32)

def allocate():
    together.wait()
    for _ in range(100):
        libc.malloc(1000)
    together.wait()

threads = [threading.Thread(target=allocate) for _ in range(32)]
for one in threads:
    one.start()
for one in threads:
    one.join()
with tempfile.TemporaryFile() as file:
    stream = libc.fdopen(file.fileno(), b"w")
    libc.malloc_info(0, stream)
    libc.fflush(stream)
    file.seek(0)
    print(file.read().count(b"<heap nr="))
"""


def arenas(how: str) -> int:
    """How many there are in a process that limits them or does not."""
    # Workers that an earlier test started leave their own limit in this process's environment.
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("MALLOC_", "GLIBC_"))}
    command = [sys.executable, "-c", PROGRAM, how]
    return int(subprocess.run(command, capture_output=True, text=True, check=True, env=clean).stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="glibc alone has arenas")
def test_many_threads_share_few_arenas() -> None:
    assert arenas("as ever") > MAX_ARENAS
    assert arenas("limited") <= MAX_ARENAS
