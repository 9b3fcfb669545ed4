"""Views: every invalid field is named, and valid ones survive JSON."""

import json
import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.rendering.refraction_view import SMOOTHING_8_BIT, RefractionView, check_even


def test_every_field_has_a_description():
    assert [one.name for one in fields(RefractionView) if not one.metadata["description"].endswith(".")] == []


def test_the_default_is_one_surface_of_glass():
    view = RefractionView(smoothing=0.0).within(0.0, 3.0)
    assert (view.layers().isos, view.layers().indices) == ((1.5,), (1.0, 1.5))


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"iso": (2.0, 1.0), "index": (1.1, 1.2)}, "iso"),
        ({"iso": (1.0, 1.0), "index": (1.1, 1.2)}, "iso"),
        ({"iso": (math.nan,)}, "iso"),
        ({"iso": tuple(map(float, range(9))), "index": (1.5,) * 9}, "iso"),
        ({"iso": (1.0, 2.0, 3.0), "index": (1.1, 1.2)}, "index"),
        ({"surroundings": -1}, "surroundings"),
        ({"surroundings": 2}, "surroundings"),
        ({"index": ()}, "index"),
        ({"index": (0.0,)}, "index"),
        ({"index": (math.inf,)}, "index"),
        ({"filter": "trilinear", "smoothing": 1.0}, "smoothing"),
        ({"width": 4096, "height": 4096, "supersampling": "real", "degree": 2}, "width, height, degree"),
    ],
)
def test_rejects_inconsistent_views(given, field):
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        RefractionView(**given)


def test_iso_value_error_names_the_range():
    with pytest.raises(InvalidInput, match="iso: found 7; accepted: 1400 to 1600, the range of the volume"):
        RefractionView(iso=(7.0,)).within(1400.0, 1600.0)


def test_smoothing_leaves_the_iso_value_to_the_range_behind_the_filter():
    view = RefractionView(smoothing=10.0).within(0.0, 255.0)
    assert view.iso == ()
    assert view.filtered_within(-8.0, 100.0).iso == (46.0,)
    with pytest.raises(InvalidInput, match="accepted: -8 to 100, the range of the volume after smoothing"):
        RefractionView(iso=(127.5,), smoothing=10.0).filtered_within(-8.0, 100.0)


def test_the_type_of_the_values_decides_on_smoothing():
    view = RefractionView().within(0.0, 255.0)
    assert view.iso == ()
    assert view.smoothing_for(np.dtype(np.uint8)) == SMOOTHING_8_BIT
    assert view.smoothing_for(np.dtype(np.uint16)) == view.smoothing_for(np.dtype(np.float32)) == 0.0
    assert RefractionView(smoothing=2.0).smoothing_for(np.dtype(np.uint8)) == 2.0
    linear = RefractionView(filter="trilinear")
    assert linear.smoothing_for(np.dtype(np.uint8)) == 0.0
    assert linear.within(0.0, 3.0).iso == (1.5,)


def test_water_may_lie_between_two_surfaces():
    assert RefractionView(iso=(1.0, 2.0), index=(1.3,)).layers().indices == (1.0, 1.3, 1.3)
    layers = RefractionView(iso=(1.0, 2.0), index=(1.0, 0.9), outside=1.2, surroundings=1).layers()
    assert (layers.indices, layers.surroundings) == ((1.2, 1.0, 0.9), 1)


def test_a_volume_of_one_value_has_no_surface():
    with pytest.raises(InvalidInput, match="5 everywhere"):
        RefractionView().within(5.0, 5.0)


@given(
    st.lists(st.floats(-1e6, 1e6), max_size=8, unique=True),
    st.floats(1.0, 2.0),
    st.integers(1, 64),
    st.booleans(),
)
def test_a_view_survives_json(isos, index, width, fresnel):
    count = max(len(isos), 1)
    view = RefractionView(iso=tuple(sorted(isos)), index=(index,) * count, width=width, fresnel=fresnel)
    plain = json.loads(json.dumps(view.plain()))
    again = {name: tuple(value) if isinstance(value, list) else value for name, value in plain.items()}
    assert RefractionView(**again) == view


@pytest.mark.parametrize(
    ("shape", "spacing"), [((8, 8), (1.0, 1.0)), ((8, 8, 1), (1.0,) * 3), ((8, 8, 8), (1.0, 1.0, None))]
)
def test_only_even_volumes_in_space(shape, spacing):
    with pytest.raises(InvalidInput, match="volume"):
        check_even(shape, spacing)
    with pytest.raises(InvalidInput, match="volume"):
        check_even((2, 2, 2), (1.0, math.nan, 1.0))
    check_even((2, 2, 2), (1.0, 2.0, 3.0))
