"""Writing volumes as OME-Zarr 0.5, in a folder or a zip; one channel for each quantity."""

import shutil
import zipfile
from pathlib import Path
from typing import Any

from bentray_kernels.errors import InvalidInput

from ..atomic import atomic_replace
from ..quantities import UNITS
from ..volume_axes import check_aligned
from .content import Content, import_optional

VERSION = "0.5"
ROOT = "zarr.json"
# Directions in which x, y and z increase.
RAS = ("left-to-right", "posterior-to-anterior", "inferior-to-superior")
# Nodes along the sides of a chunk.
CHUNK = 128
# Of the members of a zip: the same volume gives the same bytes.
EPOCH = (1980, 1, 1, 0, 0, 0)


def write(path: Path, content: Content) -> None:
    """Write images as channels of one multiscale image with one level; see ``ExportFormat.write``.

    The axes are (c, z, y, x), or (c, y, x) of a plane, in metres; scale and translation give the positions of
    the nodes, RAS, which is stated as in RFC-4. Labels of channels have the unit. A ``path`` with the suffix
    ``.zarr`` is a new folder, else a zip.

    Raises:
        InvalidInput: for oblique axes, an existing folder, or without zarr.

    Source:
        OME-Zarr 0.5, ngff.openmicroscopy.org/0.5; orientation: ngff.openmicroscopy.org/rfc/4.
    """
    check_aligned(content.grid, "volume", "axes along x, y and z for OME-Zarr; nifti, nrrd or hdf5 hold any")
    members = _members(content)
    if path.suffix == ".zarr":
        _write_folder(path, members)
    else:
        _write_zip(path, members)


def _attributes(content: Content) -> dict[str, Any]:
    """The attribute ``ome`` of the group."""
    grid = content.grid
    space = [
        {"name": name, "type": "space", "unit": "meter", "orientation": {"type": "anatomical", "value": way}}
        for name, way in zip("xyz", RAS, strict=True)
    ][: len(grid.spacing_m)]
    ranges = {name: (float(image.min()), float(image.max())) for name, image in content.images.items()}
    return {
        "version": VERSION,
        "multiscales": [
            {
                "name": content.line or "volume",
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
                    "label": f"{name} ({UNITS[name]})" if UNITS.get(name) else name,
                    "color": "FFFFFF",
                    "active": number == 0,
                    "window": {"start": low, "end": high, "min": low, "max": high},
                }
                for number, (name, (low, high)) in enumerate(ranges.items())
            ]
        },
    }


def _members(content: Content) -> dict[str, Any]:
    """Content by path in the hierarchy; that of the root group comes first."""
    zarr = import_optional("zarr", "export", "OME-Zarr")
    held: dict[str, Any] = {}
    store, attributes = zarr.storage.MemoryStore(held), {"ome": _attributes(content)}
    root = zarr.open_group(store, mode="w", zarr_format=3, attributes=attributes)
    images = content.images
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
