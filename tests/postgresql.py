"""A PostgreSQL server of a test's own, from the programs that Debian's package `postgresql` installs."""

import os
import pwd
import secrets
import shutil
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from .free_ports import free_port

START_S = 60.0
SKIPPED = "PostgreSQL is not installed, so nothing here was tried with it: apt-get install postgresql"


def programs() -> Path | None:
    """The folder of ``initdb`` and ``postgres``, the newest there is; None where there is none."""
    versions = Path("/usr/lib/postgresql").glob("*/bin/initdb")
    found = [path.parent for path in sorted(versions, key=lambda path: float(path.parts[-3]))]
    if on_path := shutil.which("initdb"):
        found.insert(0, Path(on_path).resolve().parent)
    return found[-1] if found else None


class Server:
    """PostgreSQL on loopback, with its data in a folder that goes when it is closed.

    Args:
        user, password, database: as the variables ``POSTGRES_…`` of the container image; all may connect by
            password only.
    """

    def __init__(self, user: str, password: str, database: str) -> None:
        folder = programs()
        assert folder is not None, SKIPPED
        self.folder_of_programs = folder
        self.user, self.password, self.database = user, password, database
        self.port = free_port()
        # Not below pytest's folders, which only root may enter: PostgreSQL refuses to run as root.
        self.folder = Path(tempfile.mkdtemp(prefix="bentray-postgresql-"))
        self._password_file = self.folder / "password"
        self._password_file.write_text(password)
        if os.getuid() == 0:
            for path in (self.folder, self._password_file):
                shutil.chown(path, self._account(), -1)
        words = ["initdb", "-D", "data", "-U", user, "-A", "scram-sha-256", "--pwfile=password", "-E", "UTF8"]
        self._run([*words, "--locale=C", "--no-sync"])
        self.start()
        if database != "postgres":
            self.psql(f'CREATE DATABASE "{database}"')

    def start(self) -> None:
        """Start the server, also after ``kill``, and wait until it answers."""
        words = ["postgres", "-D", "data", "-h", "127.0.0.1", "-p", str(self.port), "-k", str(self.folder)]
        with (self.folder / "log").open("ab") as log:
            self.process = subprocess.Popen(self._command(words), stdout=log, stderr=log, **self._who())  # type: ignore[call-overload]
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline:
            with suppress(subprocess.CalledProcessError):
                return self.psql("SELECT 1")
            time.sleep(0.05)
        raise TimeoutError((self.folder / "log").read_text())

    def kill(self) -> None:
        """End it as a power cut would; the shared memory of its children ends with it."""
        children = subprocess.run(["pgrep", "-P", str(self.process.pid)], capture_output=True, text=True)
        self.process.kill()
        self.process.wait()
        for child in children.stdout.split():
            # They notice by themselves too, a moment later.
            with suppress(ProcessLookupError):
                os.kill(int(child), 9)

    def address(self, database: str) -> str:
        """For SQLAlchemy."""
        return f"postgresql+psycopg://{self.user}:{self.password}@127.0.0.1:{self.port}/{database}"

    def new_database(self) -> str:
        """The address of an empty database."""
        name = f"t_{secrets.token_hex(6)}"
        self.psql(f"CREATE DATABASE {name}")
        return self.address(name)

    def drop(self, address: str) -> None:
        """Remove what ``new_database`` made, whoever is still connected."""
        self.psql(f"DROP DATABASE {address.rpartition('/')[2]} WITH (FORCE)")

    def empty(self, address: str) -> None:
        """Remove all tables, whoever is still connected: a third of the time of a new database."""
        self.psql(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
            " WHERE datname = current_database() AND pid <> pg_backend_pid();"
            " DROP SCHEMA public CASCADE; CREATE SCHEMA public",
            address.rpartition("/")[2],
        )

    def psql(self, words: str, database: str = "postgres") -> None:
        """Run statements as the owner."""
        where = ["-h", "127.0.0.1", "-p", str(self.port), "-U", self.user, "-d", database]
        self._run(["psql", "-q", "-X", *where, "-c", words])

    def close(self) -> None:
        """End it and remove its data."""
        self.kill()
        shutil.rmtree(self.folder)

    def _run(self, words: list[str]) -> None:
        environment = {**os.environ, "PGPASSWORD": self.password}
        subprocess.run(  # type: ignore[call-overload]
            self._command(words), check=True, capture_output=True, env=environment, **self._who()
        )

    def _command(self, words: list[str]) -> list[str]:
        return [str(self.folder_of_programs / words[0]), *words[1:]]

    def _who(self) -> dict[str, object]:
        if os.getuid() != 0:
            return {"cwd": self.folder}
        account = pwd.getpwnam(self._account())
        return {"cwd": self.folder, "user": account.pw_uid, "group": account.pw_gid, "extra_groups": []}

    @staticmethod
    def _account() -> str:
        with suppress(KeyError):
            return pwd.getpwnam("postgres").pw_name
        return "nobody"
