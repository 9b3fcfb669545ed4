"""The audit log: one line of JSON per request, one file per day."""

import json
import logging
import os
import re
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

log = logging.getLogger("bentray.audit")

Entry = dict[str, Any]

# Frequent polls, which show no measurement data.
LEFT_OUT = frozenset(
    {
        ("GET", "/v1/jobs"),
        ("GET", "/v1/jobs/{job_id}"),
        ("GET", "/v1/jobs/{job_id}/events"),
        ("GET", "/v1/access"),
    }
)
_NAME = re.compile(r"(\d{4}-\d{2}-\d{2})\.jsonl")


class Audit:
    """Appends entries to the files of the audit log.

    An entry has ``time``, ``request``, ``tenant``, ``how``, ``who``, ``method``, ``route``, ``ids``,
    ``status``, ``received`` and ``sent`` (bytes), but no query, header or content.

    Attributes:
        lost: number of entries that could not be stored since the start.
    """

    def __init__(self, folder: Path, now: Callable[[], datetime] = lambda: datetime.now(UTC)) -> None:
        self._folder = folder
        self._now = now
        self.lost = 0

    def append(self, entry: Entry) -> None:
        """Append one entry; an entry that cannot be stored is written to the log."""
        if (entry["method"], entry["route"]) in LEFT_OUT:
            return
        now = self._now()
        line = json.dumps({"time": now.isoformat(timespec="milliseconds"), **entry})
        path = self._folder / f"{now:%Y-%m-%d}.jsonl"
        try:
            # A single write keeps lines intact; only the user of the service can read the file.
            handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            try:
                os.write(handle, f"{line}\n".encode())
            finally:
                os.close(handle)
        except OSError as error:
            self.lost += 1
            log.error("the audit log could not be written (%s): %s", error.strerror, line)

    def days_before(self, now: float, keep_days: float) -> list[str]:
        """The days, e.g. ``2026-11-25``, that ended more than ``keep_days`` before ``now``, s since 1970."""
        last = datetime.fromtimestamp(now, UTC) - timedelta(days=keep_days + 1.0)
        names = (_NAME.fullmatch(path.name) for path in self._folder.glob("*.jsonl"))
        return sorted(name[1] for name in names if name is not None and name[1] < f"{last:%Y-%m-%d}")

    def remove(self, day: str) -> None:
        """Delete the file of one day."""
        (self._folder / f"{day}.jsonl").unlink(missing_ok=True)


def entries(folder: Path) -> Iterator[Entry]:
    """All entries, oldest first; incomplete lines are skipped with a warning."""
    for path in sorted(folder.glob("*.jsonl")):
        if not _NAME.fullmatch(path.name):
            continue
        with path.open(encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(file, 1):
                try:
                    entry = json.loads(line)
                except ValueError:
                    log.warning("%s:%d is incomplete and skipped", path.name, number)
                    continue
                if isinstance(entry, dict):
                    yield entry
