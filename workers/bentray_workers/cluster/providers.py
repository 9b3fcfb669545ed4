"""Providers of clusters: this process, Slurm, or the Dask operator of Kubernetes."""

import importlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import yaml
from dask.system import CPU_COUNT
from distributed import LocalCluster
from distributed.system import MEMORY_LIMIT

from bentray_kernels.errors import InvalidInput

from .dask_settings import NO_DASHBOARD, ours
from .resources import CORES, OFFERED, THREADS
from .supervision import SupervisedCluster
from .tls import own_security, security_of

PRELOAD = "bentray_workers.compilation.preload"


@dataclass(frozen=True)
class ClusterRequest:
    """A request for a cluster.

    Attributes:
        workers: worker processes; None: the default of the provider.
        local_directory: for scratch files of workers; None: the default of Dask.
        template: a YAML file with the settings of a site; None: no such settings.
        tls: the folder of the certificates, see ``security_of``; None: no TLS.
        processes: False keeps embedded workers in this process (for tests).
    """

    workers: int | None = None
    local_directory: Path | None = None
    template: Path | None = None
    tls: Path | None = None
    processes: bool = True


class DeployedCluster(Protocol):
    """A scheduler with workers: a cluster manager of Dask, accepted by ``Client``."""

    def close(self) -> Any:
        """Stop the workers and the scheduler."""


class Provider(Protocol):
    """Starts a scheduler and warm workers with our resources; raises ``InvalidInput``."""

    def __call__(self, request: ClusterRequest) -> DeployedCluster: ...


def embedded(request: ClusterRequest) -> DeployedCluster:
    """Processes of this machine, by default one per core.

    Other users of the machine can reach their ports, so connections are authenticated: by the given
    certificates, else by a key that only this process and its workers hold.
    """
    count = request.workers if request.workers is not None else len(os.sched_getaffinity(0))
    if request.template is not None:
        raise InvalidInput("cluster_template", request.template, "none with an embedded cluster")
    if request.processes:
        _check_semaphores()
    secured = request.tls is not None or request.processes
    security = own_security() if request.tls is None else security_of(request.tls)
    local: DeployedCluster = (SupervisedCluster if request.processes else LocalCluster)(
        n_workers=count,
        threads_per_worker=THREADS,
        # As Dask divides it, by cores instead of threads.
        memory_limit=int(MEMORY_LIMIT * min(1.0, CORES / CPU_COUNT)),
        processes=request.processes,
        resources=OFFERED,
        dashboard_address=NO_DASHBOARD,
        scheduler_kwargs={"dashboard": False},
        preload=PRELOAD,
        # Workers in this process have no ports.
        security=security if secured else None,
        local_directory=None if request.local_directory is None else str(request.local_directory),
    )
    return local


def _check_semaphores() -> None:
    """Check that processes of this machine can share semaphores.

    Raises:
        InvalidInput: naming the folder of shared memory.
    """
    try:
        get_context("spawn").Lock()
    except OSError as error:
        accepted = "a writable folder, as a tmpfs of a read-only container"
        raise InvalidInput("/dev/shm", error.strerror or error, accepted) from error  # noqa: S108


def slurm(request: ClusterRequest) -> DeployedCluster:
    """Jobs of Slurm, one worker each; the scheduler is in this process.

    The template holds arguments of ``dask_jobqueue.SLURMCluster``, see ``deploy/slurm/``.
    """
    arguments = {"cores": THREADS, "job_cpu": CORES, "processes": 1, **_template(request)}
    own = [f"--resources={_argument(OFFERED)}", f"--preload={PRELOAD}", f"--dashboard-address={NO_DASHBOARD}"]
    # Arguments of the template come last, so that a site with OpenCL devices can set its resources.
    arguments["worker_extra_args"] = [*own, "--no-dashboard", *arguments.get("worker_extra_args", ())]
    if request.tls is not None:
        arguments["security"] = security_of(request.tls)
    options = {
        "dashboard_address": NO_DASHBOARD,
        "dashboard": False,
        **arguments.pop("scheduler_options", {}),
    }
    cluster = _start(
        _library("dask_jobqueue", "slurm").SLURMCluster, request, **arguments, scheduler_options=options
    )
    scalable: Any = cluster
    scalable.scale(jobs=request.workers or 1)
    return cluster


def kubernetes(request: ClusterRequest) -> DeployedCluster:
    """Pods of the Dask operator: the template is a ``DaskCluster``, see ``deploy/kubernetes/``."""
    if request.tls is not None:
        raise InvalidInput(
            "tls", request.tls, "none with kubernetes; mount the folder in the template instead"
        )
    if request.template is None:
        raise InvalidInput("cluster_template", None, "a file that describes a DaskCluster")
    spec = _template(request)
    if request.workers is not None:
        spec["spec"]["worker"]["replicas"] = request.workers
    manager = _library("dask_kubernetes.operator", "kubernetes").KubeCluster
    return _start(manager, request, custom_cluster_spec=spec)


PROVIDERS: Mapping[str, Provider] = MappingProxyType(
    {"embedded": embedded, "slurm": slurm, "kubernetes": kubernetes}
)


def deploy(kind: str, request: ClusterRequest) -> DeployedCluster:
    """Start a scheduler and workers under our settings of Dask.

    Raises:
        InvalidInput: for an unknown kind, a library that is not installed, or an error of the provider.
    """
    if kind not in PROVIDERS:
        raise InvalidInput("cluster", repr(kind), "one of " + ", ".join(PROVIDERS))
    if request.workers is not None and request.workers < 1:
        raise InvalidInput("workers", request.workers, "at least 1")
    with ours():
        return PROVIDERS[kind](request)


def _template(request: ClusterRequest) -> dict[str, Any]:
    if request.template is None:
        return {}
    try:
        template = yaml.safe_load(request.template.read_text())
    except (OSError, ValueError, yaml.YAMLError) as error:
        reason = str(error).splitlines()[0]
        raise InvalidInput("cluster_template", f"{request.template} ({reason})", "a YAML file") from error
    if not isinstance(template, dict):
        raise InvalidInput("cluster_template", f"{request.template} ({template!r})", "a YAML mapping")
    return template


def _library(name: str, extra: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        accepted = f"a cluster whose library is installed: pip install 'bentray[{extra}]'"
        raise InvalidInput("cluster", f"{extra} ({error})", accepted) from error


def _start(manager: Any, request: ClusterRequest, **arguments: Any) -> DeployedCluster:
    try:
        cluster: DeployedCluster = manager(**arguments)
        return cluster
    except (TypeError, ValueError, KeyError) as error:
        reason = f"{request.template} ({error})"
        raise InvalidInput("cluster_template", reason, f"arguments that {manager.__name__} takes") from error


def _argument(resources: Mapping[str, float]) -> str:
    """For ``dask worker --resources``, without blanks, which a job script would have to quote."""
    return ",".join(f"{name}={amount}" for name, amount in resources.items())
