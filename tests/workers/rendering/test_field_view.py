"""Views of geometry fields: bounded, each field checked."""

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tracing.lookup_scene import WAYS
from bentray_workers.rendering.field_view import LOOKUPS, FieldView


def test_published_lookups_have_a_largest_number_of_samples():
    FieldView().check_samples(48)
    FieldView(eye="uv-linear").check_samples(24)
    for name in ("lookup", "eye"):
        with pytest.raises(InvalidInput, match="samples"):
            FieldView(**{name: "uv-nearest"}).check_samples(25)
    assert set(LOOKUPS.values()) <= set(WAYS)


@pytest.mark.parametrize(
    ("scene", "places", "accepted"),
    [
        ("object", (0.0, 0.0), "none: this scene has one object"),
        ("two-mirrors", (1.0, 2.0), "none, or 4: x and y of each object"),
        ("mirror-ball", (0.0,) * 4, "none, or 6: x and y of each object"),
        ("two-mirrors", (0.0, 0.0, 0.0, 5.1), "a number from -5 to 5 m"),
        ("two-mirrors", (0.0, 0.0, 0.0, float("nan")), "a number from -5 to 5 m"),
    ],
)
def test_positions_are_those_of_the_objects(scene, places, accepted):
    with pytest.raises(InvalidInput, match="positions_m") as caught:
        FieldView(scene=scene, positions_m=places)
    assert caught.value.accepted == accepted
    view = FieldView(scene="two-mirrors", positions_m=(0.0, 1.0, 2.0, 3.0))
    assert view.plain()["positions_m"] == [0.0, 1.0, 2.0, 3.0]


def test_too_many_rays():
    with pytest.raises(InvalidInput, match="rays"):
        FieldView(width=4096, height=4096, rays=2)
