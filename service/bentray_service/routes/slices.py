"""/v1/volumes/{id}/slice.png: a slice of a volume as an image."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any, Literal, cast

from fastapi import APIRouter, Depends, Query, Request, Response

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.quantities import QUANTITIES, QuantityName
from bentray_workers.images.plane import check_plane
from bentray_workers.images.slice_style import (
    COLORMAPS,
    COLOUR_VALUE,
    MAX_SIZE,
    MIN_FRAMED_SIZE,
    MIN_SIZE,
    SliceStyle,
)

from ..wiring import Background, FindVolume
from .pictures import PICTURE, picture

router = APIRouter()

COLOUR_SCHEMA = cast("dict[str, Any]", COLOUR_VALUE.schema)


async def read_style(
    colormap: Annotated[
        str,
        Query(
            description="One of " + ", ".join(COLORMAPS) + ".", json_schema_extra={"enum": list(COLORMAPS)}
        ),
    ] = "viridis",
    size: Annotated[
        int | None,
        Query(
            description=f"Longest side in pixels, {MIN_FRAMED_SIZE} to {MAX_SIZE}, without a frame from "
            f"{MIN_SIZE}. Default: standard text size, and one pixel per node without a frame.",
            json_schema_extra={"minimum": MIN_SIZE, "maximum": MAX_SIZE},
        ),
    ] = None,
    interpolation: Annotated[
        Literal["nearest", "cubic"], Query(description="Interpolation between nodes.")
    ] = "nearest",
    scale_bar: Annotated[bool, Query(description="Draw a scale bar.")] = False,
    colour_bar: Annotated[
        bool, Query(description="Draw a colour bar with values and unit; framed only.")
    ] = True,
    frame: Annotated[
        bool, Query(description="Draw title, axes in mm and notes; false: the image alone.")
    ] = True,
) -> SliceStyle:
    """The appearance of a slice image."""
    return SliceStyle(colormap, size, interpolation, scale_bar, colour_bar, frame)


@router.head("/{volume_id}/slice.png", include_in_schema=False)
@router.get("/{volume_id}/slice.png", response_class=Response, responses=PICTURE)
async def slice_png(
    find: FindVolume,
    request: Request,
    background: Background,
    style: Annotated[SliceStyle, Depends(read_style)],
    axis: Annotated[Literal["x", "y", "z"], Query(description="Axis perpendicular to the slice.")] = "z",
    index: Annotated[
        int | None, Query(ge=0, description="Index along this axis; default: the middle.")
    ] = None,
    quantity: Annotated[
        Literal[QuantityName, "value"] | None,
        Query(
            description="Quantity to show. Reconstructions: speed (default), coverage, "
            "attenuation if the scan has amplitudes, recovery if resolution_check was set, "
            "uncertainty (m/s) and reflection (dB) if requested. upload: value."
        ),
    ] = None,
    low: Annotated[
        float | None,
        Query(description="Value of the darkest colour; m/s for speed.", json_schema_extra=COLOUR_SCHEMA),
    ] = None,
    high: Annotated[
        float | None, Query(description="Value of the brightest colour.", json_schema_extra=COLOUR_SCHEMA)
    ] = None,
) -> Response:
    """Render one slice as PNG on a worker.

    HEAD returns the ETag without rendering, so Content-Length is absent.
    """
    volume = await find()
    check_plane(volume.shape, volume.spacing_m, axis, index)
    for name, value in (("low", low), ("high", high)):
        if value is not None:
            COLOUR_VALUE.check(name, value)
    how: dict[str, Any] = {"axis": axis, "index": index, "low": low, "high": high, **asdict(style)}
    if volume.job_id is not None:
        if quantity == "value":
            accepted = "one of " + ", ".join(QUANTITIES)
            raise InvalidInput("quantity", "'value'", accepted)
        how["quantity"] = quantity or "speed"
    elif quantity not in (None, "value"):
        raise InvalidInput("quantity", repr(quantity), "value: this is an uploaded volume")
    return await picture(request, volume, how, lambda: background.pictures.slice_png(volume, how))
