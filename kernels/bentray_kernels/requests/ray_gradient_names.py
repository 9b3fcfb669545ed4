"""Names of the gradients of travel times that rays descend; without an import of compiled code."""

from __future__ import annotations

from typing import Literal

# How ∇(T²) is read between the nodes: central differences at them, interpolated multilinearly; or the
# gradient of the cubic B-spline of T², as in chapter 6.3.
RayGradient = Literal["differences", "bspline"]
