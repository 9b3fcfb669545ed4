"""A volume as arrays with coordinates and units, read from the downloaded file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..routes.models.job_records import VolumeRecord
from .errors import ClientError

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Result:
    """The content of a volume.

    Attributes:
        axes: names of the axes in order: ``x``, ``y`` and, in 3-D, ``z``.
        values: arrays by name: for a reconstruction ``speed``, ``coverage`` and, if present, ``attenuation``
            and ``recovery``; for an upload ``value``.
        coordinates: node positions along each axis, m; ``z`` is missing for slices with non-uniform heights.
        units: unit of each array.
        attributes: provenance: ids, title, settings, versions.
    """

    axes: tuple[str, ...]
    values: Mapping[str, NDArray[Any]]
    coordinates: Mapping[str, NDArray[np.float64]]
    units: Mapping[str, str]
    attributes: Mapping[str, str] = field(default_factory=dict)

    def to_xarray(self) -> xarray.Dataset:
        """Convert to a dataset of xarray, with the units in ``attrs``.

        Raises:
            ClientError: when xarray is not installed.
        """
        try:
            import xarray
        except ImportError as error:
            raise ClientError("xarray is not installed: pip install 'bentray[xarray]'") from error
        arrays = {
            name: xarray.DataArray(array, dims=self.axes, attrs={"units": self.units[name]})
            for name, array in self.values.items()
        }
        places = {
            name: xarray.DataArray(place, dims=(name,), attrs={"units": "m"})
            for name, place in self.coordinates.items()
        }
        return xarray.Dataset(arrays, coords=places, attrs=dict(self.attributes))


# Units of the arrays of a reconstruction.
UNITS = {"speed": "m/s", "coverage": "m", "attenuation": "Np/m", "recovery": "1"}


def read_result(path: Path, record: VolumeRecord) -> Result:
    """Read the HDF5 file of a volume with the given record."""
    from bentray_workers.files.reconstruction import read_reconstruction
    from bentray_workers.files.volume import read_volume

    named = ("id", "title", "job", "dataset", "sha256")
    attributes = {name: str(value) for name in named if (value := getattr(record, name))}
    spacing: tuple[float, ...]
    origin: tuple[float, ...]
    if record.source == "upload":
        volume = read_volume(path)
        values, units = {"value": volume.values}, {"value": record.unit}
        spacing, origin = volume.spacing_m, volume.origin_m
    else:
        reconstruction = read_reconstruction(path)
        values = {
            name: getattr(reconstruction, name) for name in UNITS if getattr(reconstruction, name) is not None
        }
        units = {name: UNITS[name] for name in values}
        spacing, origin = reconstruction.spacing_m, reconstruction.origin_m
        attributes |= {**reconstruction.provenance, "settings": str(reconstruction.settings.to_dict())}
    shape = next(iter(values.values())).shape
    axes = tuple(record.axes.split(","))
    coordinates = {
        axis: start + step * np.arange(n)
        for axis, n, start, step in zip(axes, shape, origin, spacing, strict=True)
        if np.isfinite(start) and np.isfinite(step)
    }
    return Result(axes, values, coordinates, units, attributes)
