"""Lines of a log about kernels that are compiled."""

import logging

from bentray_kernels.compilation.compile_events import Compilation
from bentray_workers.compilation import cache_misses


def test_a_log_has_the_first_kernel_and_the_counts(monkeypatch, caplog):
    counts = Compilation(31, 120, active=True)
    monkeypatch.setattr(cache_misses, "compilation", lambda: counts)
    monkeypatch.setattr(cache_misses, "LINE_S", 0.0)
    caplog.set_level(logging.WARNING, "bentray.compiling")
    with_bar, of_worker = (cache_misses.Announcer(counts=counts) for counts in (False, True))
    for announcer in (with_bar, of_worker):
        announcer.on_start(None)
        announcer.on_end(None)
        announcer.on_start(None)
    first, alone, line = (record.getMessage() for record in caplog.records)
    assert first == alone
    assert first.startswith("Compiling kernels for this processor (")
    assert line == "Compiling kernels: 31 of 120"
