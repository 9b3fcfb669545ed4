"""Parameters of the suite that every filter passes."""

import pytest

from .every_filter import EveryFilter


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize a class by its filters.

    ``name``: each filter; ``derived``: each whose gradient is the derivative of its values; ``order``: of
    each B-spline; ``scipy_order``: of each that SciPy has too, 1 for trilinear.
    """
    if metafunc.cls is None or not issubclass(metafunc.cls, EveryFilter):
        return
    filters = metafunc.cls.filters
    orders = [order for order in range(2, 7) if f"bspline{order}" in filters]
    values: dict[str, list[str] | list[int]] = {
        "name": list(filters),
        "derived": [name for name in filters if name != "central"],
        "order": orders,
        "scipy_order": [*(1 for name in filters if name == "trilinear"), *(n for n in orders if n < 6)],
    }
    for argument, given in values.items():
        if argument in metafunc.fixturenames:
            metafunc.parametrize(argument, given)
