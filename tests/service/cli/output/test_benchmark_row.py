"""A benchmark row: whether a goal is met follows from its figures."""

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


FLAT = {"best constant": 50.0, "water alone": 80.0, "straight rays": 34.0, "default settings": 30.0}


@pytest.mark.parametrize(
    ("error", "met"), [(49.9, True), (50.0, True), (50.1, False), (math.nan, False), (90.0, False)]
)
def test_an_image_worse_than_a_constant_never_meets_its_goal(error: float, met: bool) -> None:
    row = Row("R4", 0.5, 0.9, "<=", "", "how", error=error, baselines=FLAT)
    assert row.met is met
    assert row.loses_to_constant is not met
    assert ("worse than a constant" in row.explained) is not met


def test_the_value_is_the_error_unless_another_is_given() -> None:
    assert Row("R7", 12.0, 12.0, "<=", "m/s", "how", baselines=FLAT).met
    assert not Row("R7", 60.0, 70.0, "<=", "m/s", "how", baselines=FLAT).met


def test_straight_rays_and_default_settings_do_not_decide() -> None:
    assert Row("R10", 40.0, 45.0, "<=", "m/s", "how", baselines=FLAT).met


def test_an_image_that_beats_constants_may_miss_its_goal() -> None:
    row = Row("R7", 13.0, 12.0, "<=", "m/s", "how", baselines=FLAT)
    assert not row.met
    assert not row.loses_to_constant


def test_a_tuned_row_needs_the_default_settings_beside_it() -> None:
    with pytest.raises(InvalidInput, match="'default settings': R1 is tuned"):
        Row("R1", 1.0, 2.0, "<=", "", "how", baselines={"best constant": 3.0}, tuned=True)
    row = Row("R1", 1.0, 2.0, "<=", "", "how", baselines=FLAT, tuned=True)
    assert row.explained.startswith("tuned; how; beside best constant 50")


def test_error_baselines_and_tuned_are_written_for_images() -> None:
    row = Row("R4", 0.5, 0.9, "<=", "", "how", error=17.0, baselines=FLAT).to_dict()
    assert list(row)[-3:] == ["error", "baselines", "tuned"]
    assert (row["error"], row["baselines"], row["tuned"]) == (17.0, FLAT, False)
