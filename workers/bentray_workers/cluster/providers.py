"""Who starts a scheduler and its workers: this process, Slurm, or the Dask operator of Kubernetes."""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import yaml
from distributed import LocalCluster

from bentray_kernels.errors import InvalidInput

from .dask_settings import NO_DASHBOARD, ours
from .resources import OFFERED, THREADS
from .supervision import SupervisedCluster
from .tls import own_security, security_of

PRELOAD = "bentray_workers.compilation.warmup"


@dataclass(frozen=True)
class Wanted:
    """What a provider is asked for.

    Attributes:
        workers: worker processes; None: as many as the provider thinks right.
        local_directory: where workers keep scratch files; None: where Dask puts them.
        template: a YAML file with what differs from site to site; None where there is nothing to say.
        tls: the folder of the certificates, as ``security_of`` takes it; None for none.
        processes: False keeps embedded workers in this process (for tests).
    """

    workers: int | None = None
    local_directory: Path | None = None
    template: Path | None = None
    tls: Path | None = None
    processes: bool = True


class Deployed(Protocol):
    """A scheduler with workers, as every cluster manager of Dask gives it; a ``Client`` takes it."""

    def close(self) -> Any:
        """End the workers and the scheduler."""


class Provider(Protocol):
    """Starts a scheduler and workers that offer our lanes and are warm; raises ``InvalidInput``."""

    def __call__(self, wanted: Wanted) -> Deployed: ...


def embedded(wanted: Wanted) -> Deployed:
    """Processes of this machine; without a number one a core.

    Other users of the machine can reach their ports, so what comes there must prove itself: by the given
    certificates, else by a key that only this process and its workers know.
    """
    count = wanted.workers if wanted.workers is not None else len(os.sched_getaffinity(0))
    if wanted.template is not None:
        raise InvalidInput("cluster_template", wanted.template, "none with an embedded cluster")
    secured = wanted.tls is not None or wanted.processes
    security = own_security() if wanted.tls is None else security_of(wanted.tls)
    local: Deployed = (SupervisedCluster if wanted.processes else LocalCluster)(
        n_workers=count,
        threads_per_worker=THREADS,
        processes=wanted.processes,
        resources=OFFERED,
        dashboard_address=NO_DASHBOARD,
        scheduler_kwargs={"dashboard": False},
        preload=PRELOAD,
        # Workers in this process have no ports.
        security=security if secured else None,
        local_directory=None if wanted.local_directory is None else str(wanted.local_directory),
    )
    return local


def slurm(wanted: Wanted) -> Deployed:
    """Jobs of Slurm, one worker a job; the scheduler is in this process.

    The template holds arguments of ``dask_jobqueue.SLURMCluster``, see ``deploy/slurm/``.
    """
    asked = {"cores": THREADS, "processes": 1, **_template(wanted)}
    own = [f"--resources={_words(OFFERED)}", f"--preload={PRELOAD}", f"--dashboard-address={NO_DASHBOARD}"]
    # The template's come last, so that a site with OpenCL devices can say which lanes it has.
    asked["worker_extra_args"] = [*own, "--no-dashboard", *asked.get("worker_extra_args", ())]
    if wanted.tls is not None:
        asked["security"] = security_of(wanted.tls)
    options = {"dashboard_address": NO_DASHBOARD, "dashboard": False, **asked.pop("scheduler_options", {})}
    cluster = _made(
        _library("dask_jobqueue", "slurm").SLURMCluster, wanted, **asked, scheduler_options=options
    )
    scalable: Any = cluster
    scalable.scale(jobs=wanted.workers or 1)
    return cluster


def kubernetes(wanted: Wanted) -> Deployed:
    """Pods that the Dask operator keeps: the template is a ``DaskCluster``, see ``deploy/kubernetes/``."""
    if wanted.tls is not None:
        raise InvalidInput(
            "tls", wanted.tls, "none with kubernetes; mount the folder in the template instead"
        )
    if wanted.template is None:
        raise InvalidInput("cluster_template", None, "a file that describes a DaskCluster")
    spec = _template(wanted)
    if wanted.workers is not None:
        spec["spec"]["worker"]["replicas"] = wanted.workers
    manager = _library("dask_kubernetes.operator", "kubernetes").KubeCluster
    return _made(manager, wanted, custom_cluster_spec=spec)


PROVIDERS: Mapping[str, Provider] = MappingProxyType(
    {"embedded": embedded, "slurm": slurm, "kubernetes": kubernetes}
)


def deploy(kind: str, wanted: Wanted) -> Deployed:
    """Start a scheduler and workers under our settings of Dask.

    Raises:
        InvalidInput: for an unknown kind, a library that is not installed, or what the provider refuses.
    """
    if kind not in PROVIDERS:
        raise InvalidInput("cluster", repr(kind), "one of " + ", ".join(PROVIDERS))
    if wanted.workers is not None and wanted.workers < 1:
        raise InvalidInput("workers", wanted.workers, "at least 1")
    with ours():
        return PROVIDERS[kind](wanted)


def _template(wanted: Wanted) -> dict[str, Any]:
    if wanted.template is None:
        return {}
    try:
        found = yaml.safe_load(wanted.template.read_text())
    except (OSError, ValueError, yaml.YAMLError) as error:
        reason = str(error).splitlines()[0]
        raise InvalidInput("cluster_template", f"{wanted.template} ({reason})", "a YAML file") from error
    if not isinstance(found, dict):
        raise InvalidInput("cluster_template", f"{wanted.template} ({found!r})", "a YAML mapping")
    return found


def _library(name: str, extra: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        accepted = f"a cluster whose library is installed: pip install 'bentray[{extra}]'"
        raise InvalidInput("cluster", f"{extra} ({error})", accepted) from error


def _made(manager: Any, wanted: Wanted, **asked: Any) -> Deployed:
    try:
        made: Deployed = manager(**asked)
        return made
    except (TypeError, ValueError, KeyError) as error:
        reason = f"{wanted.template} ({error})"
        raise InvalidInput("cluster_template", reason, f"arguments that {manager.__name__} takes") from error


def _words(lanes: Mapping[str, float]) -> str:
    """As ``dask worker --resources`` takes them, without a blank that a job script would have to quote."""
    return ",".join(f"{lane}={amount}" for lane, amount in lanes.items())
