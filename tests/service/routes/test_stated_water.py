"""The water temperature that a user states for a scan: views and later jobs take it, the file stays."""

import pytest

from bentray_kernels.acquisition import speed_from_temperature

pytestmark = pytest.mark.usefixtures("work")


@pytest.fixture
def here(http, uploaded):
    return f"/v1/datasets/{uploaded(http)}"


def state(http, here, celsius):
    answer = http.patch(here, json={"water_temperature_c": celsius})
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_the_scan_keeps_its_file_and_tells_both(http, here):
    before, file = http.get(here).json(), http.get(f"{here}/file").content
    assert before["water_temperature_c"] is None
    stated = state(http, here, 31.5)
    assert stated == {**before, "water_temperature_c": 31.5}
    geometry = http.get(f"{here}/geometry").json()
    assert geometry["water_speed_mps"] == speed_from_temperature(31.5)
    assert (geometry["water_temperature_c"], geometry["water_assumed"]) == (31.5, False)
    assert "1500.0 m/s" in geometry["water_in_file"]
    assert http.get(f"{here}/file").content == file
    # A name changes nothing else; null takes the statement back.
    assert http.patch(here, json={"title": "Left"}).json()["water_temperature_c"] == 31.5
    http.patch(here, json={"title": ""})
    assert state(http, here, None) == before
    assert http.get(f"{here}/geometry").json()["water_speed_mps"] == 1500.0


def test_later_jobs_take_it_unless_they_state_their_own(http, here, submitted, until, work):
    dataset = here.rpartition("/")[2]
    first = submitted(http, dataset)
    state(http, here, 31.5)
    second, third = submitted(http, dataset), submitted(http, dataset, water_temperature_c=25.0)
    state(http, here, None)
    for job, expected in ((first, None), (second, 31.5), (third, 25.0)):
        ended = until(http, job["id"])
        assert ended["settings"]["water_temperature_c"] == job["settings"]["water_temperature_c"] == expected
    assert sorted(call[1].water_temperature_c or 0.0 for call in work.calls) == [0.0, 25.0, 31.5]


def test_another_water_is_another_picture(http, here):
    before = http.get(f"{here}/quality.png")
    state(http, here, 31.5)
    after = http.get(f"{here}/quality.png", headers={"If-None-Match": before.headers["etag"]})
    assert after.status_code == 200


@pytest.mark.parametrize("wrong", [-0.1, 95.1, "warm", True, "31"])
def test_a_temperature_without_a_speed_is_rejected(http, here, wrong):
    answer = http.patch(here, json={"water_temperature_c": wrong})
    assert (answer.status_code, answer.json()["field"]) == (422, "water_temperature_c")
    assert http.get(here).json()["water_temperature_c"] is None
