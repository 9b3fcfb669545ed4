"""Waiting for jobs: by events, and by polling without them."""

import json

import pytest

from bentray_service.client.connection import Connection, EventStep, PauseStep, RequestStep
from bentray_service.client.errors import ClientError, NoAnswer
from bentray_service.client.waiting import STREAMS, wait
from bentray_service.routes.models.job_records import JobRecord

JOB = {
    **dict.fromkeys(JobRecord.model_fields),
    **dict.fromkeys(("name", "title", "notes", "started_by"), ""),
    "id": "job-1",
    "kind": "reconstruction",
    "settings": {},
    "doubtful": False,
    "progress": {"done": 0, "total": 0, "phase": ""},
    "history": [],
    "created": 0.0,
    "links": {},
}


class Answer:
    def __init__(self, **record):
        self.content = json.dumps({**JOB, "state": "running", **record})


def walk(answers, timeout_s=None):
    """The kinds of steps of a flow that gets these answers, and its value."""
    flow, steps, answer = (
        wait(Connection("http://127.0.0.1", poll_s=0.01), "job-1", None, timeout_s),
        [],
        None,
    )
    answers = iter(answers)
    try:
        while True:
            step = flow.throw(answer) if isinstance(answer, Exception) else flow.send(answer)
            steps.append(type(step))
            answer = None if isinstance(step, PauseStep) else next(answers)
    except StopIteration as end:
        return steps, end.value


def test_event_triggers_a_poll():
    steps, job = walk(
        [
            Answer(),
            "event: progress",
            "data: {}",
            Answer(),
            ": still here",
            "",
            "data: {}",
            Answer(state="succeeded"),
        ]
    )
    assert steps == [
        RequestStep,
        EventStep,
        EventStep,
        RequestStep,
        EventStep,
        EventStep,
        EventStep,
        RequestStep,
    ]
    assert job.state == "succeeded"


def test_end_of_stream_triggers_a_poll():
    steps, _ = walk([Answer(), None, Answer(state="succeeded")])
    assert steps == [RequestStep, EventStep, RequestStep]


def test_polls_periodically_without_events():
    broken = [Answer(), NoAnswer("gone")] * STREAMS
    steps, _ = walk([*broken, Answer(), Answer(), Answer(state="succeeded")])
    assert steps == [RequestStep, EventStep, PauseStep] * STREAMS + [
        RequestStep,
        PauseStep,
        RequestStep,
        PauseStep,
        RequestStep,
    ]


def test_lost_service_is_reported():
    with pytest.raises(NoAnswer):
        walk([Answer(), NoAnswer("gone"), NoAnswer("gone for good")])


def test_ends():
    problem = {"type": "/problems/x", "status": 422, "title": "No", "detail": "nothing there", "field": "x"}
    with pytest.raises(ClientError, match="nothing there") as failed:
        walk([Answer(state="failed", error=problem)])
    assert failed.value.field == "x"
    with pytest.raises(ClientError, match="cancelled"):
        walk([Answer(state="cancelled")])
    with pytest.raises(ClientError, match="still running"):
        walk([Answer()], timeout_s=-1.0)
