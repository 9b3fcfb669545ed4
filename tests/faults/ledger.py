"""Record of all responses of a service: counts by status, and which ids each tenant received."""

import re
import threading
from collections import Counter, defaultdict

import httpx

# Ids of geometry fields tell what is in them, so two tenants may have the same.
ID = re.compile(r"\b(?:ds|job|vol|mesh|up)-[0-9a-f]{20}\b")
LATER = (429, 503)
# What a service may answer that works as it should, beyond 499.
ALLOWED = (503, 507)


class Ledger:
    """Fills from many threads.

    Attributes:
        counts: answers by who asked, what and the status.
        faults: every answer that no request may get, in words.
    """

    def __init__(self) -> None:
        self.counts: Counter[tuple[str, str, int]] = Counter()
        self.faults: list[str] = []
        self._ids: defaultdict[str, set[str]] = defaultdict(set)
        self._lock = threading.Lock()

    def note(self, who: str, answer: httpx.Response) -> None:
        """Take down an answer whose body has been read."""
        request = answer.request
        kind = answer.headers.get("content-type", "")
        told = answer.text if "json" in kind or "event-stream" in kind else ""
        told += answer.headers.get("location", "")
        if "event-stream" not in kind:
            asked = str(request.url)
            with_body = request.content.decode(errors="replace") if _is_json(request) else ""
            told_ids = set(ID.findall(told)) - set(ID.findall(asked + with_body))
            with self._lock:
                self._ids[who] |= told_ids
        self.count(who, f"{request.method} {ID.sub('*', request.url.path)}", answer.status_code)
        if answer.status_code in LATER and "retry-after" not in answer.headers:
            self.fault(f"{request.method} {request.url}: {answer.status_code} without Retry-After")
        if answer.status_code >= 500 and answer.status_code not in ALLOWED:
            self.fault(f"{request.method} {request.url}: {answer.status_code} {answer.text[:500]}")

    def count(self, who: str, what: str, status: int) -> None:
        """Take down the status of an answer alone."""
        with self._lock:
            self.counts[who, what, status] += 1

    def fault(self, words: str) -> None:
        """Take down what must not happen."""
        with self._lock:
            self.faults.append(words)

    def ids(self, who: str) -> set[str]:
        """The ids that were named to somebody who did not name them first."""
        with self._lock:
            return set(self._ids[who])

    def told_to_two(self) -> set[str]:
        """Ids that were named to two tenants."""
        result = Counter(item for its in self._ids.values() for item in its)
        return {value for value, times in result.items() if times > 1}

    def statuses(self, who: str) -> dict[int, int]:
        """How often somebody got which status."""
        result: Counter[int] = Counter()
        for (whose, _, status), times in self.counts.items():
            result[status] += times if whose == who else 0
        return {status: times for status, times in sorted(result.items()) if times}


def _is_json(request: httpx.Request) -> bool:
    return request.headers.get("content-type", "") == "application/json"
