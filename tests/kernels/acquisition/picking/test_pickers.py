"""The registry of pickers: names, codes, and that the settings offer all of them."""

from typing import get_args, get_type_hints

import pytest

from bentray_kernels.acquisition import PICKERS
from bentray_kernels.acquisition.picking.pickers import picker_named
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.settings import PickingSettings


def test_every_picker_has_a_name_a_code_of_its_own_and_a_line_of_help():
    assert [p.code for p in PICKERS.values()] == list(range(len(PICKERS)))
    assert all(name == p.name and p.summary for name, p in PICKERS.items())


def test_the_settings_offer_them_all():
    assert get_args(get_type_hints(PickingSettings)["picker"]) == tuple(PICKERS)


def test_an_unknown_one_is_rejected_with_the_names_known():
    with pytest.raises(InvalidInput, match="aic, threshold, energy-ratio"):
        picker_named("eye")
