"""The worker's memory cache: bounded by memory, and smaller while a job runs."""

import pytest

from bentray_workers.cluster import memory_cache
from bentray_workers.cluster.capacities import USABLE, WARM_BYTES
from bentray_workers.cluster.memory_cache import MemoryCache, set_memory_limit
from bentray_workers.cluster.task_retries import marked

MIB = 2**20


@pytest.fixture
def worker(monkeypatch):
    """A worker with room for 100 MiB."""
    monkeypatch.setattr(memory_cache, "_LIMITS", memory_cache._Limits())
    set_memory_limit(round((WARM_BYTES + 100 * MIB) / USABLE))


def test_new_entries_evict_old_ones_in_every_cache(worker):
    first, two = MemoryCache(1000 * MIB), MemoryCache(1000 * MIB)
    first.get("a", 30 * MIB, str)
    two.get("b", 30 * MIB, str)
    first.get("a", 30 * MIB, str)
    # 60 MiB are needed at once; what was used longest ago goes.
    two.get("c", 10 * MIB, str, 60 * MIB)
    assert (first.held(), two.held()) == (30 * MIB, 10 * MIB)


@pytest.mark.parametrize(
    ("limited", "job", "kept"), [(True, True, (10,)), (False, True, (30, 10)), (True, False, (30, 10))]
)
def test_a_job_alone_finds_little_kept_where_memory_is_limited(request, tmp_path, limited, job, kept):
    if limited:
        request.getfixturevalue("worker")
    store = MemoryCache(1000 * MIB)
    store.get("a", 30 * MIB, str)
    store.get("b", 10 * MIB, str)
    assert marked(tmp_path / "marker", job, store.held) == sum(kept) * MIB
