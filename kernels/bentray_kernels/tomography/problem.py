"""One slice's inverse problem on a grid: transducers in grid coordinates, data per emitter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..acquisition import Dataset
from ..arrays import Flags, Floats, Ints
from ..errors import InvalidInput
from .settings import Settings

# Water kept around the outermost transducer, nodes, so that wave front and gradient have room.
MARGIN_NODES = 3

# Nodes nearer to the array than this are water and stay so.
RIM_NODES = 2


@dataclass(frozen=True)
class SliceProblem:
    """What a reconstruction needs of a slice, once.

    Attributes:
        emitters: (ntx, 2), m, node 0 at 0; receivers: (nrx, 2), as well.
        delta_tof: (ntx, nrx), s, object minus water; NaN where there is none.
        region: (nodes, nodes), nodes that may change.
        spacing: node spacing, m.
        origin: position of node 0 in the dataset's coordinates, m.
        water_speed: m/s.
        log_ratio: as ``delta_tof``, ln(A_water / A_object), Np; None where no amplitudes were recorded.
        water_attenuation: Np/m.
    """

    emitters: Floats
    receivers: Floats
    delta_tof: Floats
    region: Flags
    spacing: float
    origin: tuple[float, float]
    water_speed: float
    log_ratio: Floats | None = None
    water_attenuation: float = 0.0

    @classmethod
    def of(cls, dataset: Dataset, settings: Settings, index: int = 0) -> SliceProblem:
        """The problem of one slice of a dataset; ``index`` counts slices from 0.

        Raises:
            InvalidInput: three-dimensional positions, no travel times in the slice, elements outside the
                image, an image without a node inside the array, bounds that exclude the water.
        """
        if dataset.element_position_m.shape[1] != 2:
            raise InvalidInput(
                "geometry/element_position_m",
                f"shape {dataset.element_position_m.shape}",
                "(elements, 2): arrays in three dimensions cannot be reconstructed yet",
            )
        low, high = settings.speed_bounds_mps
        if not low <= dataset.water_speed_mps <= high:
            raise InvalidInput(
                "speed_bounds_mps",
                settings.speed_bounds_mps,
                f"bounds around the speed of the water, {dataset.water_speed_mps:g} m/s",
            )
        one = dataset.slice(index)
        delta, ratio = one.differential_tof(), one.log_ratio_np
        if ratio is not None and one.valid is not None:
            ratio = np.where(one.valid, ratio, np.nan)
        emitters, receivers = dataset.tx, dataset.rx
        if settings.reciprocity:
            if ratio is not None:
                _, _, ratio = _with_reverses(emitters, receivers, ratio)
            emitters, receivers, delta = _with_reverses(emitters, receivers, delta)
        if not np.isfinite(delta).any():
            where = f" in slice {index}" if dataset.slices > 1 else ""
            raise InvalidInput(
                "traveltime", f"no valid pair{where}", "at least one finite travel time between two elements"
            )
        position = dataset.element_position_m
        centre = 0.5 * (position.min(axis=0) + position.max(axis=0))
        reach = float(np.abs(position - centre).max())
        side = settings.side_m
        if side is None:
            side = 2.0 * reach * (settings.nodes - 1) / (settings.nodes - 1 - 2 * MARGIN_NODES)
        if side < 2.0 * reach:
            raise InvalidInput("side_m", side, f"at least {2.0 * reach:g} m, to hold the array")
        origin = centre - 0.5 * side
        spacing = side / (settings.nodes - 1)
        axis = np.arange(settings.nodes) * spacing
        nearest = float(np.linalg.norm(position - centre, axis=1).min()) - RIM_NODES * spacing
        region = np.hypot(axis[:, None] - 0.5 * side, axis[None, :] - 0.5 * side) <= nearest
        if reach == 0.0 or not region.any():
            raise InvalidInput(
                "geometry/element_position_m",
                f"no node inside the array: nodes {spacing:.3g} m apart, array {2.0 * reach:.3g} m wide",
                "elements around the object, and nodes (settings nodes, side_m) between them",
            )
        return cls(
            emitters=position[emitters] - origin,
            receivers=position[receivers] - origin,
            delta_tof=delta,
            region=region,
            spacing=spacing,
            origin=(float(origin[0]), float(origin[1])),
            water_speed=dataset.water_speed_mps,
            log_ratio=ratio,
            water_attenuation=dataset.water_attenuation_np_m or 0.0,
        )


def _with_reverses(tx: Ints, rx: Ints, delta: Floats) -> tuple[Ints, Ints, Floats]:
    """All elements as both emitters and receivers, missing pairs filled by their reverse.

    Travel times are the same both ways, so a half matrix is as good as a whole one, and every
    emitter then sees the object from all sides.
    """
    elements = np.union1d(tx, rx)
    full = np.full((len(elements), len(elements)), np.nan)
    # Duplicate entries of tx or rx keep their last value, as a dictionary would.
    full[np.searchsorted(elements, tx)[:, None], np.searchsorted(elements, rx)[None, :]] = delta
    return elements, elements, np.where(np.isfinite(full), full, full.T)
