"""The providers: the calls to each library, imported only if chosen; rejected settings."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import dask
import pytest
import yaml

from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster import providers
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.cluster.dask_settings import ours
from bentray_workers.cluster.providers import PROVIDERS, ClusterRequest, deploy
from bentray_workers.cluster.tls import security_of

DEPLOY = Path(__file__).resolve().parents[3] / "deploy"


class FakeManager:
    """In place of a cluster manager of another library: keeps what it was asked for."""

    made: list[FakeManager]

    def __init__(self, **asked: Any) -> None:
        if "nonsense" in asked:
            raise TypeError("got an unexpected keyword argument 'nonsense'")
        self.asked = asked
        self.settings = dask.config.get("distributed.scheduler.http.routes")
        self.scaled: dict[str, int] = {}
        type(self).made.append(self)

    def scale(self, **to: int) -> None:
        self.scaled = to


@pytest.fixture
def managers(monkeypatch: pytest.MonkeyPatch) -> list[FakeManager]:
    """Calls of the fakes that stand in for dask-jobqueue and dask-kubernetes."""
    FakeManager.made = []
    for module, name in (("dask_jobqueue", "SLURMCluster"), ("dask_kubernetes.operator", "KubeCluster")):
        fake: Any = ModuleType(module)
        setattr(fake, name, FakeManager)
        monkeypatch.setitem(sys.modules, module, fake)
    monkeypatch.setitem(sys.modules, "dask_kubernetes", ModuleType("dask_kubernetes"))
    return FakeManager.made


def test_slurm_workers_have_resources_warm_kernels_and_no_dashboard(managers: list[FakeManager]) -> None:
    deploy("slurm", ClusterRequest(workers=12, template=DEPLOY / "slurm" / "cluster.yaml"))
    (made,) = managers
    assert made.scaled == {"jobs": 12}
    assert [made.asked[name] for name in ("processes", "cores", "job_cpu")] == [1, 3, 2]
    assert {"memory", "walltime", "queue"} <= set(made.asked), "from the template"
    words = made.asked["worker_extra_args"]
    assert {
        "--resources=recon=1,drawing=1,render=1,short=1",
        "--preload=bentray_workers.compilation.preload",
        "--no-dashboard",
    } <= set(words)
    assert made.asked["scheduler_options"]["dashboard_address"] == "127.0.0.1:0"
    assert made.settings == [], "under our settings of Dask"


def test_a_scheduler_that_adds_pages_adds_them_to_its_own_settings_alone() -> None:
    with ours():
        dask.config.get("distributed.scheduler.http.routes").append("a page")
    with ours():
        assert dask.config.get("distributed.scheduler.http.routes") == []


def test_a_site_can_add_a_lane(managers: list[FakeManager], tmp_path: Path) -> None:
    (tmp_path / "site.yaml").write_text("worker_extra_args: ['--resources=recon=1,render=1,opencl=1']\n")
    deploy("slurm", ClusterRequest(template=tmp_path / "site.yaml"))
    assert managers[0].asked["worker_extra_args"][-1] == "--resources=recon=1,render=1,opencl=1"


def test_slurm_takes_certificates(managers: list[FakeManager], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(providers, "security_of", lambda folder: ("security of", folder))
    deploy("slurm", ClusterRequest(tls=Path("certificates")))
    assert managers[0].asked["security"] == ("security of", Path("certificates"))


def test_kubernetes_is_given_the_template_with_the_number_of_workers(managers: list[FakeManager]) -> None:
    deploy("kubernetes", ClusterRequest(workers=7, template=DEPLOY / "kubernetes" / "cluster.yaml"))
    spec = managers[0].asked["custom_cluster_spec"]
    assert spec["kind"] == "DaskCluster"
    assert spec["spec"]["worker"]["replicas"] == 7


def test_the_scheduler_of_the_template_for_kubernetes_is_published_nowhere() -> None:
    spec = yaml.safe_load((DEPLOY / "kubernetes" / "cluster.yaml").read_text())["spec"]
    assert spec["scheduler"]["service"]["type"] == "ClusterIP"
    for part in ("scheduler", "worker"):
        pod = spec[part]["spec"]
        assert pod["securityContext"]["runAsNonRoot"] is True
        for container in pod["containers"]:
            assert container["securityContext"]["readOnlyRootFilesystem"] is True
            assert all("hostPort" not in port for port in container.get("ports", ()))


def test_the_command_of_its_workers_is_one_of_ours() -> None:
    import typer

    from bentray_service.cli import app

    spec = yaml.safe_load((DEPLOY / "kubernetes" / "cluster.yaml").read_text())["spec"]
    program, command, *words = spec["worker"]["spec"]["containers"][0]["args"]
    assert program == "bentray"
    typer.main.get_command(app).commands[command].make_context(command, words)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("kind", "wanted", "field"),
    [
        ("mesos", ClusterRequest(), "cluster"),
        ("embedded", ClusterRequest(template=Path("x.yaml")), "cluster_template"),
        ("embedded", ClusterRequest(workers=0), "workers"),
        ("slurm", ClusterRequest(template=Path("absent.yaml")), "cluster_template"),
        ("kubernetes", ClusterRequest(), "cluster_template"),
        ("kubernetes", ClusterRequest(tls=Path("x")), "tls"),
    ],
)
def test_names_invalid_input(
    managers: list[FakeManager], kind: str, wanted: ClusterRequest, field: str
) -> None:
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        deploy(kind, wanted)


@pytest.mark.parametrize("text", ["- a list", "nonsense: 1", "{"])
def test_a_template_that_the_library_does_not_take_is_rejected(
    managers: list[FakeManager], tmp_path: Path, text: str
) -> None:
    (tmp_path / "site.yaml").write_text(text)
    with pytest.raises(InvalidInput, match="cluster_template"):
        deploy("slurm", ClusterRequest(template=tmp_path / "site.yaml"))


@pytest.mark.parametrize("kind", ["slurm", "kubernetes"])
def test_a_library_that_is_not_installed_is_named_with_its_extra(
    monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    for module in ("dask_jobqueue", "dask_kubernetes", "dask_kubernetes.operator"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InvalidInput, match=rf"pip install 'bentray\[{kind}\]'"):
        open_cluster(kind=kind, template=DEPLOY / kind / "cluster.yaml")


def test_every_kind_that_needs_a_library_has_an_extra() -> None:
    import tomllib

    text = (DEPLOY.parent / "pyproject.toml").read_text()
    extras = tomllib.loads(text)["project"]["optional-dependencies"]
    assert set(PROVIDERS) - {"embedded"} <= set(extras)


def test_closing_stops_started_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[str] = []
    started = SimpleNamespace(close=lambda: ended.append("cluster"))
    client = SimpleNamespace(close=lambda: ended.append("client"), status="running")
    monkeypatch.setattr("bentray_workers.cluster.connection.deploy", lambda kind, wanted: started)
    monkeypatch.setattr("bentray_workers.cluster.connection.Client", lambda *given, **how: client)
    with open_cluster(kind="slurm"):
        assert ended == []
    assert ended == ["client", "cluster"]


def test_certificates_of_an_embedded_cluster_must_be_there(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="without authority"):
        deploy("embedded", ClusterRequest(workers=1, tls=tmp_path))
    assert security_of(None).require_encryption is False


def test_workers_without_shared_memory_are_one_line(monkeypatch):
    def read_only(*_, **__):
        raise OSError(30, "Read-only file system")

    # What a lock is made of.
    monkeypatch.setattr("multiprocessing.synchronize.SemLock.__init__", read_only)
    with pytest.raises(InvalidInput, match="/dev/shm: found Read-only file system; accepted: a writable"):
        deploy("embedded", ClusterRequest(workers=1))
