"""Search of jobs by text, in every kind of database."""

import pytest

from bentray_service.rows.ids import LOCAL, Tenant, new_id
from bentray_service.rows.jobs import NewJob, Submission
from bentray_service.rows.stored_tables import Datasets
from bentray_service.rows.tables import DatasetRow

from .conftest import SUMMARY

OTHER = Tenant("other")


@pytest.fixture
def titled(database, jobs):
    """Make a scan with this title and a job of it; returns the id of the job."""

    def make(tenant, title, name="", started_by=""):
        summary = {**SUMMARY, "title": title}
        row = Datasets(database).add(tenant, new_id("dataset"), size=1, sha256="0" * 64, summary=summary)
        job = jobs.add(tenant, NewJob("reconstruction", {}, row.id), Submission(started_by=started_by))
        jobs.describe(tenant, job.id, name=name)
        return job.id

    return make


def found(jobs, tenant, text):
    return [job.id for job in jobs.search(tenant, 10, text=text)]


def test_names_titles_and_owners_of_one_tenant(jobs, titled):
    mine = titled(LOCAL, "Left Breast", started_by="alice")
    theirs = titled(OTHER, "Left Breast", name="alice")
    for words in ("left", "BREAST", "t B", "alice"):
        assert found(jobs, LOCAL, words) == [mine], words
        assert found(jobs, OTHER, words) == [theirs], words
    assert found(jobs, LOCAL, theirs) == []


def test_no_character_is_a_pattern(jobs, titled):
    percent, underscore, stroke = (titled(LOCAL, title) for title in ("100 %", "a_b", "c\\d"))
    assert found(jobs, LOCAL, "%") == [percent]
    assert found(jobs, LOCAL, "_") == [underscore]
    assert found(jobs, LOCAL, "\\") == [stroke]
    assert found(jobs, LOCAL, "a%b") == found(jobs, LOCAL, "c_d") == found(jobs, LOCAL, "'") == []


def test_a_simulation_by_the_title_of_the_scan_that_it_made(database, jobs, queue):
    jobs.add(LOCAL, NewJob("simulation", {}))
    job = queue.claim()
    result = {
        **SUMMARY,
        "title": "Phantom of Table 7",
        "id": new_id("dataset"),
        "bytes": 1,
        "sha256": "0" * 64,
    }
    assert queue.succeed(job.id, result, into=DatasetRow)
    assert found(jobs, LOCAL, "table 7") == [job.id]
    assert found(jobs, LOCAL, "table 8") == []
