"""State of SART in blocks, whose images are in files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .sart_step import State


@dataclass(frozen=True)
class BlockCheckpoint:
    """See ``task_graph.Checkpoint``.

    Attributes:
        state: of SART, with empty images: those are in files.
        updates: made so far; the number of the files.
        blocks: number of blocks.
        nodes: along x.
        spacing: of the nodes, m.
        origin: position of node 0, m.
    """

    state: State
    updates: int
    blocks: int
    nodes: int
    spacing: float
    origin: tuple[float, ...]

    @property
    def milestone(self) -> tuple[Any, ...]:
        # Each update: its files replace those of the update before the last.
        return (self.updates,)
