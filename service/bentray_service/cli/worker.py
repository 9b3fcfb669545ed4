"""`bentray worker`: run workers for a Dask scheduler."""

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from bentray_kernels.errors import InvalidInput

from .options.paths import output_folder
from .output.terminal import print_lines, remark

Tls = Annotated[
    Path | None,
    typer.Option(
        envvar="BENTRAY_TLS_DIR",
        help="Folder with authority.pem, certificate.pem and key.pem, for a scheduler at tls://…",
    ),
]


def worker(
    scheduler: Annotated[
        str,
        typer.Option(
            envvar="DASK_SCHEDULER_ADDRESS",
            help="Address of the Dask scheduler, e.g. tcp://head:8786 or tls://head:8786.",
        ),
    ],
    workers: Annotated[
        int | None, typer.Option(min=1, show_default="one per core", help="Worker processes.")
    ] = None,
    memory_limit: Annotated[
        str | None,
        typer.Option(
            envvar="BENTRAY_WORKER_MEMORY",
            show_default="equal share of the memory of this machine",
            help="Memory limit per process, e.g. 4GiB; above it a process is restarted; tasks run elsewhere.",
        ),
    ] = None,
    local_directory: Annotated[
        Path | None, typer.Option(show_default="a temporary folder", help="Folder for scratch files.")
    ] = None,
    host: Annotated[
        str | None,
        typer.Option(
            show_default="address of the interface to the scheduler",
            help="Address under which scheduler and workers reach this machine.",
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option(show_default="its address", help="Name of the worker in the cluster.")
    ] = None,
    opencl: Annotated[
        bool,
        typer.Option("--opencl/--no-opencl", help="Test the OpenCL devices and offer the one that passes."),
    ] = True,
    tls: Tls = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print {scheduler, workers, lanes, pid} as one JSON object.")
    ] = False,
) -> None:
    """Join a Dask scheduler as worker until Ctrl-C or SIGTERM; running tasks then move to other workers.

    Each process runs one reconstruction task and one rendering task at a time. The data folder of the service
    must have the same path on this machine. Kernels are compiled before the first task. If the scheduler
    stops, the workers wait for its restart. Anyone who can connect to the scheduler or a worker can run code
    there: use a private network or TLS.

    Example:  bentray worker --scheduler tcp://head:8786 --workers 4 --memory-limit 4GiB
    """
    from dask.utils import parse_bytes

    from bentray_workers.cluster.capacities import device_resources
    from bentray_workers.cluster.local_workers import JoinRequest, join
    from bentray_workers.cluster.resources import OFFERED
    from bentray_workers.cluster.tls import security_of

    if memory_limit is not None:
        try:
            parse_bytes(memory_limit)
        except ValueError as error:
            raise InvalidInput(
                "memory_limit", repr(memory_limit), "a size, e.g. 4GiB; 0: unlimited"
            ) from error
    count = workers if workers is not None else len(os.sched_getaffinity(0))
    request = JoinRequest(
        scheduler=scheduler,
        workers=count,
        resources={**OFFERED, **(device_resources() if opencl and _has_device() else {})},
        memory_limit=memory_limit,
        local_directory=None if local_directory is None else output_folder(local_directory),
        host=host,
        name=name,
        security=security_of(tls),
    )
    if as_json:
        about = {
            "scheduler": scheduler,
            "workers": count,
            "lanes": dict(request.resources),
            "pid": os.getpid(),
        }
        print_lines([json.dumps(about)])
    join(request, remark)


def _has_device() -> bool:
    from bentray_kernels.opencl import select_device

    device = select_device().device
    remark("No OpenCL device passed the tests." if device is None else f"OpenCL device: {device.label}.")
    return device is not None
