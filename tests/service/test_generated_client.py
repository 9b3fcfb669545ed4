"""A client that a public generator makes of openapi.json: it compiles, uploads, and runs a job to its end."""

import compileall
import importlib
import json
import subprocess
import sys
import time
import venv
from io import BytesIO
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOCK = ROOT / "requirements-generator.lock"
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def generated(tmp_path_factory) -> Path:
    """The folder of the package ``bentray_client``; the generator has an environment of its own."""
    folder = tmp_path_factory.mktemp("generator")
    venv.create(folder / "venv")
    python = folder / "venv" / "bin" / "python"
    # Our own pip: to install one there takes longer than what it would install.
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "-qq", "--no-compile"]
    install = [*pip, "--require-hashes", "-r", LOCK]
    installed = subprocess.run(install, capture_output=True, text=True, check=False)
    if installed.returncode:
        pytest.skip(f"the generator cannot be fetched: {installed.stderr[-300:]}")
    config = folder / "config.json"
    config.write_text(json.dumps({"package_name_override": "bentray_client", "post_hooks": []}))
    command = [python, "-m", "openapi_python_client", "generate", "--path", ROOT / "openapi.json"]
    command += ["--output-path", folder / "made", "--config", config]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stdout[-2000:]
    return folder / "made"


@pytest.mark.slow
@pytest.mark.nightly
def test_it_compiles_uploads_and_runs_a_job(generated, serve, work, scan, monkeypatch):
    assert compileall.compile_dir(generated / "bentray_client", quiet=1)
    monkeypatch.syspath_prepend(str(generated))
    client_of = importlib.import_module("bentray_client").Client
    models = importlib.import_module("bentray_client.models")
    types = importlib.import_module("bentray_client.types")

    def ask(name, **what):
        return importlib.import_module(f"bentray_client.api.{name}").sync(**what)

    with client_of(base_url=serve(), raise_on_unexpected_status=True) as client:
        dataset = ask(
            "datasets.upload_dataset_v1_datasets_post",
            client=client,
            body=types.File(payload=BytesIO(scan().read_bytes())),
        )
        assert (dataset.title, dataset.elements) == ("Sixteen elements", 16)
        asked = models.ReconstructionRequest.from_dict(
            {
                "kind": "reconstruction",
                "dataset": dataset.id,
                "settings": {"method": "sart", "nodes": 16, "iterations": 2},
            }
        )
        job = ask("jobs.start_job_v1_jobs_post", client=client, body=asked)
        deadline = time.monotonic() + PATIENCE_S
        while job.state in ("queued", "running") and time.monotonic() < deadline:
            time.sleep(0.05)
            job = ask("jobs.show_job_v1_jobs_job_id_get", client=client, job_id=job.id)
        assert (job.state, len(job.history)) == ("succeeded", 2)
        volume = ask("volumes.show_volume_v1_volumes_volume_id_get", client=client, volume_id=job.volume)
        assert (volume.shape, volume.unit, volume.value_range) == ([16, 16], "m/s", [1500.0, 1540.0])
        refused = ask("jobs.show_job_v1_jobs_job_id_get", client=client, job_id="job-" + "0" * 20)
        assert (refused.status, refused.field) == (404, "job")
    for name in [name for name in sys.modules if name.startswith("bentray_client")]:
        del sys.modules[name]
