"""Model of the image of an unfinished reconstruction."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field


class PreviewRecord(BaseModel):
    """The sound speed that a running reconstruction has reached, of its last checkpoint."""

    shape: Annotated[list[int], Field(min_length=2, max_length=2)] = Field(
        description="Nodes in x and y, at most 256 each."
    )
    every: int = Field(description="Each of this many nodes of the grid along a side is in the image.")
    speed: str = Field(description="Base64 of float32, little endian, (x, y) in C order, m/s.")
    range_mps: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        description="Minimum and maximum, m/s."
    )
    spacing_m: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        description="Spacing of the nodes of the image in x and y, m."
    )
    origin_m: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        description="Position (x, y) of the first node, m."
    )
    reconstruction: int = Field(
        description="Number of the reconstruction, from 1; auto tries several methods, one after another."
    )
    part: int = Field(description="Number of the slice, or of the method that auto tries, from 1.")
    parts: int = Field(description="How many of them there are.")
    stage: int = Field(description="Stage, or frequency band of full-waveform inversion, from 1.")
    iteration: int = Field(description="Finished iterations in this stage.")
