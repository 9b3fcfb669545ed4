"""Times that belong to other elements than the scan says: the scan is refused, another order proposed."""

from dataclasses import replace

from ...arrays import Floats
from ..arrangement import find_mismatch
from ..dataset import Dataset
from .finding import Finding

ORDER = "order of the elements"


def find_wrong_order(dataset: Dataset, arrival_s: Floats | None = None) -> list[Finding]:
    """Compare arrivals with the positions, before anything is estimated from them.

    Args:
        dataset: of one slice.
        arrival_s: (ntx, nrx), such as the maxima of pulses, s; None: the travel times of the slice.
    """
    if arrival_s is not None:
        dataset = replace(dataset, tof_s=arrival_s, delta_tof_s=None, sigma_s=None, waveform=None)
    mismatch = find_mismatch(dataset)
    if mismatch is None:
        return []
    accepted = "times and positions in the same order of the elements"
    if mismatch.proposal is not None:
        accepted += f"; correct a copy: bentray correct SCAN -o COPY --arrangement {mismatch.proposal.name}"
    return [Finding(ORDER, f"times do not fit the positions: {mismatch.found}", accepted, "refused")]
