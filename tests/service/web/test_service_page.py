"""The page of the service: workers, queue, storage against its quota, and the keys of the tenant."""

import httpx
import pytest
from playwright.sync_api import expect

from bentray_service.rows.database import open_database
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys

from .live_results import uploaded

pytestmark = pytest.mark.browser


def rows(page, name):
    """Texts of the cells of a table."""
    table = page.get_by_role("region", name=name, exact=True).locator("tbody tr")
    return [one.locator("th, td").all_inner_texts() for one in table.all()]


@pytest.mark.nightly
def test_without_keys(page, serve, scan, cluster):
    metrics = {"memory": 3 * 2**29, "cpu": 87.4, "task_counts": {"executing": 1}}
    one = {"nthreads": 2, "memory_limit": 2**31, "resources": {"recon": 1, "opencl": 1}, "metrics": metrics}
    second = {"nthreads": 2, "memory_limit": 2**31, "status": "paused"}
    cluster.scheduler_info = lambda n_workers: {"workers": {"a": one, "b": second}}
    address = serve(max_tenant_bytes=2**30)
    for _ in range(2):
        uploaded(address, scan())
    page.goto(f"{address}/#/service")
    page.get_by_role("region", name="Table of workers").wait_for()
    assert rows(page, "Table of workers") == [
        ["Worker 1", "ready", "1.5 GiB of 2 GiB", "2", "87 %", "1", "available"],
        ["Worker 2", "paused, its memory is nearly used up", "of 2 GiB", "2", "unknown", "0", "none in use"],
    ]
    assert rows(page, "Jobs in the queue") == [["Running", "0"], ["Queued", "0"]]
    stored = httpx.get(f"{address}/v1/access").json()["bytes_stored"]
    expect(page.locator("#storage")).to_contain_text(f"{float(f'{stored / 1024:.3g}'):g} KiB of 1 GiB used")
    assert [row[:2] for row in rows(page, "Storage by kind")] == [["Scans", "2"]]
    expect(page.locator("#keys")).to_contain_text("No key is needed on this machine")
    # What the workers report later is shown without a reload.
    one["metrics"] = {**metrics, "memory": 2**30}
    expect(page.locator("#workers")).to_contain_text("1 GiB of 2 GiB")


def test_keys_of_the_tenant_alone(page, serve, tmp_path):
    mine, theirs = ApiKey.new(), ApiKey.new()
    (tmp_path / "key").write_text(mine.shown())
    address = serve(first_key_file=tmp_path / "key")
    database = open_database(f"sqlite:///{tmp_path / 'served' / 'bentray.sqlite'}")
    Keys(database).add(theirs, Tenant("other"), "scanner of another", ("read",))
    database.close()
    page.add_init_script(f"sessionStorage.setItem('bentray-key', '{mine.shown()}')")
    page.goto(f"{address}/#/service")
    page.get_by_role("region", name="Keys of the tenant").wait_for()
    ((name, key, scopes, state, created, used, expires),) = rows(page, "Keys of the tenant")
    assert (name, key, scopes, state, expires) == (
        "first (this one)",
        mine.id,
        "read, write, metrics",
        "valid",
        "never",
    )
    assert "never" not in (created, used)
    expect(page.locator("#keys")).to_contain_text("bentray keys create --tenant local")
    shown = page.content()
    assert not [one for one in (mine.shown(), mine.digest(), theirs.id, "scanner of another") if one in shown]
    # A key that ends while the page is open: the page asks for another one.
    database = open_database(f"sqlite:///{tmp_path / 'served' / 'bentray.sqlite'}")
    Keys(database).revoke(mine.id)
    database.close()
    page.get_by_role("link", name="Jobs", exact=True).click()
    page.locator("#key-error").get_by_text("unknown, revoked or expired").wait_for()
    expect(page.get_by_label("API key")).to_be_visible()
