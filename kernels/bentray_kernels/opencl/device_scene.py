"""A scene in the memory of a device, and compiled code in its place where the self-test fails."""

import warnings
from collections.abc import Callable
from typing import Any, ClassVar, Self

import numpy as np

from ..arrays import Flags
from ..errors import InvalidInput
from .device_selection import OpenCLFallbackWarning, session_or_warning
from .session import Session

# Precisions of places and directions on a device, by the names of the types there.
REALS = {"float64": "double", "float32": "float"}


class DeviceScene:
    """A scene on a device.

    Args:
        session: the device.
        precision: "float64" or "float32"; None for the best one of the device.

    Attributes:
        instead: the function that takes over.
        work: what the device does, for messages.

    Raises:
        InvalidInput: for another precision.
    """

    instead: ClassVar[str]
    work: ClassVar[str]

    def __init__(self, session: Session, precision: str | None) -> None:
        if precision is None:
            precision = "float64" if "cl_khr_fp64" in session.handle.extensions else "float32"
        if precision not in REALS:
            raise InvalidInput("precision", precision, "one of " + ", ".join(REALS))
        self.session, self.precision = session, precision
        self._real: Any = np.dtype(precision)
        self._faults: dict[str, str] = {}

    @classmethod
    def on_the_device(cls, scene: Any, precision: str | None = None) -> Self | None:
        """The scene on the chosen OpenCL device; None where no device passes its self-test.

        Args:
            scene: to render.
            precision: as above.

        Raises:
            InvalidInput: for another precision, or where ``BENTRAY_OPENCL_DEVICE`` does not match one device.

        Warns:
            OpenCLFallbackWarning: once, where no device passes its self-test; and without enough memory.
        """
        session = session_or_warning(cls.instead)
        if session is None:
            return None
        # Imported here, so that pyopencl is loaded only with a device.
        import pyopencl as cl

        try:
            return cls(scene, session, precision)  # type: ignore[call-arg, arg-type]
        except cl.Error as error:
            message = f"{session.handle.name} cannot hold the scene, {cls.instead} takes over: {error}"
            warnings.warn(OpenCLFallbackWarning(message), stacklevel=2)
            return None

    @property
    def fault(self) -> str:
        """Why ``instead`` takes over; empty if it does not."""
        return next(filter(None, self._faults.values()), "")

    def _passes(self, test: Callable[[], str], way: str = "") -> bool:
        """Whether the device passes a test, which is made once; a warning where it does not.

        Args:
            test: the fault as a message; empty if correct.
            way: what is tested, where there are several tests.
        """
        if way not in self._faults:
            self._faults[way] = fault = test()
            if fault:
                what = f"{self.work} wrong" + (f" ({way.lower()})" if way else "")
                message = f"{self.session.handle.name} {what}, {self.instead} takes over: {fault}"
                warnings.warn(OpenCLFallbackWarning(message), stacklevel=3)
        return not self._faults[way]


def fault_in(compare: Callable[[], Flags], allowed: float, what: str) -> str:
    """Why a device is not used, as a message; empty if few results differ.

    Args:
        compare: which results differ from those of compiled code.
        allowed: fraction that may.
        what: the results, for the message.
    """
    import pyopencl as cl

    try:
        off = float(compare().mean())
    except cl.Error as error:
        return f"it ends with {str(error).splitlines()[0]}"
    return "" if off <= allowed else f"{off:.0%} of its {what} are off, {allowed:.0%} may be"
