"""Parts of the service that work in a thread of their own until it stops."""

import logging
import threading
from typing import ClassVar

from .errors import DatabaseUnavailable


class BackgroundThread:
    """Repeats a step in a thread.

    Attributes:
        idle_s: pause after a step that leaves nothing to do, s; ``notify`` ends it.
        stop_s: longest wait for the thread when the service stops, s.
        failure: what an unexpected error prevents, for the log.
    """

    idle_s: ClassVar[float]
    stop_s: ClassVar[float] = 30.0
    failure: ClassVar[str]

    def __init__(self, name: str) -> None:
        self._log = logging.getLogger(f"bentray.{name}")
        self._wake, self._leaving = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._loop, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def alive(self) -> bool:
        """Whether the thread is alive."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End the thread after its present step."""
        self._leaving.set()
        self._wake.set()
        self._thread.join(self.stop_s)

    def notify(self) -> None:
        """Wake the thread."""
        self._wake.set()

    def _loop(self) -> None:
        while not self._leaving.is_set():
            # Before the step: what comes later wakes this thread again.
            self._wake.clear()
            try:
                if self._step():
                    continue
            except DatabaseUnavailable:
                # Already logged.
                pass
            except Exception:
                # An unexpected error must not end the thread.
                self._log.exception("%s; next attempt in %g s", self.failure, self.idle_s)
            self._wake.wait(self.idle_s)

    def _step(self) -> bool:
        """Do what is to be done now; returns whether to go on without a pause."""
        raise NotImplementedError
