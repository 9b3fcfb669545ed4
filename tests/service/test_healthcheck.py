"""The health check of a container: silent when ready, otherwise the reason."""

from bentray_service.healthcheck import check


def test_ready_service_passes(serve):
    assert check(serve()) is None


def test_the_reason_is_told(serve, cluster):
    cluster.workers = 0
    assert "workers" in check(serve())


def test_nobody_there():
    assert "no service answers at http://127.0.0.1:9" in check("http://127.0.0.1:9")
