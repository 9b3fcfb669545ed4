"""What groups use: members of projects, a batch of scans, and attempts to call the webhook of a job."""

from contextlib import closing

import httpx
import pytest
from playwright.sync_api import expect

from bentray_service.rows.database import open_database
from bentray_service.rows.deliveries import WebhookSecrets
from bentray_service.rows.ids import LOCAL

from .conftest import serious
from .live_results import uploaded

pytestmark = pytest.mark.browser

# Nobody listens there.
WEBHOOK = "http://127.0.0.1:9/ended"


@pytest.fixture(scope="module")
def address(shared_service):
    database = f"sqlite:///{shared_service.folder / 'data' / 'bentray.sqlite'}"
    with closing(open_database(database)) as opened:
        WebhookSecrets(opened).create(LOCAL)
    for name in ("Left", "Right", "Other"):
        file = shared_service.scan(lambda file, name=name: file.attrs.modify("title", name))
        uploaded(shared_service.address, file)
    return shared_service.address


def members(address):
    (project,) = httpx.get(f"{address}/v1/projects").json()["projects"]
    found = httpx.get(f"{address}{project['links']['self']}").json()["members"]
    return project["name"], {one["member"]: one["role"] for one in found}


@pytest.mark.nightly
def test_members_are_listed_added_and_removed_by_keyboard(page, address):
    page.goto(f"{address}/#/service")
    page.get_by_label("New project").fill("Trial 7")
    page.keyboard.press("Enter")
    project = page.locator("details.project")
    new = project.get_by_label("New member")
    new.fill("alice")
    page.keyboard.press("Enter")
    # The browser asks for user: or key: before anything is sent.
    assert new.evaluate("field => field.validity.patternMismatch")
    new.fill("user:alice")
    project.get_by_label("Role", exact=True).select_option("owner")
    page.keyboard.press("Enter")
    role = project.get_by_label("Role of user:alice")
    expect(role).to_have_value("owner")
    expect(new).to_be_focused()
    new.fill("key:0123456789ab")
    page.keyboard.press("Enter")
    expect(project.get_by_label("Role of key:0123456789ab")).to_have_value("reader")
    assert serious(page) == {}
    # The last owner keeps the role, and the refusal says why.
    role.select_option("reader")
    project.get_by_text("make another member owner first").wait_for()
    expect(role).to_have_value("owner")
    other = project.get_by_label("Role of key:0123456789ab")
    # The browser shows the choice before the service knows it.
    with page.expect_response(lambda answer: answer.request.method == "PUT"):
        other.press("ArrowDown")
    expect(project.locator(".error")).to_be_hidden()
    expect(other).to_have_value("contributor")
    expect(other).to_be_focused()
    assert members(address) == ("Trial 7", {"user:alice": "owner", "key:0123456789ab": "contributor"})
    page.on("dialog", lambda dialog: dialog.accept())
    project.get_by_role("button", name="Remove key:0123456789ab").press("Enter")
    expect(project.locator("tbody tr")).to_have_count(1)
    project.get_by_label("Name of the project").fill("Trial 8")
    page.keyboard.press("Enter")
    expect(project.locator("summary")).to_contain_text("Trial 8")
    assert members(address) == ("Trial 8", {"user:alice": "owner"})
    project.get_by_role("button", name="Delete Trial 8").click()
    page.get_by_text("No project yet").wait_for()
    assert httpx.get(f"{address}/v1/projects").json() == {"projects": []}


def test_chosen_scans_are_one_batch_with_one_progress(page, address):
    page.goto(f"{address}/#/")
    page.get_by_role("link", name="Reconstruct several scans").click()
    start = page.locator("#batch-start")
    expect(start).to_be_disabled()
    page.get_by_label("Right").check()
    page.get_by_label("Show scans with").fill("left")
    expect(page.locator("#choices li:visible")).to_have_count(1)
    page.get_by_role("button", name="Choose all shown").click()
    page.get_by_text("2 of 3 scans chosen").wait_for()
    page.get_by_label("Name of the batch").fill("Ward 3")
    page.get_by_text("All settings").click()
    nodes = page.locator("[name=nodes]")
    nodes.fill("1")
    assert serious(page) == {}
    start.click()
    # Refused at its field, which has the focus; nothing was started.
    page.get_by_text("Found 1; accepted").wait_for()
    expect(nodes).to_be_focused()
    assert httpx.get(f"{address}/v1/batches").json() == {"batches": []}
    nodes.fill("16")
    start.click()
    page.get_by_role("heading", name="Ward 3").wait_for()
    (batch,) = httpx.get(f"{address}/v1/batches").json()["batches"]
    assert page.url.endswith(f"#/jobs?batch={batch['id']}")
    titles = {one["id"]: one["title"] for one in httpx.get(f"{address}/v1/datasets").json()["datasets"]}
    assert sorted(titles[one["dataset"]] for one in batch["jobs"]) == ["Left", "Right"]
    assert batch["settings"]["nodes"] == 16
    page.get_by_text("100 % · 2 succeeded").wait_for()


@pytest.mark.nightly
def test_attempts_to_call_a_webhook(page, address):
    dataset = httpx.get(f"{address}/v1/datasets").json()["datasets"][0]["id"]
    order = {"kind": "reconstruction", "dataset": dataset, "settings": {"method": "sart", "nodes": 16}}
    job = httpx.post(f"{address}/v1/jobs", json={**order, "webhook": WEBHOOK}).json()
    page.goto(f"{address}/#/jobs/{job['id']}")
    panel = page.get_by_role("region", name="Webhook")
    attempt = panel.locator("tbody tr").first
    expect(attempt).to_contain_text("no answer: Connection refused")
    expect(panel).to_contain_text(WEBHOOK)
    expect(panel).to_contain_text("Next attempt")
    expect(panel.locator(".state")).to_have_text("waiting")
    # A job without one has no such panel.
    job = httpx.post(f"{address}/v1/jobs", json=order).json()
    page.goto(f"{address}/#/jobs/{job['id']}")
    page.locator("#result-tables").get_by_text("Provenance").wait_for()
    expect(page.get_by_role("heading", name="Webhook")).to_have_count(0)
