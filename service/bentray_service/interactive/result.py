"""An image with its coordinates, units and provenance: drawn, compared, converted and saved."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import (
    Candidate,
    Caution,
    Iteration,
    Reconstruction,
    RegionStatistics,
    Settings,
    region_statistics,
    round_nodes,
)
from bentray_workers.files.export.content import import_optional
from bentray_workers.files.quantities import QUANTITIES
from bentray_workers.files.volume import Volume

from ..html_tables import figures_html, picture_html
from .scan import Scan

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from .comparison import Comparison

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Axes of the reflection, before that of heights: it has a grid of its own.
REFLECTION_AXES = ("reflection_x", "reflection_y")
# Name of the only array of an uploaded volume.
VALUE = "value"
# Of one image in the picture of a notebook, inches.
WIDTH_IN, HEIGHT_IN = 4.6, 3.7


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """An image: arrays by quantity, their coordinates and units, and how they were made.

    Attributes:
        axes: names of the axes in order: ``x``, ``y`` and, in 3-D, ``z``.
        values: arrays by name, each (nx, ny[, nz]): for a reconstruction ``speed``, ``coverage`` and, if
            present, ``attenuation``, ``recovery``, ``uncertainty`` and ``reflection``; for an upload
            ``value``.
        coordinates: node positions along each axis, m; ``z`` is missing for slices with non-uniform heights.
            The reflection has a grid of its own, along ``reflection_x`` and ``reflection_y``.
        units: unit of each array.
        attributes: provenance: title, settings, versions, time; of a service also the ids.
        image: what the arrays are taken from, with settings and history.
        truth: of a simulated scan, else None.
        roi: the region of interest of the scan, on the grid of the truth, or None.
    """

    axes: tuple[str, ...]
    values: Mapping[str, NDArray[Any]]
    coordinates: Mapping[str, Floats]
    units: Mapping[str, str]
    attributes: Mapping[str, str]
    image: Reconstruction | Volume
    truth: Truth | None = None
    roi: Bools | None = None

    @property
    def speed(self) -> Floats:
        """Sound speed, (nx, ny[, nz]), m/s."""
        return self._of("speed")

    @property
    def attenuation(self) -> Floats:
        """Attenuation, as ``speed``, Np/m (experimental); raises InvalidInput if it was not reconstructed."""
        return self._of("attenuation")

    @property
    def coverage(self) -> Floats:
        """Length of rays through each node, as ``speed``, m."""
        return self._of("coverage")

    @property
    def recovery(self) -> Floats:
        """Recovered fraction of a checkerboard, as ``speed``; raises InvalidInput without a check."""
        return self._of("recovery")

    @property
    def uncertainty(self) -> Floats:
        """Standard deviation, as ``speed``, m/s; raises InvalidInput without ``uncertainty``.

        Of the speed from the truth smoothed by a Gaussian of ``resolution_width_m``.
        """
        return self._of("uncertainty")

    @property
    def resolution_width_m(self) -> tuple[float, ...]:
        """Resolution width of each slice, or one of a slice or volume, m; empty without ``uncertainty``."""
        return self._reconstruction().resolution_width_m

    @property
    def reflection(self) -> Floats:
        """Envelope of the echoes, dB, on pixels of its own; raises InvalidInput without ``reflection``."""
        return self._of("reflection")

    def axes_of(self, name: str) -> tuple[str, ...]:
        """The axes of one of ``values``."""
        return (*REFLECTION_AXES, *self.axes[2:]) if name == "reflection" else self.axes

    @property
    def spacing_m(self) -> tuple[float, ...]:
        """Node spacing along each axis, m; z is NaN for slices with non-uniform heights."""
        return tuple(self.image.spacing_m)

    @property
    def origin_m(self) -> tuple[float, ...]:
        """Position of node 0 along each axis, m."""
        return tuple(self.image.origin_m)

    @property
    def settings(self) -> Settings:
        """The settings that were used; raises InvalidInput for an uploaded volume."""
        return self._reconstruction().settings

    @property
    def history(self) -> tuple[Iteration, ...]:
        """The misfit after each iteration; raises InvalidInput for an uploaded volume."""
        return self._reconstruction().history

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """Cautions of the result, doubts first; raises InvalidInput for an uploaded volume."""
        return self._reconstruction().cautions

    @property
    def trials(self) -> tuple[Candidate, ...]:
        """The candidate models of method auto, the best first; raises InvalidInput for an uploaded volume."""
        return self._reconstruction().trials

    def plot(
        self,
        quantity: str | None = None,
        *,
        axis: str = "z",
        index: int | None = None,
        low: float | None = None,
        high: float | None = None,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw a slice in mm with a colour bar.

        Args:
            quantity: a name of ``values``; None: the first one.
            axis: across the slice of a volume: x, y or z.
            index: of the slice along it; None: the middle.
            low, high: values of the first and the last colour, in the unit of the quantity; None: the range
                of nodes with rays, without outliers.
            ax: axes to draw on; None: those of a new figure of ``pyplot``.

        Raises:
            InvalidInput: naming the argument.
        """
        from .comparison import new_axes

        axes = new_axes()[0] if ax is None else ax
        self._draw(axes, quantity, (axis, index), (low, high))
        return axes

    def compare(
        self,
        other: Result | Scan | str | os.PathLike[str] | None = None,
        quantity: str = "speed",
        *,
        spacing_m: float | Sequence[float] | None = None,
    ) -> Comparison:
        """Compare with another image, or with a truth, at the nodes of this image.

        Args:
            other: a result, interpolated linearly; a scan with a truth; the path of a file with the truth: a
                dataset, another result, or speeds as NumPy, NRRD, NIfTI or HDF5; None: that of the own scan.
            quantity: ``speed`` or another name of ``values``; of a truth ``speed`` or ``attenuation``.
            spacing_m: node spacing of a NumPy file, m, which is then centred on 0; None: it is on the nodes
                of this image.

        Returns:
            The difference and its figures. Of two results they are over the nodes that rays of both cross; of
            a truth over its region of interest, else the object.

        Raises:
            InvalidInput: naming the argument: without a truth, or for images that cannot be compared.
        """
        if isinstance(other, Result):
            return self._compared(other, quantity)
        if isinstance(other, str | os.PathLike) and not isinstance(other, Scan):
            from bentray_workers.files.truth_file import read_truth

            steps = [float(one) for one in np.atleast_1d(spacing_m)] if spacing_m is not None else None
            known = read_truth(Path(other), self._reconstruction(), steps)
            return self._against_truth(known.truth, known.roi, quantity)
        truth = self.truth if other is None else other.truth
        roi = self.roi if other is None else other.dataset.roi
        if truth is None:
            found = "no other image, of a scan without a truth" if other is None else f"{other!r}, no truth"
            raise InvalidInput("other", found, "a result of bentray.reconstruct, or a simulated scan")
        return self._against_truth(truth, roi, quantity)

    def statistics(
        self, centre_m: Sequence[float], radius_m: float, quantity: str = "speed"
    ) -> RegionStatistics:
        """Mean, spread, size and contrast of a disc of a slice, or of a ball of a volume.

        Args:
            centre_m: (x, y[, z]), m.
            radius_m: m. The contrast is that to a ring from 1.25 to 2 radii.
            quantity: a name of ``values``.

        Raises:
            InvalidInput: naming the argument, also for a disc without a node.
        """
        image, (spacing, origin) = self._of(quantity), self._grid(quantity)
        nodes = round_nodes(centre_m, radius_m, image.shape, spacing, origin)
        assert nodes is not None
        return region_statistics(image, nodes[0], spacing, nodes[1], self._uncertainty(quantity))

    def to_xarray(self) -> xarray.Dataset:
        """Convert to a dataset of xarray, with the units in ``attrs``.

        Raises:
            InvalidInput: when xarray is not installed.
        """
        library = import_optional("xarray", "xarray", "a dataset")
        arrays = {
            name: library.DataArray(array, dims=self.axes_of(name), attrs={"units": self.units[name]})
            for name, array in self.values.items()
        }
        places = {
            name: library.DataArray(place, dims=(name,), attrs={"units": "m"})
            for name, place in self.coordinates.items()
        }
        found: xarray.Dataset = library.Dataset(arrays, coords=places, attrs=dict(self.attributes))
        return found

    def save(
        self,
        path: str | os.PathLike[str],
        quantity: str = "speed",
        *,
        attenuation: str = "Np/m",
        frequency_hz: float | None = None,
    ) -> Path:
        """Write a file in the format of its suffix; an existing file is replaced, whole or not at all.

        ``.h5`` holds everything and is read by ``bentray.load``; the reference of results lists the formats.

        Args:
            path: of the file.
            quantity: for formats with one.
            attenuation: unit of the attenuation, ``Np/m`` or ``dB/cm/MHz``; HDF5 holds Np/m.
            frequency_hz: for dB/cm/MHz, Hz; None: that of the scan.

        Returns:
            The path.

        Raises:
            InvalidInput: naming the argument and what is accepted, such as the suffixes.
            OSError: where the folder cannot be written to or the disk is full.
        """
        from bentray_workers.files.export.registry import format_of
        from bentray_workers.files.reconstruction import write_reconstruction
        from bentray_workers.files.volume import write_volume
        from bentray_workers.files.volume_export import Selection, export_image

        target, image = Path(path), self.image
        name = format_of(target)
        chosen = Selection(quantity, attenuation, frequency_hz)
        if not target.absolute().parent.is_dir():
            raise InvalidInput(
                "path", f"{target} (its folder does not exist)", "a path in an existing folder"
            )
        if name != "hdf5":
            export_image(image, target=target, name=name, selection=chosen, seconds=time.time())
        elif attenuation != "Np/m":
            accepted = "Np/m, which HDF5 results hold, or another format"
            raise InvalidInput("attenuation", repr(attenuation), accepted)
        elif isinstance(image, Volume):
            write_volume(target, image)
        else:
            write_reconstruction(target, image)
        return target

    def __repr__(self) -> str:
        name, array = next(iter(self.values.items()))
        size = " x ".join(map(str, array.shape))
        spread = f"{np.nanmin(array):.6g} to {np.nanmax(array):.6g} {self.units[name]}".rstrip()
        doubt = self.image.doubt if isinstance(self.image, Reconstruction) else ""
        shown = f"<bentray.Result of {size} nodes: {', '.join(self.values)}; {name} {spread}>"
        return f"{doubt}\n{shown}" if doubt else shown

    def __str__(self) -> str:
        image = self.image
        if not isinstance(image, Reconstruction):
            return repr(self)
        from bentray_kernels.tomography.model_selection.selection import advice_of, image_label

        rms, noise = image.residual_rms_s, self.attributes.get("noise", "not known")
        lines = {
            "Trust": image.trust,
            "Method": "; ".join(text for text in (image_label(image), advice_of(image)) if text),
            "Water": self.attributes.get("water", f"{image.water_speed_mps:.1f} m/s, as the scan states it"),
            "Pairs": self.attributes.get("pairs", ""),
            "Scan": self.attributes.get("quality", ""),
            "Residual": "" if rms is None else f"{1e9 * rms:.0f} ns rms, noise {noise}",
            "Time": f"{seconds} s" if (seconds := self.attributes.get("seconds")) else "",
            "Decided automatically": self.attributes.get("automatic", ""),
        }
        cautions = [f"Caution: {caution.text}" for caution in image.cautions if not caution.doubtful]
        told = [f"{name}: {text}" for name, text in lines.items() if text]
        return "\n".join((repr(self), *told[:1], *cautions, *told[1:]))

    def _repr_html_(self) -> str:
        from bentray_workers.images.captions import facts

        from .comparison import figure_png

        shown = list(self.values)[:1] + [name for name in ("attenuation",) if name in self.values]

        def draw(axes: Sequence[Axes]) -> None:
            for one, name in zip(axes, shown, strict=True):
                self._draw(one, name, ("z", None), (None, None))

        png = figure_png(WIDTH_IN * len(shown), HEIGHT_IN, len(shown), draw)
        rows = [
            (f"{name} ({self.units[name]})", f"{np.nanmin(array):.6g} to {np.nanmax(array):.6g}")
            for name, array in self.values.items()
        ]
        rows += [(f"{name} (m)", f"{at[0]:.4g} to {at[-1]:.4g}") for name, at in self.coordinates.items()]
        if isinstance(self.image, Reconstruction):
            rows.append(("method", facts(self.image)))
            rows[:0] = [("caution", one.text) for one in self.image.cautions]
        told = ("seconds", "automatic", "water", "geometry", "quality", "waveform", "bentray")
        rows += [(name, self.attributes[name]) for name in told if name in self.attributes]
        title = self.attributes.get("title") or "Result"
        return picture_html(png, title) + figures_html(title, rows)

    def _of(self, quantity: str) -> NDArray[Any]:
        if quantity not in self.values:
            raise InvalidInput("quantity", repr(quantity), "one of " + ", ".join(self.values))
        return self.values[quantity]

    def _uncertainty(self, quantity: str) -> Floats | None:
        """Standard deviation of the nodes of a quantity, where the result has it: of the speed."""
        return self.values.get("uncertainty") if quantity == "speed" else None

    def _grid(self, quantity: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Spacing and position of node 0 of a quantity, m."""
        held = None if isinstance(self.image, Volume) else self.image.image(quantity)
        if held is None:
            return self.spacing_m, self.origin_m
        return tuple(held.spacing_m), tuple(held.origin_m)

    def _reconstruction(self) -> Reconstruction:
        if isinstance(self.image, Volume):
            raise InvalidInput("image", "an uploaded volume", "a reconstruction")
        return self.image

    def _draw(
        self,
        axes: Axes,
        quantity: str | None,
        cut: tuple[str, int | None],
        limits: tuple[float | None, float | None],
    ) -> None:
        from bentray_workers.images.captions import LABELS, NAMES
        from bentray_workers.images.maps import SPEED
        from bentray_workers.images.plane import plane_of
        from bentray_workers.images.report import COLORMAPS
        from bentray_workers.images.slice import requested_limits, usual_limits

        from .comparison import draw_plane

        name = next(iter(self.values)) if quantity is None else quantity
        grid = self._grid(name)
        plane = plane_of(self._of(name), *grid, *cut)
        # Nodes without rays do not count for the limits.
        crossed = None if name == "reflection" else self.values.get("coverage")
        coverage = None if crossed is None else plane_of(crossed, *grid, *cut).image
        chosen = requested_limits(usual_limits(name, plane.image, coverage), *limits)
        label = LABELS.get(name) or f"value ({self.units[name]})".replace(" ()", "")
        title = NAMES.get(name) or self.attributes.get("title", "")
        draw_plane(axes, plane, chosen, colormap=COLORMAPS.get(name, SPEED), title=title, label=label)

    def _compared(self, other: Result, quantity: str) -> Comparison:
        from bentray_kernels.tomography.comparison import at_nodes

        from .comparison import Comparison

        image, theirs = np.asarray(self._of(quantity), np.float64), other._of(quantity)
        if image.ndim != theirs.ndim:
            found = f"{theirs.ndim} dimensions beside {image.ndim}"
            raise InvalidInput("other", found, "a result of as many dimensions")
        nodes, grid = self._grid(quantity), other._grid(quantity)
        same = image.shape == theirs.shape and np.array_equal(grid, nodes, equal_nan=True)
        if not (same or (np.isfinite(nodes).all() and np.isfinite(grid).all())):
            found = "slices at uneven heights on another grid"
            raise InvalidInput("other", found, "a result on the same nodes, or of evenly spaced slices")

        def here(values: NDArray[Any]) -> Floats:
            return np.asarray(values, np.float64) if same else at_nodes(values, grid, image.shape, nodes)

        there = here(theirs)
        region, choice = np.isfinite(there) & np.isfinite(image), "nodes of both images"
        coverage = "" if quantity == "reflection" else "coverage"
        crossed = [one.values.get(coverage) for one in (self, other)]
        if crossed[0] is not None and crossed[1] is not None:
            both = (crossed[0] > 0.0) & (here(crossed[1]) > 0.0)
            if (region & both).any():
                region, choice = region & both, "nodes that rays of both images cross"
        if not region.any():
            raise InvalidInput("other", "an image without a common node", "one that overlaps with this one")
        compared = image, there, region, choice, *nodes, self._uncertainty(quantity)
        names = ("this image", "the other")
        return Comparison(*compared, names=names, quantity=quantity, unit=self.units[quantity])

    def _against_truth(self, truth: Truth, roi: Bools | None, quantity: str) -> Comparison:
        from bentray_kernels.tomography.comparison import NotComparable, compare, on_grid

        from .comparison import Comparison

        true_images = {"speed": truth.sound_speed_mps, "attenuation": truth.attenuation_np_m}
        known = {name: image for name, image in true_images.items() if image is not None}
        if quantity not in known or quantity not in self.values:
            accepted = "one of " + ", ".join(name for name in known if name in self.values)
            raise InvalidInput("quantity", repr(quantity), accepted)
        try:
            compared = compare(self._reconstruction(), truth, roi)
            true = compared.other
            if quantity != "speed":
                true = on_grid(known[quantity], truth, self._reconstruction())
        except NotComparable as reason:
            raise InvalidInput("truth", str(reason), "a truth on the axes of the image") from None
        image, nodes = np.asarray(self._of(quantity), np.float64), (self.spacing_m, self.origin_m)
        region = compared.region, compared.region_choice
        names, unit = ("reconstruction", "truth"), self.units[quantity]
        deviation = self._uncertainty(quantity)
        return Comparison(image, true, *region, *nodes, deviation, names=names, quantity=quantity, unit=unit)


def result_of(
    image: Reconstruction | Volume,
    attributes: Mapping[str, str],
    *,
    unit: str = "",
    truth: Truth | None = None,
    roi: Bools | None = None,
) -> Result:
    """A reconstruction or a volume as a result.

    Args:
        image: what is shown.
        attributes: what is known beside: ids, title, time.
        unit: of the values of a volume.
        truth, roi: of the scan.
    """
    if isinstance(image, Volume):
        values: dict[str, NDArray[Any]] = {VALUE: image.values}
        stated = {"title": image.title, "axes": image.grid.tilt}
        units, known = {VALUE: unit}, {name: value for name, value in stated.items() if value}
    else:
        held = {name: image.image(name) for name in QUANTITIES}
        values = {name: one.values for name, one in held.items() if one is not None}
        units = {name: QUANTITIES[name].unit for name in values}
        known = {**image.provenance, "settings": json.dumps(image.settings.to_dict())}
    shape = next(iter(values.values())).shape
    axes = tuple("xyz"[: len(shape)])
    coordinates = {
        axis: start + step * np.arange(n)
        for axis, n, start, step in zip(axes, shape, image.origin_m, image.spacing_m, strict=True)
        if np.isfinite(start) and np.isfinite(step)
    }
    if isinstance(image, Reconstruction) and image.reflection is not None:
        own = image.reflection
        grid = zip(REFLECTION_AXES, own.db.shape, own.origin_m, own.spacing_m, strict=False)
        coordinates |= {axis: start + step * np.arange(n) for axis, n, start, step in grid}
    return Result(axes, values, coordinates, units, {**known, **attributes}, image, truth, roi)


def load(path: str | os.PathLike[str]) -> Result:
    """Read a result that ``Result.save`` or ``bentray reconstruct`` wrote (``.h5``), or a volume of Bentray.

    Args:
        path: of the file, or of a folder with ``reconstruction.h5``.

    Returns:
        The result, with arrays (nx, ny[, nz]) in SI units; without the truth of a simulated scan.

    Raises:
        InvalidInput: naming the first field that is missing or wrong, or for a scan.
    """
    from bentray_workers.files.volume_export import read_image

    found = Path(path)
    file = found / "reconstruction.h5" if found.is_dir() else found
    if not file.is_file():
        accepted = "a reconstruction.h5, its folder, or a volume of Bentray in HDF5"
        raise InvalidInput("file", f"{file} (no such file)", accepted)
    try:
        image = read_image(file)
    except InvalidInput as error:
        if "uct-transmission" not in error.value:
            raise
        accepted = "a result or a volume; this is a scan, for bentray.read or bentray reconstruct"
        raise InvalidInput(error.field, error.value, accepted) from None
    return result_of(image, {"file": file.name})
