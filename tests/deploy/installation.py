"""The parts of docker-compose.yml as processes of this machine: same commands and environment, own ports."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from .. import postgresql
from ..free_ports import free_port
from . import compose

PATIENCE_S = 240.0
# In the order of depends_on.
PARTS = ("database", "scheduler", "worker", "service")
PROGRAMS = {
    "bentray": [sys.executable, "-m", "bentray_service.cli"],
    "dask": [sys.executable, "-m", "dask"],
    "python": [sys.executable],
}


class Installation:
    """Database, scheduler, worker and service, each of which can be killed and started again.

    Args:
        folder: for the volume ``data``, scratch files, the password and logs.
        overrides: compose files on top of docker-compose.yml.
    """

    def __init__(self, folder: Path, *overrides: Path) -> None:
        self.folder = folder
        self.services: dict[str, Any] = compose.read(*overrides)["services"]
        password = folder / "database-password"
        subprocess.run([str(compose.ROOT / "deploy" / "secrets.sh"), str(folder)], check=True)
        owner = self.services["database"]["environment"]
        self.database = postgresql.Server(owner["POSTGRES_USER"], password.read_text(), owner["POSTGRES_DB"])
        self.ports = {"scheduler": free_port(), "service": free_port()}
        self.key = (folder / "first-key").read_text()
        self.url = f"http://127.0.0.1:{self.ports['service']}"
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        (folder / "data").mkdir()
        (folder / "scratch").mkdir()
        # Longest first; what stands for an address inside of the containers, and what is here in its place.
        self._here = {
            "scheduler:8786": f"127.0.0.1:{self.ports['scheduler']}",
            "127.0.0.1:8786": f"127.0.0.1:{self.ports['scheduler']}",
            "database:5432": f"127.0.0.1:{self.database.port}",
            "/run/secrets/database-password": str(password),
            "/run/secrets/first-key": str(folder / "first-key"),
            "/run/secrets": str(folder / "tls"),
            "0.0.0.0": "127.0.0.1",
        }
        self._whole = {
            "8786": str(self.ports["scheduler"]),
            "--port=8786": f"--port={self.ports['scheduler']}",
            "8000": str(self.ports["service"]),
            "/data": str(folder / "data"),
            "/tmp": str(folder / "scratch"),
        }

    def start(self, part: str) -> None:
        """Start a part that is not running, as the container engine would."""
        if part == "database":
            if self.database.process.poll() is not None:
                self.database.start()
            return
        with (self.folder / f"{part}.log").open("ab") as log:
            self._processes[part] = subprocess.Popen(
                self.words(self.services[part]["command"]),
                env=self.environment(part),
                cwd=self.folder,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def kill(self, part: str) -> None:
        """SIGKILL to every process of a part, without a word before."""
        if part == "database":
            self.database.kill()
            return
        process = self._processes.pop(part)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def pid(self, part: str) -> int:
        """Process that the command of a part became."""
        return self._processes[part].pid

    def healthy(self, part: str) -> bool:
        """Answer of the health check of a part."""
        _, *words = self.services[part]["healthcheck"]["test"]
        words = self.words(words)
        environment = self.environment(part)
        if part == "database":
            words = [str(self.database.folder_of_programs / words[0]), *words[1:]]
            words += ["--host=127.0.0.1", f"--port={self.database.port}"]
        elif part == "service":
            words.append(self.url)
        return subprocess.run(words, env=environment, capture_output=True, check=False).returncode == 0

    def wait_for(self, part: str) -> None:
        """Until the health check of a part passes."""
        deadline = time.monotonic() + PATIENCE_S
        while not self.healthy(part):
            assert time.monotonic() < deadline, f"{part} stays unhealthy; its log ends: {self.log(part)}"
            # Each check is a process: to ask all the time would take the core that the part starts on.
            time.sleep(1.0)

    def log(self, part: str) -> str:
        """The last words of a part."""
        path = self.database.folder / "log" if part == "database" else self.folder / f"{part}.log"
        return path.read_text(errors="replace")[-3000:]

    def words(self, command: list[str]) -> list[str]:
        """A command of the file as it is run here."""
        program, *rest = command
        return [*PROGRAMS.get(program, [program]), *(self.mapped(word) for word in rest)]

    def environment(self, part: str) -> dict[str, str]:
        """The environment of a part: that of the file, beside what any program of this machine needs."""
        needed = ("PATH", "HOME", "PYTHONPATH", "TMPDIR")
        asked = self.services[part]["environment"]
        return {
            **{name: os.environ[name] for name in needed if name in os.environ},
            **{name: self.mapped(str(value)) for name, value in asked.items() if value is not None},
            "NUMBA_NUM_THREADS": "1",
        }

    def mapped(self, text: str) -> str:
        """A word of the file with the ports and folders of this machine."""
        if text in self._whole:
            return self._whole[text]
        for there, here in self._here.items():
            text = text.replace(there, here)
        return text

    def close(self) -> None:
        """End everything."""
        for part in reversed(list(self._processes)):
            self.kill(part)
        self.database.close()
