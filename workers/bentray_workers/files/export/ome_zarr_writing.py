"""Writing volumes as OME-Zarr 0.5, in a folder or a zip; one channel for each quantity."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..atomic import atomic_replace
from ..volume_axes import Grid, check_aligned
from .even_spacing import check_even_spacing
from .optional_library import import_optional

VERSION = "0.5"
ROOT = "zarr.json"
# Directions in which x, y and z increase.
RAS = ("left-to-right", "posterior-to-anterior", "inferior-to-superior")
# Nodes along the sides of a chunk.
CHUNK = 128
# Of the members of a zip: the same volume gives the same bytes.
EPOCH = (1980, 1, 1, 0, 0, 0)


def write_ome_zarr(
    path: Path,
    images: Mapping[str, NDArray[Any]],
    units: Mapping[str, str],
    grid: Grid,
    title: str,
) -> None:
    """Write images on one grid as channels of one multiscale image with one level.

    The axes are (c, z, y, x), or (c, y, x) of a plane, in metres; scale and translation give the positions of
    the nodes, RAS, which is stated as in RFC-4. Labels of channels have the unit.

    Args:
        path: of a zip, which is replaced atomically, or with the suffix ``.zarr`` of a new folder.
        images: (nx, ny[, nz]) by name, of one type.
        units: by name.
        grid: positions of the nodes.
        title: of the image.

    Raises:
        InvalidInput: for uneven spacing, oblique axes, an existing folder, or without zarr.
        OSError: where the folder cannot be written to or the disk is full.

    Source:
        OME-Zarr 0.5, ngff.openmicroscopy.org/0.5; orientation: ngff.openmicroscopy.org/rfc/4.
    """
    check_even_spacing(grid.spacing_m, "OME-Zarr")
    check_aligned(grid, "volume", "axes along x, y and z for OME-Zarr; nifti, nrrd or hdf5 hold any")
    members = _members(images, _attributes(images, units, grid, title))
    if path.suffix == ".zarr":
        _write_folder(path, members)
    else:
        _write_zip(path, members)


def _attributes(
    images: Mapping[str, NDArray[Any]],
    units: Mapping[str, str],
    grid: Grid,
    title: str,
) -> dict[str, Any]:
    """The attribute ``ome`` of the group."""
    space = [
        {"name": name, "type": "space", "unit": "meter", "orientation": {"type": "anatomical", "value": way}}
        for name, way in zip("xyz", RAS, strict=True)
    ][: len(grid.spacing_m)]
    ranges = {name: (float(image.min()), float(image.max())) for name, image in images.items()}
    return {
        "version": VERSION,
        "multiscales": [
            {
                "name": " ".join(title.split()) or "volume",
                "axes": [{"name": "c", "type": "channel"}, *space[::-1]],
                "datasets": [
                    {
                        "path": "0",
                        "coordinateTransformations": [
                            {"type": "scale", "scale": [1.0, *map(float, grid.spacing_m[::-1])]},
                            {"type": "translation", "translation": [0.0, *map(float, grid.origin_m[::-1])]},
                        ],
                    }
                ],
            }
        ],
        "omero": {
            "channels": [
                {
                    "label": f"{name} ({units[name]})" if units.get(name) else name,
                    "color": "FFFFFF",
                    "active": number == 0,
                    "window": {"start": low, "end": high, "min": low, "max": high},
                }
                for number, (name, (low, high)) in enumerate(ranges.items())
            ]
        },
    }


def _members(images: Mapping[str, NDArray[Any]], attributes: dict[str, Any]) -> dict[str, Any]:
    """Content by path in the hierarchy; that of the root group comes first."""
    zarr = import_optional("zarr", "export", "OME-Zarr")
    held: dict[str, Any] = {}
    root = zarr.open_group(
        zarr.storage.MemoryStore(held), mode="w", zarr_format=3, attributes={"ome": attributes}
    )
    first = next(iter(images.values()))
    sides = first.shape[::-1]
    array = root.create_array(
        "0",
        shape=(len(images), *sides),
        chunks=(1, *(min(n, CHUNK) for n in sides)),
        dtype=first.dtype.newbyteorder("<"),
        dimension_names=["c", *"zyx"[-len(sides) :]],
    )
    for number, image in enumerate(images.values()):
        array[number] = image.T
    return {name: held[name] for name in sorted(held, key=lambda name: (name != ROOT, name))}


def _write_zip(path: Path, members: dict[str, Any]) -> None:
    with atomic_replace(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_STORED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name, EPOCH), content.to_bytes())


def _write_folder(path: Path, members: dict[str, Any]) -> None:
    try:
        path.mkdir()
    except FileExistsError:
        raise InvalidInput("output", f"{path} (exists)", "a new folder") from None
    try:
        for name, content in members.items():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            (path / name).write_bytes(content.to_bytes())
    except BaseException:
        shutil.rmtree(path, ignore_errors=True)
        raise
