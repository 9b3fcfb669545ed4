"""The hostile list: the service holds against every attack; ``python -m tests.hostile`` prints the table."""

from __future__ import annotations

import pytest

from ..edge import SKIPPED, program
from .hostile_list import LISTS, run_list

pytestmark = pytest.mark.nightly


@pytest.mark.parametrize("name", LISTS)
def test_the_service_holds(tmp_path, name):
    if name == "edge" and program() is None:
        pytest.skip(SKIPPED)
    outcomes = run_list(name, tmp_path, print)
    assert [(outcome.attack.name, outcome.seen) for outcome in outcomes if not outcome.held] == []
