"""How many uploads may be on their way: of one tenant, in all, and begun in a minute."""

from contextlib import ExitStack

import pytest

from bentray_service.errors import Busy, RateLimited
from bentray_service.ingest.upload_limits import UploadLimits
from bentray_service.rows.ids import Tenant

from ..conftest import NoProjects

ONE, OTHER, THIRD = Tenant("one"), Tenant("other"), Tenant("third")


def test_uploads_are_limited_per_tenant_and_in_total():
    limits = UploadLimits(NoProjects(), of_account=2, in_all=3)
    with ExitStack() as stack:
        for tenant in (ONE, ONE, OTHER):
            stack.enter_context(limits(tenant))
        with pytest.raises(RateLimited, match="2 in progress; accepted: at most 2 per tenant"), limits(ONE):
            raise AssertionError
        with pytest.raises(Busy, match="3 in progress"), limits(THIRD):
            raise AssertionError
    with limits(ONE), limits(THIRD):
        pass


def test_failed_upload_is_removed():
    limits = UploadLimits(NoProjects(), of_account=1)
    for _ in range(3):
        with pytest.raises(ConnectionError), limits(ONE):
            raise ConnectionError


def test_new_uploads_per_minute_are_limited():
    limits = UploadLimits(NoProjects(), begun_per_minute=3)
    for _ in range(3):
        limits.check_begin(ONE)
    with pytest.raises(RateLimited, match="more than 3 new uploads per minute") as refused:
        limits.check_begin(ONE)
    assert 0.0 < refused.value.wait_s <= 20.0
    limits.check_begin(OTHER)
