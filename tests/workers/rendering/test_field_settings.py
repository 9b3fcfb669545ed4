"""Settings of geometry fields: ranges, and their part in the field's name."""

from dataclasses import replace

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.rendering.field_settings import MAX_FACES, FieldSettings, check_faces

OTHER = {"samples": 12, "inner_samples": 8, "divisions": 4, "image_size": 129, "image_threshold": 1e-3}


def test_every_setting_and_the_mesh_name_the_field():
    plain = FieldSettings()
    assert set(OTHER) == set(plain.plain())
    names = {replace(plain, **{name: value}).content("a") for name, value in OTHER.items()}
    names |= {plain.content("a"), plain.content("b")}
    assert len(names) == len(OTHER) + 2
    assert FieldSettings().content("a") == plain.content("a")


def test_a_mesh_that_is_too_large():
    check_faces(MAX_FACES)
    with pytest.raises(InvalidInput, match="mesh"):
        check_faces(MAX_FACES + 1)
