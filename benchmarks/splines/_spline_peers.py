"""Adapters of other cubic B-spline packages; packages that are not installed are omitted."""

from collections.abc import Callable

import numpy as np
from scipy.interpolate import NdBSpline
from scipy.ndimage import map_coordinates

from ..shared._available import available

# Coefficients (n, n, n) and points (m, 3), nodes, to a call without arguments that reads them.
Reader = Callable[[np.ndarray, np.ndarray], Callable[[], object]]


def drjit(module) -> Reader:
    """``Texture3f.eval_cubic_grad``, LLVM back end, one thread: values and gradients in single precision.

    Raises:
        ImportError: when it finds no LLVM library (``DRJIT_LIBLLVM_PATH`` names one).
    """
    from drjit import llvm

    module.set_thread_count(0)
    try:
        module.eval(llvm.Float(0.0))
    except RuntimeError as error:
        raise ImportError(str(error).splitlines()[0]) from error

    def reader(coefficients: np.ndarray, points: np.ndarray) -> Callable[[], object]:
        n = len(coefficients)
        texture = llvm.Texture3f(llvm.TensorXf(coefficients[..., np.newaxis].astype(np.float32)))
        # Its places are those of the nodes in a unit cube whose cells are centred on them, last axis first.
        positions = llvm.Array3f(*[llvm.Float((points[:, k] + 0.5) / n) for k in (2, 1, 0)])
        module.eval(positions)
        module.sync_thread()

        def read() -> tuple[np.ndarray, np.ndarray]:
            (value,), (gradient,) = texture.eval_cubic_grad(positions)
            module.eval(value, gradient)
            module.sync_thread()
            return value, gradient

        return read

    return reader


def ndimage(coefficients: np.ndarray, points: np.ndarray) -> Callable[[], object]:
    """``scipy.ndimage.map_coordinates``: values alone."""
    return lambda: map_coordinates(coefficients, points.T, order=3, mode="mirror", prefilter=False)


def nd_bspline(coefficients: np.ndarray, points: np.ndarray) -> Callable[[], object]:
    """``scipy.interpolate.NdBSpline``: values, and the gradient in three calls more."""
    bordered = np.pad(coefficients, 1, mode="reflect")
    knots = tuple(np.arange(n + 4) - 3.0 for n in bordered.shape)
    spline = NdBSpline(knots, bordered, 3)
    orders = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    return lambda: [spline(points, nu=nu) for nu in orders]


def installed() -> tuple[dict[str, Reader], dict[str, str]]:
    """The readers that can be used here, and why the others cannot."""
    peers, missing = available({"Dr.Jit": ("drjit", drjit)})
    return {**peers, "ndimage": ndimage, "NdBSpline": nd_bspline}, missing
