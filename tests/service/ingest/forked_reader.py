"""Reads many files under the limits of the ingest process, but forks for each instead of starting anew.

``python forked_reader.py MEMORY SECONDS FILES.json`` takes a list of [what, path, given] and prints a line of
JSON for each file: the answer, how the fork ended, its seconds and the most memory that it held.
"""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from bentray_service.ingest import ingest_process, sandbox

MEMORY_BYTES = 2 * 2**30
# Of processor time: a file that takes more sends HDF5 round in circles.
SECONDS = 2.0


@dataclass(frozen=True)
class Read:
    """End of one read: ``status`` by ``os.wait4``, 0 for an orderly end."""

    answer: dict[str, Any] | None
    status: int
    seconds: float
    most_bytes: int

    @property
    def refused(self) -> bool:
        """Whether the service would answer 422; it does so for a reader that crashed, too."""
        return self.status != 0 or "error" in (self.answer or {})


def read_all(files: list[tuple[str, Path, dict[str, Any]]], folder: Path) -> list[Read]:
    """Read each file in a process of its own, apart from the caller's."""
    listed = folder / "files.json"
    listed.write_text(json.dumps([[what, str(path), given] for what, path, given in files]))
    command = [sys.executable, "-I", __file__, str(MEMORY_BYTES), str(SECONDS), str(listed)]
    ended = subprocess.run(command, env=sandbox.ENVIRONMENT, cwd=folder, capture_output=True, check=True)
    return [Read(**json.loads(line)) for line in ended.stdout.splitlines()]


def main() -> None:
    memory, seconds = int(sys.argv[1]), float(sys.argv[2])
    files = json.loads(Path(sys.argv[3]).read_text())
    # What every fork needs is imported once.
    for what in {what for what, _, _ in files}:
        ingest_process.convert_upload(what, Path("/dev/null"), Path("/dev/null/none"), {"title": ""})
    for name in ("bentray_workers.files.reconstruction", "nibabel", "nrrd", "scipy.io", "trimesh"):
        import_module(name)
    for what, path, given in files:
        sys.stdout.write(json.dumps(read_one(memory, seconds, what, Path(path), given)) + "\n")
        # Or every fork to come would write it again.
        sys.stdout.flush()


def read_one(memory: int, seconds: float, what: str, path: Path, given: dict[str, Any]) -> dict[str, Any]:
    source, sink = os.pipe()
    begun = time.monotonic()
    process_id = os.fork()
    if process_id == 0:
        ingest_process.limit_resources(memory, seconds)
        # Ends it also inside of a library, which the limit of processor time does only while it computes.
        signal.alarm(30 * int(seconds))
        answer = ingest_process.convert_upload(what, path, path.with_suffix(".canonical"), given)
        os.write(sink, json.dumps(answer).encode())
        os._exit(0)
    os.close(sink)
    with os.fdopen(source, "rb") as pipe:
        said = pipe.read()
    _, status, used = os.wait4(process_id, 0)
    return {
        "answer": json.loads(said) if said else None,
        "status": status,
        "seconds": time.monotonic() - begun,
        "most_bytes": used.ru_maxrss * 1024,
    }


if __name__ == "__main__":
    main()
