"""A benchmark row: whether a goal is met follows from its figures."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_service.cli.output.benchmark_row import OPERATORS, Row

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(value=finite, goal=finite)
def test_exactly_the_right_operators_are_met(value: float, goal: float) -> None:
    met = {op for op in OPERATORS if Row("X", value, goal, op, "", "").met}
    if value < goal:
        assert met == {"<", "<="}
    elif value > goal:
        assert met == {">", ">="}
    else:
        assert met == {"<=", ">=", "=="}


@pytest.mark.parametrize("op", list(OPERATORS))
@pytest.mark.parametrize("value", [None, math.nan])
def test_what_was_not_measured_is_never_met(op: str, value: float | None) -> None:
    assert not Row("X", value, 1.0, op, "", "scikit-fmm is not installed").met


def test_a_missing_value_needs_its_reason() -> None:
    with pytest.raises(InvalidInput, match="reason why E1 has no value"):
        Row("E1", None, 2.0, ">=", "", " ")


def test_an_unknown_operator_lists_the_known_ones() -> None:
    with pytest.raises(InvalidInput, match=r"'=>'.*<= < >= > =="):
        Row("E1", 1.0, 2.0, "=>", "", "")


def test_the_keys_are_those_of_the_bench_format_in_order() -> None:
    row = Row("R1", 1.5, 2.0, "<=", "%", "how").to_dict()
    assert json.dumps(row) == (
        '{"target": "R1", "value": 1.5, "goal": 2.0, "op": "<=", "met": true, "unit": "%", "detail": "how"}'
    )
