"""The log: one object a line, with request and job, without keys, passwords or forged lines."""

import json
import logging

import pytest
from distributed import batched

from bentray_service import logs
from bentray_service.logs import JsonFormatter, TextFormatter, about
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys

log = logging.getLogger("bentray.test")


@pytest.fixture
def lines(capsys):
    """What was logged, as objects."""

    def read():
        return [json.loads(line) for line in capsys.readouterr().err.splitlines()]

    with logs.configured("json"):
        yield read


def record(words, *given, **more):
    return logging.LogRecord("bentray.x", logging.WARNING, "x.py", 1, words, given, None, **more)


def test_log_lines_carry_ids(lines):
    with about(request="r1"), about(job="job-1"):
        log.info("in %s", "it")
    log.warning("out")
    inside, outside = lines()
    assert (inside["message"], inside["level"], inside["logger"]) == ("in it", "info", "bentray.test")
    assert (inside["request"], inside["job"]) == ("r1", "job-1")
    assert "request" not in outside


@pytest.mark.parametrize("formatter", [TextFormatter(), JsonFormatter()])
def test_no_secret_in_any_line(formatter):
    token = ApiKey.new()
    secret = token.shown().rpartition("_")[2]
    words = f"{token.shown()} at postgresql+psycopg://bentray:p%40ss@db/x"
    try:
        raise RuntimeError(words)
    except RuntimeError as error:
        shown = formatter.format(
            logging.LogRecord("x", 40, "x", 1, "%s", (words,), (type(error), error, error.__traceback__))
        )
    assert secret not in shown
    assert "p%40ss" not in shown
    assert token.id in shown
    assert "db/x" in shown


def test_log_injection_is_escaped():
    shown = TextFormatter().format(record("GET %s", "/x\nWARNING all is well\x1b[2K"))
    assert len(shown.splitlines()) == 1
    assert "\x1b" not in shown
    assert len(JsonFormatter().format(record("GET %s", "/x\n{}")).splitlines()) == 1


def test_afterwards_all_is_as_before():
    def states():
        loggers = [logging.getLogger(name) for name in (None, "bentray", "distributed", logs.CLOSED)]
        return [(logger.handlers[:], logger.propagate, logger.level) for logger in loggers]

    before = states()
    with logs.configured("json"):
        assert states() != before
        assert logging.getLogger(logs.CLOSED).level == logging.WARNING
    assert states() == before


def test_text_has_warnings_of_dask_only(capsys):
    with logs.configured("text"):
        logging.getLogger("distributed.scheduler").info("Register worker")
        logging.getLogger("distributed.scheduler").warning("Worker lost")
    assert capsys.readouterr().err.splitlines() == ["Worker lost"]


@pytest.mark.parametrize("form", ["text", "json"])
def test_connections_that_close_at_a_stop_show_no_traceback(form, capsys):
    with logs.configured(form):
        try:
            raise ConnectionError("closed")
        except ConnectionError:
            logging.getLogger(batched.__name__).info("Batched Comm Closed %r", "tcp://...", exc_info=True)
        logging.getLogger(batched.__name__).error("Error in batched write")
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert "Error in batched write" in said


def test_logs_contain_ids_and_no_keys(start, uploaded, submitted, until, work, lines):
    http, token = start(), ApiKey.new()
    Keys(http.app.state.stores.database).add(token, Tenant("local"), "one", ("read", "write"))
    http.app.state.access.sign_in._no_keys_until = 0.0
    http.headers["Authorization"] = f"Bearer {token.shown()}"
    dataset = uploaded(http)
    work.error = RuntimeError("a fault")
    job = submitted(http, dataset)
    until(http, job["id"], "failed")
    http.get(f"/v1/datasets/{token.shown()}?key={token.shown()}")
    http.get("/v1/datasets", headers={"X-Request-ID": "bad\tid", "Authorization": "Bearer " + "bentray_x"})
    told = lines()
    assert token.shown().rpartition("_")[2] not in json.dumps(told)
    started = next(one for one in told if one["message"].startswith(f"{job['id']} queued"))
    answered = next(one for one in told if one.get("route") == "/v1/jobs" and one["method"] == "POST")
    assert started["request"] == answered["request"]
    assert (started["job"], answered["status"], answered["who"]) == (job["id"], 202, token.id)
    failed = next(one for one in told if "a fault" in one.get("error", ""))
    assert failed["job"] == job["id"]
    assert all("\t" not in one.get("request", "") for one in told)


def test_client_errors_are_logged_once_a_minute(capsys):
    now = [0.0]
    seldom = logs.RateLimitFilter(lambda: now[0])

    def passes(words, *given, name="asyncio", level=logging.WARNING):
        record = logging.LogRecord(name, level, __file__, 1, words, given, None)
        return record.getMessage() if seldom.filter(record) else None

    assert passes("connection %d was lost", 1) == "connection 1 was lost"
    assert [passes("connection %d was lost", k) for k in range(1000)] == 1000 * [None]
    assert passes("something else") == "something else"
    now[0] = 61.0
    assert passes("connection %d was lost", 2) == "connection 2 was lost (suppressed 1000 times)"
    assert passes("connection %d was lost", 3) is None
    # What is not said any more is not kept either.
    now[0] = 500.0
    assert passes("a third") == "a third"
    assert len(seldom._known) == 1


def test_only_in_the_service_and_only_of_those(capsys):
    with logs.configured("text"):
        for _ in range(3):
            logging.getLogger("uvicorn.error").warning("too many")
            logging.getLogger("bentray.jobs").warning("a job")
    written = capsys.readouterr().err
    assert (written.count("too many"), written.count("a job")) == (1, 3)
    assert not logging.getLogger("uvicorn.error").filters
