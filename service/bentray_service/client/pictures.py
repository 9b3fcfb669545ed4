"""Flows that get pictures, rendered on a worker."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Unpack

from bentray_kernels.requests.names import DEFAULT_PICKER, PickerName

from ..interactive.picture import Picture
from ..settings_request import check_setting_names
from .connection import Connection
from .steps import Flow, RequestStep
from .stored import DatasetId, VolumeId, id_of, volume_of

if TYPE_CHECKING:
    from ..interactive.setting_types import RefractionSettings


def slice_png(connection: Connection, volume: VolumeId, /, **how: str | float) -> Flow[Picture]:
    """Get a slice as PNG; ``how``: axis, index, quantity, low, high, colormap, size, frame."""
    return (yield from _picture(f"/v1/volumes/{volume_of(volume)}/slice.png", how))


def refraction_png(
    connection: Connection, volume: VolumeId, /, **view: Unpack[RefractionSettings]
) -> Flow[Picture]:
    """Render a 3-D volume with even spacing as refracting glass, or its surface, as PNG.

    Args:
        volume: id or record of the volume, or record of its job.
        view: such as ``iso=(1500.0,)``, ``index=(1.5,)``, ``azimuth_deg=30``, ``mode="shaded"``.

    Raises:
        InvalidInput: for an unknown setting, with the one that is spelt most like it.
    """
    from bentray_workers.rendering.refraction_view import RefractionView

    check_setting_names(view, RefractionView)
    return (yield from _picture(f"/v1/volumes/{volume_of(volume)}/refraction.png", dict(view)))


def quality_png(
    connection: Connection, dataset: DatasetId, picker: PickerName = DEFAULT_PICKER
) -> Flow[Picture]:
    """Get the quality report of a scan as PNG: gathers with picks, matrix of times, findings."""
    return (yield from _picture(f"/v1/datasets/{id_of(dataset)}/quality.png", {"picker": picker}))


def _picture(path: str, params: dict[str, Any]) -> Flow[Picture]:
    given = {name: value for name, value in params.items() if value is not None}
    return Picture((yield RequestStep("GET", path, {"params": given}, repeatable=True)).content)
