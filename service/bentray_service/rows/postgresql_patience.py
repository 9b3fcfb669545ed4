"""Connections to PostgreSQL that wait a limited time for each answer, also of a server that stands still."""

from __future__ import annotations

from typing import Any

import psycopg
from psycopg.abc import PQGen

# Of a server that has taken the statement in; one that is well needs milliseconds.
ANSWER_SECONDS = 10.0


class TimeoutConnection(psycopg.Connection[Any]):
    """Every statement, commit and rollback gives up after ``ANSWER_SECONDS``; the connection is closed then.

    A limit that the server keeps is of no use while the server itself is stopped.
    """

    def wait(self, gen: PQGen[Any], interval: float = 0.1, timeout: float | None = None) -> Any:
        """Raises:
        psycopg.OperationalError: when no answer comes in time.
        """
        # As an attribute of the module, so that the limit is looked up for each statement.
        try:
            return super().wait(gen, interval, ANSWER_SECONDS if timeout is None else timeout)
        except psycopg.errors._WaitTimeout:
            # Its answer may still come, and would be taken for that of the next statement.
            self.pgconn.finish()
            raise
