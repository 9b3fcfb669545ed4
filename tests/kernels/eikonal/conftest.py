"""Fixtures of the suites over all Eikonal methods: the methods by name, in 2-D and 3-D."""

import pytest

from bentray_kernels import eikonal


def marked(name):
    return pytest.param(name, marks=pytest.mark.opencl if eikonal.METHODS[name].on_device else ())


@pytest.fixture(params=map(marked, eikonal.methods()), scope="session")
def method(request):
    return request.param


@pytest.fixture(params=[2, 3], ids=["2d", "3d"], scope="session")
def ndim(request):
    return request.param
