"""Records in checkpoints of a full-waveform refinement, beside those of the reconstruction by rays."""

from collections.abc import Mapping
from types import MappingProxyType

from .. import checkpoint
from .band_inversion import Evaluation, InversionState
from .inversion_state import ActiveBand, BandEnd, Curvature, Image, RefinementCheckpoint
from .validation import Validation, ValidationCheckpoint

RECORDS = (
    RefinementCheckpoint,
    BandEnd,
    ActiveBand,
    Curvature,
    Image,
    InversionState,
    Evaluation,
    ValidationCheckpoint,
    Validation,
)

TYPES: Mapping[str, type] = MappingProxyType(
    {**checkpoint.TYPES, **{record.__name__: record for record in RECORDS}}
)
