"""Compilation of kernels is noticed while it lasts, also of kernels that others call."""

from numba import njit
from numba.core import event

from bentray_workers.compilation import cache_misses


class Witness(event.Listener):
    """Listener that a function calls whenever a compilation starts or has ended."""

    def __init__(self, ask):
        self._ask, self.at_starts, self.at_ends = ask, [], []

    def on_start(self, event):
        self.at_starts.append(self._ask())

    def on_end(self, event):
        self.at_ends.append(self._ask())


def test_compiling_from_the_first_start_to_the_last_end():
    compiling = cache_misses.announce()
    assert not compiling()

    @njit
    def inner(x):
        return x + 1

    @njit
    def outer(x):
        return 2 * inner(x)

    with event.install_listener(cache_misses.KIND, Witness(compiling)) as witness:
        assert outer(3) == 8
    assert witness.at_starts == [True, True]
    # The kernel that is called ends first, while the other is still being compiled.
    assert witness.at_ends == [True, False]
    assert not compiling()
    assert cache_misses.announce() is compiling
