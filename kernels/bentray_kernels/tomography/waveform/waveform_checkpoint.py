"""What a checkpoint may hold of a refinement, beside what it may hold of the rays before it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from .. import checkpoint
from .band_inversion import WaveIterate, WavePass
from .inversion_state import BandEnd, Entered, Image, WaveStanding
from .validation import Judgement, Judging

KINDS = (WaveStanding, BandEnd, Entered, Image, WaveIterate, WavePass, Judging, Judgement)

TYPES: Mapping[str, type] = MappingProxyType({**checkpoint.TYPES, **{kind.__name__: kind for kind in KINDS}})
