"""What a checkpoint may hold of a refinement, beside what it may hold of the rays before it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from .. import checkpoint
from .band_inversion import WaveIterate, WavePass
from .inversion_state import BandEnd, Entered, Image, RefinementCheckpoint
from .validation import Judgement, ValidationCheckpoint

RECORDS = (
    RefinementCheckpoint,
    BandEnd,
    Entered,
    Image,
    WaveIterate,
    WavePass,
    ValidationCheckpoint,
    Judgement,
)

TYPES: Mapping[str, type] = MappingProxyType(
    {**checkpoint.TYPES, **{record.__name__: record for record in RECORDS}}
)
