"""The start page: upload a scan, error messages, and the list of scans."""

import pytest
from playwright.sync_api import expect
from scipy.io import savemat

from ...workers.foreign_scans.scans import delta_tof, positions

pytestmark = pytest.mark.browser


def test_an_empty_list_says_so(page, serve):
    page.goto(serve())
    page.get_by_text("No scan uploaded yet").wait_for()
    page.get_by_text("ready, 1 worker").wait_for()


def test_an_uploaded_scan_is_opened_and_listed(page, serve, scan):
    page.goto(serve())
    page.set_input_files("#scan-file", scan())
    page.get_by_role("heading", name="Sixteen elements").wait_for()
    page.get_by_role("link", name="Scans", exact=True).click()
    page.get_by_role("link", name="Sixteen elements").click()
    page.get_by_text("16 emitters").wait_for()


def test_errors_are_shown_as_text(page, serve, tmp_path):
    (tmp_path / "notes.h5").write_text("only text")
    page.goto(serve())
    page.set_input_files("#scan-file", tmp_path / "notes.h5")
    alert = page.locator("#scan-error")
    alert.wait_for()
    assert "HDF5" in alert.inner_text()


def test_own_variables_are_named_in_a_form_that_opens_when_a_file_is_rejected(page, serve, tmp_path):
    savemat(tmp_path / "scan.mat", {"pos": 1e3 * positions(), "dtof": 1e6 * delta_tof()})
    page.goto(serve())
    page.set_input_files("#scan-file", tmp_path / "scan.mat")
    page.locator("#scan-error").wait_for()
    assert "--map element_position=NAME" in page.locator("#scan-error").inner_text()
    assert page.locator("#scan-own").get_attribute("open") is not None
    page.get_by_label("Variables, FIELD=NAME").fill("element_position=pos, delta_tof=dtof")
    page.get_by_label("Lengths").select_option("mm")
    page.get_by_label("Times").select_option("us")
    page.get_by_label("Water, °C").fill("24")
    page.get_by_role("button", name="Send the file again").click()
    expect(page.locator("#dataset-facts")).to_contain_text("water 1494")
