"""Names of the Eikonal solvers of reconstructions; without an import of their compiled code."""

from __future__ import annotations

from typing import Literal

# ``deviation`` solves for the difference from straight rays; the others are those of ``eikonal.registry``.
SolverName = Literal[
    "deviation",
    "fmm",
    "fmm-first-order",
    "fmm-untidy",
    "hafmm",
    "fsm",
    "fsm-simultaneous",
    "fim",
    "fim-opencl",
    "accurate",
]
