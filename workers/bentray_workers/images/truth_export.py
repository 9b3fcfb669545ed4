"""Export of the truth of a scan at the nodes of its reconstruction."""

from pathlib import Path

from bentray_kernels.errors import InvalidInput

from ..files.dataset.read import read_dataset
from ..files.export.content import Content
from ..files.export.registry import EXPORTED, SINGLE, FormatName
from ..files.reconstruction import read_reconstruction
from ..files.volume_axes import Grid


def export_truth(volume: Path, *, scan: Path, target: Path, name: FormatName) -> None:
    """Task: write the true speed at the nodes of a reconstruction, m/s; NaN outside the truth.

    Args:
        volume: file of the reconstruction.
        scan: file of its scan.
        target: the exported file, replaced atomically.
        name: of ``registry.SINGLE``.

    Raises:
        InvalidInput: naming ``format``, or ``quantity`` for a scan without truth, or whose truth has other
            axes than the reconstruction.
        OSError: where the folder cannot be written to or the disk is full.
    """
    # Loaded only where it runs.
    from bentray_kernels.tomography.comparison import NotComparable, on_grid

    if name not in SINGLE:
        raise InvalidInput("format", f"{name!r} of the truth", ", ".join(SINGLE))
    own, truth = read_reconstruction(volume), read_dataset(scan, traces=False).truth
    if truth is None:
        raise InvalidInput("quantity", "truth of a scan without it", "a quantity of the result")
    try:
        values = on_grid(truth.sound_speed_mps, truth, own)
    except NotComparable as reason:
        raise InvalidInput("quantity", f"truth: {reason}", "a quantity of the result") from None
    title = "True speed of sound, m/s"
    images = {"truth_mps": values}
    EXPORTED[name].write(target, Content(values, Grid(own.spacing_m, own.origin_m), title, images))
