"""Shared fixtures: test order, hypothesis profiles, drawn figures, an OpenCL device, PostgreSQL."""

import gc
import os
import secrets
from collections import defaultdict
from collections.abc import Generator, Iterator
from functools import partial
from pathlib import Path
from typing import IO

import httpx
import pytest
from hypothesis import HealthCheck, settings
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from bentray_kernels.opencl import VARIABLE, Session, select_device

from . import opencl, postgresql
from . import small_disk as small

# `push`, which `make test` and CI use, tries the same examples every time: a change is not judged by luck.
# `nightly`, of `make test-all`, searches at random and prints what repeats a failure (@reproduce_failure).
settings.register_profile("push", max_examples=20, derandomize=True, database=None, deadline=None)
settings.register_profile(
    "nightly", deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "push"))

# Requests of tests that state no time limit: the 5 s of httpx are short on a machine under load.
for _method in ("get", "head", "post", "put", "patch", "delete", "stream"):
    setattr(httpx, _method, partial(getattr(httpx, _method), timeout=60.0))

TESTS = Path(__file__).parent

# Seconds of a test on an idle core: one marked slow, and the mean of the others.
SLOW_S, USUAL_S = 10.0, 0.13
# Files that take far longer than their number of tests suggests, s of an idle machine; they begin first, each
# in one process. One that is missing here may begin last, and its process then works alone.
LONG_S = {
    "service/test_schema.py": 15.0,
    "service/web/test_scan_page.py": 30.0,
    "faults/test_kills.py": 60.0,
    "service/web/test_every_page.py": 15.0,
    "deploy/test_installation.py": 40.0,
    "workers/cluster/test_pipelines.py": 25.0,
    "service/web/test_rendering_page.py": 25.0,
    "service/web/test_ray_caster.py": 20.0,
    "service/web/test_story.py": 30.0,
    "service/ingest/test_hostile_files.py": 40.0,
    "service/web/test_result_page.py": 25.0,
    "workers/reconstruction/test_waveform.py": 20.0,
    "service/web/test_jobs_page.py": 20.0,
    "workers/reconstruction/test_water_temperature.py": 9.0,
    "kernels/refraction/test_caster_opencl.py": 17.0,
    "service/cli/test_reconstruct.py": 9.0,
    "workers/images/test_report.py": 15.0,
    "faults/test_uploads.py": 14.0,
    "service/routes/test_slow_clients.py": 12.0,
    "service/web/test_live_page.py": 12.0,
    "service/web/test_start_page.py": 12.0,
    "service/web/test_shell.py": 12.0,
    "workers/cluster/test_connection.py": 11.0,
    "service/web/test_surfaces_page.py": 10.0,
    "kernels/acquisition/quality/test_faults.py": 10.0,
    "workers/reconstruction/test_reconstruction_run.py": 10.0,
    "service/routes/test_events.py": 9.0,
    "service/web/test_job_table.py": 9.0,
    "workers/cluster/test_local_workers.py": 9.0,
    "kernels/acquisition/reference/test_reference_shot.py": 8.0,
    "service/rows/test_database_away.py": 8.0,
    "workers/rendering/test_geometry_field.py": 8.0,
    "service/web/test_service_page.py": 7.0,
    "service/routes/test_unavailable.py": 7.0,
    "kernels/tomography/waveform/test_refinement.py": 7.0,
    "service/access/test_every_route.py": 6.0,
    "service/client/test_uploading.py": 6.0,
    "kernels/tomography/test_attenuation.py": 6.0,
    "service/test_extremes.py": 6.0,
    "workers/cluster/test_supervision.py": 6.0,
    "kernels/isosurface/test_crossing.py": 6.0,
    "service/routes/test_scan_views.py": 5.0,
}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Where files are shared out over processes the long ones come first, so that all end together."""
    if not hasattr(config, "workerinput"):
        return
    seconds: dict[Path, float] = defaultdict(float)
    for item in items:
        seconds[item.path] += SLOW_S if item.get_closest_marker("slow") else USUAL_S
    for path in seconds:
        seconds[path] = LONG_S.get(path.relative_to(TESTS).as_posix(), seconds[path])
    items.sort(key=lambda item: -seconds[item.path])


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Modules and tests stay until the end, so no search for garbage includes them: a fifth of this time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()
        # Applications of FastAPI are many objects that live for one test: a sixth of the time of those tests.
        gc.set_threshold(20_000)


class Drawn(list[Figure]):
    """Figures in the order in which they became files."""

    def words(self) -> list[str]:
        """Every text that can be seen in the last one."""
        return [text.get_text() for text in self[-1].findobj(Text) if text.get_visible() and text.get_text()]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """Collects each figure that is saved."""
    figures = Drawn()
    save = Figure.savefig

    def keep(figure: Figure, *words: object, **how: object) -> None:
        figures.append(figure)
        save(figure, *words, **how)

    monkeypatch.setattr(Figure, "savefig", keep)
    return figures


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """Collects each figure in place of drawing it, which takes most of the time of a picture."""
    figures = Drawn()

    def keep(figure: Figure, file: IO[bytes], **_how: object) -> None:
        figures.append(figure)
        Image.new("RGB", (1, 1)).save(file, "PNG")

    monkeypatch.setattr(Figure, "savefig", keep)
    return figures


@pytest.fixture(scope="session")
def opencl_session() -> Session:
    """The device that passes its trial on this machine, open. Skips with the reason where none does."""
    if opencl.refusal():
        pytest.skip(opencl.refusal())
    device = select_device().device
    assert device is not None
    return Session(device)


@pytest.fixture(autouse=True)
def _device_for_marked_tests(request: pytest.FixtureRequest) -> Iterator[None]:
    """A test marked ``opencl`` needs the device, whether it asks for the session or not.

    Pictures and jobs of other tests do not depend on what is faster on this machine; kernels choose by name.
    """
    marked = request.node.get_closest_marker("opencl") is not None
    if marked:
        request.getfixturevalue("opencl_session")
    before = os.environ.get(VARIABLE)
    if not marked and request.path.relative_to(TESTS).parts[0] != "kernels":
        os.environ[VARIABLE] = "cpu"
    yield
    if before is None:
        os.environ.pop(VARIABLE, None)
    else:
        os.environ[VARIABLE] = before


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 16 MiB. Skips where this machine does not let a test have one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    with small.mounted(folder):
        yield folder


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[postgresql.Server]:
    """One server for all tests; each makes databases of its own. Skips where PostgreSQL is not installed."""
    if postgresql.programs() is None:
        pytest.skip(postgresql.SKIPPED)
    server = postgresql.Server("bentray", secrets.token_hex(8), "postgres")
    yield server
    server.close()
