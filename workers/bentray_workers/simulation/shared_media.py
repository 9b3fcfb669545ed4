"""Media of simulations, which the threads of a process share: each is made once, and delays no other."""

from collections.abc import Callable, Hashable
from functools import lru_cache, wraps
from threading import Lock
from typing import Generic, ParamSpec, TypeVar

Given = ParamSpec("Given")
Made = TypeVar("Made")


def made_once(most: int) -> Callable[[Callable[Given, Made]], Callable[Given, Made]]:
    """Keep the last ``most`` results of a function; a thread that needs one in the making waits for it.

    ``lru_cache`` would make it in each of these threads, and one lock for all would let a small medium wait
    for a large one.
    """

    def decorate(make: Callable[Given, Made]) -> Callable[Given, Made]:
        finding = Lock()

        @lru_cache(most)
        def slot(*_given: Hashable) -> _Slot[Made]:
            return _Slot()

        @wraps(make)
        def get(*given: Given.args, **named: Given.kwargs) -> Made:
            with finding:
                medium = slot(*given)
            with medium.making:
                if not medium.value:
                    medium.value = (make(*given, **named),)
                return medium.value[0]

        return get

    return decorate


class _Slot(Generic[Made]):
    def __init__(self) -> None:
        self.making = Lock()
        self.value: tuple[Made, ...] = ()
