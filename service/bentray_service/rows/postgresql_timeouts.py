"""Connections to PostgreSQL with a time limit for each answer, also if the server hangs."""

from typing import Any

import psycopg
from psycopg.abc import PQGen

# Of a server that has received the statement; usually milliseconds, s.
ANSWER_SECONDS = 10.0


class TimeoutConnection(psycopg.Connection[Any]):
    """Every statement, commit and rollback fails after ``ANSWER_SECONDS``, and the connection is closed.

    Time limits of the server itself do not work while it is stopped.
    """

    def wait(self, gen: PQGen[Any], interval: float = 0.1, timeout: float | None = None) -> Any:
        """Raises:
        psycopg.OperationalError: when no answer comes in time.
        """
        # An attribute of the module, so that tests can change the limit.
        try:
            return super().wait(gen, interval, ANSWER_SECONDS if timeout is None else timeout)
        except psycopg.errors._WaitTimeout:
            # A late answer would be taken for that of the next statement.
            self.pgconn.finish()
            raise
