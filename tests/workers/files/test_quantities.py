"""The quantities of a reconstruction: every list of them knows each."""

import re
from dataclasses import fields
from pathlib import Path
from typing import get_args

import pytest

from bentray_kernels.tomography import Reconstruction
from bentray_service.interactive.result import Result
from bentray_workers.files.quantities import QUANTITIES, QuantityName
from bentray_workers.images.report import COLORMAPS

PAGE = Path(__file__).resolve().parents[3] / "service" / "bentray_service" / "web" / "static"


def test_names_are_those_of_requests_and_results() -> None:
    assert get_args(QuantityName) == tuple(QUANTITIES)
    assert set(QUANTITIES) <= {field.name for field in fields(Reconstruction)}
    assert set(QUANTITIES) <= set(dir(Result))


@pytest.mark.parametrize("name", QUANTITIES)
def test_each_has_colours_and_is_on_the_page(name: str) -> None:
    assert name == "speed" or name in COLORMAPS
    for script in ("viewer/quantities.js", "parts/export_menu.js"):
        assert re.search(rf"\b{name}: ", (PAGE / script).read_text()), script
