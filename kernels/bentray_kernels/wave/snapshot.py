"""What a checkpoint may hold of a refinement, beside what it may hold of the rays before it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from ..tomography import snapshot
from .judging import Judgement, Judging
from .refine import WaveIterate, WavePass
from .standing import BandEnd, Entered, Image, WaveStanding

KINDS = (WaveStanding, BandEnd, Entered, Image, WaveIterate, WavePass, Judging, Judgement)

TYPES: Mapping[str, type] = MappingProxyType({**snapshot.TYPES, **{kind.__name__: kind for kind in KINDS}})
