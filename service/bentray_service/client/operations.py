"""The operations of both clients, each by one flow."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Coroutine
from functools import update_wrapper
from types import MethodType
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, TypeVar, overload

from . import flows, lists, waiting
from .connection import Connection
from .steps import Flow

P = ParamSpec("P")
T = TypeVar("T")


class _Blocking(Protocol):
    def _run(self, flow: Flow[T]) -> T: ...


class _Awaiting(Protocol):
    async def _run(self, flow: Flow[T]) -> T: ...


class _Operation(Generic[P, T]):
    """A method of both clients: of one it returns the value, of the other a coroutine of it."""

    def __init__(self, flow: Callable[Concatenate[Connection, P], Flow[T]]) -> None:
        def blocking(client: Any, /, *args: P.args, **kwargs: P.kwargs) -> T:
            return client._run(flow(client, *args, **kwargs))  # type: ignore[no-any-return]

        async def awaiting(client: Any, /, *args: P.args, **kwargs: P.kwargs) -> T:
            return await client._run(flow(client, *args, **kwargs))  # type: ignore[no-any-return]

        self._methods: tuple[Any, Any] = blocking, awaiting
        for method in self._methods:
            _document(method, flow)

    @overload
    def __get__(self, client: _Blocking, kind: Any = None) -> Callable[P, T]: ...
    @overload
    def __get__(self, client: _Awaiting, kind: Any = None) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, client: Any, kind: Any = None) -> Any:
        method = self._methods[inspect.iscoroutinefunction(kind._run)]
        return method if client is None else MethodType(method, client)


def _document(method: Callable[..., Any], flow: Callable[..., Any]) -> None:
    """Copy name, docstring and signature from a flow to a method, with its result as return type."""
    update_wrapper(method, flow)
    signature = inspect.signature(flow)
    first, *others = signature.parameters.values()
    result = str(signature.return_annotation).removeprefix("Flow[").removesuffix("]")
    kind = others[0].kind if others else first.kind
    parameters = [first.replace(name="self", annotation=first.empty, kind=kind), *others]
    documented = signature.replace(parameters=parameters, return_annotation=result)
    method.__signature__ = documented  # type: ignore[attr-defined]


class Operations(Connection):
    """Operations of both clients; ``_run`` executes the flow of an operation."""

    upload = _Operation(flows.upload)
    correct_dataset = _Operation(flows.correct_dataset)
    submit = _Operation(flows.submit)
    simulate = _Operation(flows.simulate)
    reconstruct = _Operation(flows.reconstruct)
    wait = _Operation(waiting.wait)
    cancel = _Operation(flows.cancel)
    submit_batch = _Operation(flows.submit_batch)
    wait_batch = _Operation(waiting.wait_batch)
    cancel_batch = _Operation(flows.cancel_batch)
    batch = _Operation(lists.batch)
    batches = _Operation(lists.batches)
    result = _Operation(flows.result)
    download = _Operation(flows.download)
    download_dataset = _Operation(flows.download_dataset)
    delete = _Operation(flows.delete)
    create_project = _Operation(lists.create_project)
    set_member = _Operation(lists.set_member)
    delete_project = _Operation(lists.delete_project)
    project = _Operation(lists.project)
    projects = _Operation(lists.projects)
    datasets = _Operation(lists.datasets)
    jobs = _Operation(lists.jobs)
    volumes = _Operation(lists.volumes)
    meshes = _Operation(lists.meshes)
    dataset = _Operation(lists.dataset)
    job = _Operation(lists.job)
    volume = _Operation(lists.volume)
    quality = _Operation(lists.quality)
    quality_png = _Operation(lists.quality_png)
    slice_png = _Operation(lists.slice_png)
    refraction_png = _Operation(lists.refraction_png)
