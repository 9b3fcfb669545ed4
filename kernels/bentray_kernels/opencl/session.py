"""An open OpenCL device: its context, its queue and the programs built for it."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Floats
from .devices import Device, handle_of
from .program import Program

# Vector widths of doubles that the self-test tries.
WIDTHS = (1, 2, 4, 8, 16)


class Session:
    """A device in use. Hold ``lock`` while setting arguments and launching: kernels store them.

    Attributes:
        device: its description.
        lock: for one task at a time.
        handle: the ``pyopencl.Device``.
        queue: in-order command queue.
        lost: why it cannot be used any more; empty while it can.
    """

    def __init__(self, device: Device) -> None:
        # Imported here, so that pyopencl is loaded only with a device.
        import pyopencl as cl

        self._cl: Any = cl
        self.device = device
        self.lost = ""
        self.lock = threading.RLock()
        self.handle = handle_of(device)
        self.context = cl.Context([self.handle])
        self.queue = cl.CommandQueue(self.context)
        self._kernels: dict[tuple[Program, str], DeviceKernel] = {}
        self._programs: dict[Program, Any] = {}

    def kernel(self, program: Program, name: str) -> DeviceKernel:
        """A kernel of a program, which is built on first use."""
        key = (program, name)
        if key not in self._kernels:
            self._kernels[key] = self.own_kernel(program, name)
        return self._kernels[key]

    def own_kernel(self, program: Program, name: str) -> DeviceKernel:
        """Like ``kernel``, but a new one of the caller's own, whose arguments nobody else sets."""
        if program not in self._programs:
            with warnings.catch_warnings():
                # Compiler remarks about programs that pass the self-test.
                warnings.simplefilter("ignore", self._cl.CompilerWarning)
                # Drivers cache programs themselves; pyopencl's own cache warns under load.
                self._programs[program] = self._cl.Program(self.context, program.text).build(
                    [f"-D{define}" for define in program.defines], cache_dir=False
                )
        return DeviceKernel(self._cl.Kernel(self._programs[program], name), program.positions(name))

    def upload(self, array: Any) -> Any:
        """A buffer on the device with a copy of a C-ordered array."""
        flags = self._cl.mem_flags.READ_WRITE | self._cl.mem_flags.COPY_HOST_PTR
        return self._cl.Buffer(self.context, flags, hostbuf=array)

    def reserve(self, size_bytes: int) -> Any:
        """A buffer on the device, its content undefined."""
        return self._cl.Buffer(self.context, self._cl.mem_flags.READ_WRITE, size_bytes)

    def zeros(self, count: int, dtype: Any) -> Any:
        """A buffer on the device with ``count`` zeros of a type."""
        zero = np.zeros(1, dtype)
        buffer = self.reserve(count * zero.itemsize)
        self._cl.enqueue_fill_buffer(self.queue, buffer, zero, 0, count * zero.itemsize)
        return buffer

    def copied(self, buffer: Any) -> Any:
        """A copy of a buffer on the device."""
        copy = self.reserve(buffer.size)
        self._cl.enqueue_copy(self.queue, copy, buffer, byte_count=buffer.size)
        return copy

    def mark(self) -> Any:
        """The event that all launched kernels have finished; the device begins with them."""
        marker = self._cl.enqueue_marker(self.queue)
        self.queue.flush()
        return marker

    def download(self, array: Any, buffer: Any, offset_bytes: int = 0) -> None:
        """Fill ``array`` from a buffer after all launched kernels have finished."""
        self._cl.enqueue_copy(self.queue, array, buffer, src_offset=offset_bytes, is_blocking=True)

    def launch(self, kernel: DeviceKernel, size: tuple[int, ...], group: tuple[int, ...] | None) -> None:
        """Enqueue a kernel whose arguments are set."""
        self._cl.enqueue_nd_range_kernel(self.queue, kernel.handle, size, group)

    def doubles_at_once(self) -> int:
        """How many doubles a pair of buffers may hold together without filling the device."""
        return int(min(self.handle.max_mem_alloc_size, self.handle.global_mem_size // 4)) // 8


class DeviceKernel(NamedTuple):
    """A kernel of a program on a device. It does not keep the buffers alive that are its arguments.

    Attributes:
        handle: the ``pyopencl.Kernel``.
        positions: of its arguments, by name.
    """

    handle: Any
    positions: dict[str, int]

    def set(self, **arguments: Any) -> DeviceKernel:
        """Set buffers and numpy scalars, without the launcher that pyopencl generates and caches.

        Raises:
            KeyError: for a name that the kernel's signature lacks.
        """
        for name, argument in arguments.items():
            position = self.positions[name]
            self.handle.set_arg(position, argument)
        return self

    def set_from(self, arguments: Mapping[str, Any]) -> DeviceKernel:
        """Set those of the engine's arguments that this kernel has."""
        return self.set(**{name: arguments[name] for name in self.positions if name in arguments})


def _probing(width: int) -> Program:
    real = "double" if width == 1 else f"double{width}"
    return Program(("probe",), (f"REAL={real}",))


def probe(session: Session, width: int, a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """sqrt(a) and fmin(a, b) as the device computes them in vectors of ``width`` doubles.

    Args:
        a, b: (n,), n a multiple of ``width``.
    """
    kernel = session.kernel(_probing(width), "probe")
    root, lower = np.empty_like(a), np.empty_like(a)
    with session.lock:
        buffers = [session.upload(array) for array in (a, b, root, lower)]
        kernel.set(**dict(zip(("a", "b", "root", "lower"), buffers, strict=True)))
        session.launch(kernel, (a.size // width,), None)
        session.download(root, buffers[2])
        session.download(lower, buffers[3])
    return root, lower
