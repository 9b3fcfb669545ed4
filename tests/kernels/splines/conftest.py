"""Parameters of the suite that every filter passes."""

import pytest

from .every_filter import EveryFilter


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """``name``: each filter of a class; ``derived``: each whose gradient is the derivative of its values."""
    if metafunc.cls is None or not issubclass(metafunc.cls, EveryFilter):
        return
    for argument, left_out in (("name", ()), ("derived", ("central",))):
        if argument in metafunc.fixturenames:
            metafunc.parametrize(argument, [one for one in metafunc.cls.filters if one not in left_out])
