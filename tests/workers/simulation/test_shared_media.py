"""Media that threads share: each is made once, and a small one does not wait for a large one."""

import threading
from concurrent.futures import ThreadPoolExecutor

from bentray_workers.simulation.shared_media import made_once

PATIENCE_S = 60.0


def test_each_is_made_once_and_none_waits_for_another() -> None:
    leave, begun, made = threading.Event(), threading.Event(), []

    @made_once(2)
    def medium(name: str) -> str:
        made.append(name)
        if name == "large":
            begun.set()
            assert leave.wait(PATIENCE_S)
        return name.upper()

    with ThreadPoolExecutor(3) as pool:
        large = [pool.submit(medium, "large") for _ in range(2)]
        assert begun.wait(PATIENCE_S)
        assert pool.submit(medium, "small").result(PATIENCE_S) == "SMALL"
        assert not any(future.done() for future in large)
        leave.set()
        assert [future.result(PATIENCE_S) for future in large] == ["LARGE", "LARGE"]
    assert made == ["large", "small"]
    assert [medium(name) for name in ("third", "small", "large")] == ["THIRD", "SMALL", "LARGE"]
    assert made == ["large", "small", "third", "large"]


def test_what_fails_is_made_again() -> None:
    made = []

    @made_once(1)
    def medium(name: str) -> str:
        made.append(name)
        if len(made) == 1:
            raise MemoryError
        return name

    try:
        medium("a")
    except MemoryError:
        assert medium("a") == "a"
    assert made == ["a", "a"]
