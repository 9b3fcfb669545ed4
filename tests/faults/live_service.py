"""`bentray serve` as a process of its own, with embedded workers and keys for some tenants."""

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from bentray_service.rows.database import open_database
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys

from ..free_ports import free_port
from .machine import PATIENCE_S, below, command_of, of_session

# The first start on a machine compiles the kernels.
START_S = 600.0


class LiveService:
    """A service that asks for keys.

    Args:
        folder: for data and logs.
        tenants: each of whom is given a key; without any, none is asked for.
        environment: of the service, beside where its data are.

    Attributes:
        data: the data folder; log: what the service says.
        port: of 127.0.0.1, on which it listens; url: its address.
        keys: of each tenant.
        process: the service itself.
    """

    def __init__(self, folder: Path, tenants: Sequence[str], workers: int = 2, **environment: str) -> None:
        self.data, self.log = folder / "data", folder / "service.log"
        given = {name: value for name, value in os.environ.items() if not name.startswith("BENTRAY_")}
        self._environment = {**given, "BENTRAY_DATA_DIR": str(self.data), **environment}
        self._workers = workers
        self.keys = {tenant: self._key(tenant) for tenant in tenants}
        # One that is still free when the service is started again.
        self.start(free_port())

    def start(self, port: int) -> None:
        """Start it on a port, and wait until it listens."""
        command = self._command("serve", "--port", str(port), "--workers", str(self._workers), "--json")
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                command, env=self._environment, stdout=subprocess.PIPE, stderr=log, start_new_session=True
            )
        assert self.process.stdout is not None
        try:
            assert select.select([self.process.stdout], [], [], START_S)[0], "it did not start in time"
            self.url = str(json.loads(self.process.stdout.readline())["url"])
        except BaseException:
            self.kill()
            raise
        self.port = int(self.url.rpartition(":")[2])

    def worker_pids(self) -> list[int]:
        """The processes that run tasks."""
        return sorted(pid for pid in below(self.process.pid) if b"spawn_main" in command_of(pid))

    def stop(self, patience_s: float) -> list[int]:
        """Ask it to end, and wait for that; the processes of it that are left."""
        self.process.terminate()
        self.process.wait(patience_s)
        return of_session(self.process.pid)

    def kill(self) -> None:
        """End it and all that it has started; may be called more than once."""
        for pid in of_session(self.process.pid):
            os.kill(pid, signal.SIGKILL)
        self.process.wait(PATIENCE_S)
        if self.process.stdout is not None:
            self.process.stdout.close()

    def _command(self, *words: str) -> list[str]:
        return [sys.executable, "-m", "bentray_service.cli", *words]

    def _key(self, tenant: str) -> str:
        """A new key, as of ``bentray keys create``, without a process for it."""
        self.data.mkdir(parents=True, exist_ok=True)
        embedded = f"sqlite:///{self.data.resolve() / 'bentray.sqlite'}"
        database = open_database(self._environment.get("BENTRAY_DATABASE_URL", embedded))
        token = ApiKey.new()
        Keys(database).add(token, Tenant(tenant), "test", ("read", "write"))
        database.close()
        return token.shown()
