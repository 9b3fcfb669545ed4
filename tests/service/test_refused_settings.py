"""Each setting of a job or picture is refused outside its range, its choices and its use: by its place."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from itertools import product
from typing import Any, get_args, get_type_hints

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import Range, ranges_of
from bentray_kernels.requests.request_fields import FACTS, Uses, check_used, choices_of, declared
from bentray_kernels.tomography.settings import Settings
from bentray_service.jobs.kinds import KINDS
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.rendering.turntable import Turntable
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.volume import VolumeSimulationSettings
from bentray_workers.simulation.waves import WaveSimulationSettings

REQUESTS: tuple[type, ...] = (Settings, PhantomScan, RefractionView, Turntable, FieldView, FieldSettings)
SIMULATIONS: tuple[type, ...] = (SimulationSettings, VolumeSimulationSettings, WaveSimulationSettings)


def records(kind: type, path: str = "") -> Iterator[tuple[str, type]]:
    """A record and those in it, each with the beginning of the places of its fields."""
    yield path, kind
    for field in fields(kind):
        if is_dataclass(field.default):
            yield from records(type(field.default), f"{path}{field.name}.")


def with_value(record: Any, path: str, value: Any) -> Any:
    """The record with another value of one field; not all records inside may be made by themselves."""
    name, _, rest = path.partition(".")
    return replace(record, **{name: with_value(getattr(record, name), rest, value) if rest else value})


def beyond(within: Range) -> Iterator[float]:
    """Numbers outside a range, and one that is none."""
    yield from (within.least - 1, within.most + 1, float("nan"))
    yield from (end for end, out in ((within.least, within.above), (within.most, within.below)) if out)


@pytest.mark.parametrize("kind", [*REQUESTS, *SIMULATIONS])
def test_values_out_of_range_and_words_that_are_no_choice(kind: type) -> None:
    for place, record in records(kind):
        # The words of a simulation are chosen by its request.
        choices = {} if kind in SIMULATIONS else choices_of(record)
        cases = [
            (name, value, within.words)
            for name, within in ranges_of(record).items()
            for value in beyond(within)
        ]
        cases += [(name, "magic", word) for name, words in choices.items() for word in words]
        for name, value, accepted in cases:
            with pytest.raises(InvalidInput) as refused:
                with_value(kind(), place + name, value)
            assert refused.value.field.rpartition(".")[2] == name
            assert accepted in refused.value.accepted or "unless" in refused.value.accepted


def requests_of(kind: type, path: str) -> list[Any]:
    """Values of a field that ask for something."""
    setting = {item.place: item for item in declared(kind).values()}[path]
    (record,) = (record for outer, record in records(kind) if path.rpartition(".")[0] == outer.rstrip("."))
    name = path.rpartition(".")[2]
    if isinstance(setting.default, bool) or get_type_hints(record)[name] == bool | None:
        result: tuple[Any, ...] = (not setting.default,)
    elif name in choices_of(record):
        result = choices_of(record)[name]
    else:
        within = ranges_of(record).get(name)
        result = () if within is None else (within.least + min(1, (within.most - within.least) / 2),)
    return [value for value in result if value not in (setting.default, *setting.neutral)]


def states_without(kind: type, uses: Uses) -> Iterator[Any]:
    """Records in each state of the fields on which the use of another depends, in which it has none."""
    known = declared(kind)
    names = sorted({name for use in uses for name in use} - set(FACTS))
    for state in product(*([known[name].default, *requests_of(kind, known[name].place)] for name in names)):
        values = dict(zip(names, state, strict=True))
        # What a scan may have is not known before it is read.
        if any(all(name in FACTS or holds(values[name], use[name]) for name in use) for use in uses):
            continue
        # Not all values go together themselves.
        with suppress(InvalidInput):
            record = kind()
            for name, value in values.items():
                record = with_value(record, known[name].place, value)
            yield check_used(record)


def holds(value: Any, accepted: tuple[Any, ...] | Range) -> bool:
    if isinstance(accepted, Range):
        return value is not None and accepted.holds(value)
    return value in accepted


@pytest.mark.parametrize("kind", REQUESTS)
def test_what_has_no_effect_is_refused(kind: type) -> None:
    """In every state of the other fields in which a field is not used, as its declaration says."""
    conditional = [setting for setting in declared(kind).values() if all(setting.uses)]
    for setting in conditional:
        states = list(states_without(kind, setting.uses))
        assert states or all(name in FACTS for use in setting.uses for name in use), setting.place
        for record, value in product(states, requests_of(kind, setting.place)):
            with pytest.raises(InvalidInput, match="unless") as refused:
                check_used(with_value(record, setting.place, value))
            assert refused.value.field == setting.place
    assert conditional or kind is FieldSettings


@pytest.mark.parametrize("kind", KINDS)
def test_jobs_name_the_place_of_what_they_refuse(start, kind) -> None:
    http, tried = start(), 0
    for place, record in records(KINDS[kind].settings._type):
        hints = get_type_hints(record)
        for name in (*(field.name for field in fields(record)), "colour"):
            wrong: Any = {"no": "value"}
            if name in choices_of(record):
                wrong = "magic"
            elif name in ranges_of(record) or bool in (hints.get(name), *get_args(hints.get(name))):
                wrong = "many"
            told: Any = {name: wrong}
            for outer in reversed(place.split(".")[:-1]):
                told = {outer: told}
            answer = http.post("/v1/plans", json={"kind": kind, "settings": told})
            named = {error["field"]: error for error in answer.json()["errors"]}
            result = [field for field in named if field.startswith(f"settings.{place}{name}")]
            assert (answer.status_code, len(result) > 0) == (422, True), (place, name, answer.text)
            assert all(named[field]["accepted"] for field in result)
            tried += 1
    assert tried > 5
