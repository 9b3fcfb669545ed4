"""Reconstruction files (``reconstruction.h5``): written atomically, read exactly."""

import json
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import (
    RESIDUAL_EDGES_S,
    Candidate,
    Caution,
    Iteration,
    Reconstruction,
    Settings,
)
from bentray_kernels.tomography.result import Reflection
from bentray_kernels.tomography.stored_settings import from_stored

from .dataset.write import write_array
from .hdf5_reading import Reader, opened
from .hdf5_writing import atomic_hdf5
from .quantities import FORMAT, IMAGES, REFLECTION, VERSION

Record = TypeVar("Record")

HISTORY = {
    "slice": np.int64,
    "sweep": np.int64,
    "residual_rms_s": np.float64,
    "emitters": np.int64,
    "stage": np.int64,
    "given": np.bool_,
}

# Columns of full-waveform refinements; NaN for other stages. Absent in older files.
WAVES = ("band_low_hz", "band_high_hz", "misfit", "held_out_misfit", "of_attenuation")


def write_reconstruction(path: Path, reconstruction: Reconstruction) -> None:
    """Write a reconstruction; ``path`` is replaced atomically.

    The file holds ``speed_mps``, ``coverage_m`` and, if present, ``attenuation_np_m``, ``recovery`` and
    ``uncertainty_mps`` with attribute ``resolution_width_m``, each (nx, ny) or (nx, ny, nz);
    ``reflection_db``, if present, with attributes ``spacing_m`` and ``origin_m`` of its own; ``history``
    with a column for each field of ``Iteration``; ``residuals`` with ``count`` and the ``edge_s`` of its
    bins; and root attributes ``spacing_m``, ``origin_m``, ``axes``, ``water_speed_mps``, ``settings``,
    ``trials``, ``cautions`` and ``provenance``, the last four JSON.

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    with atomic_hdf5(Path(path), FORMAT, VERSION) as file:
        file.attrs["axes"] = "x,y" if reconstruction.speed.ndim == 2 else "x,y,z"
        file.attrs["spacing_m"] = reconstruction.spacing_m
        file.attrs["origin_m"] = reconstruction.origin_m
        file.attrs["water_speed_mps"] = reconstruction.water_speed_mps
        file.attrs["settings"] = json.dumps(reconstruction.settings.to_dict())
        file.attrs["trials"] = json.dumps([asdict(candidate) for candidate in reconstruction.trials])
        file.attrs["cautions"] = json.dumps([asdict(caution) for caution in reconstruction.cautions])
        file.attrs["provenance"] = json.dumps(reconstruction.provenance)
        for name, array_path in IMAGES.items():
            if getattr(reconstruction, name) is not None:
                write_array(file, array_path, getattr(reconstruction, name))
        if reconstruction.uncertainty is not None:
            file[IMAGES["uncertainty"]].attrs["resolution_width_m"] = reconstruction.resolution_width_m
        if reconstruction.reflection is not None:
            write_array(file, REFLECTION, reconstruction.reflection.db)
            file[REFLECTION].attrs["spacing_m"] = reconstruction.reflection.spacing_m
            file[REFLECTION].attrs["origin_m"] = reconstruction.reflection.origin_m
        history = file.create_group("history")
        for column, dtype in HISTORY.items():
            rows: NDArray[Any] = np.array([getattr(sweep, column) for sweep in reconstruction.history], dtype)
            write_array(history, column, rows)
        if any(sweep.band_hz is not None for sweep in reconstruction.history):
            for column, values in zip(
                WAVES, zip(*map(_waves, reconstruction.history), strict=True), strict=True
            ):
                write_array(history, column, np.array(values, dtype=np.float64))
        if reconstruction.residuals is not None:
            residuals = file.create_group("residuals")
            write_array(residuals, "count", reconstruction.residuals)
            write_array(residuals, "edge_s", RESIDUAL_EDGES_S)


def read_reconstruction(path: Path) -> Reconstruction:
    """Read a reconstruction.

    Raises:
        InvalidInput: naming the first field that is missing or wrong, as ``read_dataset`` does.
    """
    with opened(Path(path)) as reader:
        return reconstruction_in(reader)


def reconstruction_in(reader: Reader) -> Reconstruction:
    """The reconstruction in an open file; raises InvalidInput as ``read_reconstruction``."""
    reader.check_format(FORMAT, VERSION)
    speed = _image(reader, "speed_mps", None)
    coverage = _image(reader, "coverage_m", speed.shape)
    extra = {
        name: _image(reader, IMAGES[name], speed.shape) if reader.has(IMAGES[name]) else None
        for name in IMAGES
        if name not in ("speed", "coverage")
    }
    water = reader.number("", "water_speed_mps", "m/s")
    if water is None:
        raise InvalidInput("@water_speed_mps", "nothing", "a speed in m/s")
    provenance = {str(k): str(v) for k, v in _json(reader, "provenance").items()}
    return Reconstruction(
        speed=speed,
        coverage=coverage,
        **extra,
        resolution_width_m=_widths(reader),
        reflection=_reflection(reader, speed.shape[2:]),
        spacing_m=_per_axis(reader, "spacing_m", speed.ndim),
        origin_m=_per_axis(reader, "origin_m", speed.ndim),
        water_speed_mps=water,
        settings=_settings(_json(reader, "settings"), provenance),
        history=_history(reader),
        residuals=_residuals(reader),
        trials=_trials(reader),
        cautions=_cautions(reader, provenance.pop("uncertainty", "")),
        provenance=provenance,
    )


def shape_of_quantity(path: Path, quantity: str, shape: tuple[int, ...]) -> tuple[int, ...]:
    """Shape of a quantity of a reconstruction file.

    Args:
        path: of the file.
        quantity: of ``QUANTITIES``.
        shape: of the speed.

    Raises:
        InvalidInput: for a result without a reflection image.
    """
    if quantity != "reflection":
        return shape
    with opened(Path(path)) as reader:
        stored = reader.checked(REFLECTION, "f", "(nx, ny) or (nx, ny, nz) numbers")
        if stored is None:
            raise InvalidInput("quantity", "reflection of a result without it", "a quantity of this result")
        return tuple(int(n) for n in stored.shape)


def _image(reader: Reader, path: str, shape: tuple[int, ...] | None) -> NDArray[np.float64]:
    accepted = "(nx, ny) or (nx, ny, nz) numbers" if shape is None else f"numbers of shape {shape}"
    image = reader.required(path, "f", accepted)
    if image.ndim not in (2, 3) or 0 in image.shape or (shape is not None and image.shape != shape):
        raise InvalidInput(path, f"shape {image.shape}", accepted)
    return np.asarray(image, dtype=np.float64)


def _reflection(reader: Reader, heights: tuple[int, ...]) -> Reflection | None:
    """The reflection image, with as many heights as the speed; None if there is none."""
    if not reader.has(REFLECTION):
        return None
    db = _image(reader, REFLECTION, None)
    if db.shape[2:] != heights:
        raise InvalidInput(REFLECTION, f"shape {db.shape}", "the slices of the speed")
    grid = (_per_axis(reader, name, db.ndim, REFLECTION) for name in ("spacing_m", "origin_m"))
    return Reflection(db, *grid)


def _widths(reader: Reader) -> tuple[float, ...]:
    """Resolution widths, m; none without uncertainty."""
    path, name = IMAGES["uncertainty"], "resolution_width_m"
    if not reader.has(path):
        return ()
    values = reader.numbers(path, name, "m")
    if not values or not min(values) >= 0.0:
        raise InvalidInput(f"{path}@{name}", values or "nothing", "a number >= 0 m for each slice")
    return values


def _per_axis(reader: Reader, name: str, ndim: int, path: str = "") -> tuple[float, ...]:
    values = reader.numbers(path, name, "m")
    if values is None or len(values) != ndim:
        given = "nothing" if values is None else values
        raise InvalidInput(f"{path}@{name}", given, f"{ndim} numbers in m")
    return values


def _history(reader: Reader) -> tuple[Iteration, ...]:
    columns = {name: _column(reader, name, np.dtype(dtype).kind) for name, dtype in HISTORY.items()}
    rows = [dict(zip(columns, row, strict=False)) for row in zip(*columns.values(), strict=False)]
    waves = [[None if math.isnan(value) else value for value in column] for column in _wave_columns(reader)]
    if len({len(column) for column in (*columns.values(), *waves)}) != 1:
        raise InvalidInput("history", "columns of different lengths", "columns of one length")
    if not waves:
        return tuple(Iteration(**row) for row in rows)
    return tuple(
        Iteration(
            **row,
            band_hz=(low, high) if low and high else None,
            misfit=misfit,
            held_out_misfit=held,
            of_attenuation=bool(loss),
        )
        for row, low, high, misfit, held, loss in zip(rows, *waves, strict=True)
    )


def _waves(sweep: Iteration) -> tuple[float, ...]:
    """The arrays named in ``WAVES`` of one sweep."""
    values = (*(sweep.band_hz or (None, None)), sweep.misfit, sweep.held_out_misfit, sweep.of_attenuation)
    return tuple(math.nan if value is None else value for value in values)


def _wave_columns(reader: Reader) -> list[list[float]]:
    """None in a file without them."""
    if not reader.has(f"history/{WAVES[0]}"):
        return []
    return [_column(reader, name, "f") for name in WAVES]


def _column(reader: Reader, name: str, kind: str) -> list[Any]:
    values = reader.required(f"history/{name}", kind, "a column of numbers")
    if values.ndim != 1:
        raise InvalidInput(f"history/{name}", f"shape {values.shape}", "a column of numbers")
    return list(values.tolist())


def _residuals(reader: Reader) -> NDArray[np.int64] | None:
    if not reader.has("residuals/count"):
        return None
    accepted = f"{len(RESIDUAL_EDGES_S) - 1} counts"
    counts = reader.required("residuals/count", "i", accepted)
    if counts.shape != (len(RESIDUAL_EDGES_S) - 1,):
        raise InvalidInput("residuals/count", f"shape {counts.shape}", accepted)
    return np.asarray(counts, dtype=np.int64)


def _trials(reader: Reader) -> tuple[Candidate, ...]:
    return _records(
        reader,
        "trials",
        lambda trial: Candidate(
            dict(trial["settings"]),
            float(trial["held_out_rms_s"]),
            float(trial["shown_rms_s"]),
            None if trial.get("held_out_mean_s") is None else float(trial["held_out_mean_s"]),
        ),
    )


def _cautions(reader: Reader, earlier: str) -> tuple[Caution, ...]:
    """The cautions; before there was a list, the one about the uncertainty was in the provenance."""
    if not reader.text("", "cautions"):
        return (Caution("uncertainty", earlier),) if earlier else ()
    return _records(
        reader, "cautions", lambda c: Caution(str(c["code"]), str(c["text"]), bool(c["doubtful"]))
    )


def _records(reader: Reader, name: str, make: Callable[[Any], Record]) -> tuple[Record, ...]:
    """Records of a JSON list, each made of its values; none where the list is absent."""
    text = reader.text("", name) or "[]"
    try:
        return tuple(make(values) for values in json.loads(text))
    except (ValueError, TypeError, KeyError, RecursionError):
        raise InvalidInput(f"@{name}", repr(text[:60]), f"a JSON list of {name} by this version") from None


def _json(reader: Reader, name: str) -> dict[str, Any]:
    text = reader.text("", name)
    try:
        content = json.loads(text or "")
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise InvalidInput(f"@{name}", repr((text or "")[:60]), "a JSON object")
    return content


def _settings(values: dict[str, Any], provenance: dict[str, str]) -> Settings:
    try:
        # Files of earlier versions hold no numerical parameters of their own.
        return from_stored(values, json.loads(provenance.get("numerics", "{}")))
    except (TypeError, json.JSONDecodeError, RecursionError) as error:
        accepted = "the settings of a reconstruction by this version"
        raise InvalidInput("@settings", str(error), accepted) from None
