"""The settings of jobs as types, for editors and type checkers; a test compares them with the records."""

from __future__ import annotations

from typing import Literal, TypedDict

from bentray_kernels.picker_names import PickerName
from bentray_kernels.solver_names import SolverName

Method = Literal["sart", "gauss-newton", "auto", "waveform"]
PhantomName = Literal["table6", "table6-vertical", "detailed", "table7"]


class ReconstructionSettings(TypedDict, total=False):
    """The settings of a reconstruction beside its method, each by its own name; see the table of settings."""

    rays: Literal["curved", "straight"]
    eikonal: SolverName
    decomposition: Literal["slices", "volume"] | None
    opening_angle_deg: float | None
    water_temperature_c: float | None
    nodes: int | None
    side_m: float | None
    iterations: int
    speed_bounds_mps: tuple[float, float]
    roi: bool
    device: Literal["auto", "cpu", "opencl"]
    seed: int
    resolution_check: bool
    uncertainty: bool
    minutes: float | None
    relaxation: float
    smoothing_nodes: float
    speed_range_mps: tuple[float, float] | None
    penalty: Literal["total-variation", "laplacian", "tikhonov"]
    penalty_strength: float
    edge_mps: float
    picker: PickerName
    examine: bool
    max_left_out: float
    attenuation: bool
    amplitudes: Literal["recorded", "ratio", "spectrum"]
    attenuation_solver: Literal["penalised", "sart"]
    focusing: bool
    reflection: bool
    delays: Literal["reconstructed", "water"]
    pixel_m: float | None
    pair_angle_deg: float
    coherence_factor: bool
    gain: Literal["none", "spreading", "attenuation"]


class SimulationSettings(TypedDict, total=False):
    """The settings of a simulated scan beside its phantom."""

    waveform: bool
    nodes: int
    elements: int
    coupling_mps: float
    snr: float | None
    seed: int
    refinement: int | None
    attenuation: bool | None
    noise_s: float | None
    slices: int | None
    array: Literal["moved", "rings"] | None
    three_d: bool | None
    frequency_hz: float | None
    emissions: int | None
    side_m: float | None


class RefractionSettings(TypedDict, total=False):
    """The settings of a refractive rendering of a volume."""

    iso: tuple[float, ...]
    index: tuple[float, ...]
    outside: float
    surroundings: int
    filter: str
    smoothing: float | None
    camera: Literal["orthographic", "perspective"]
    azimuth_deg: float
    elevation_deg: float
    zoom: float
    backdrop: Literal["checkerboard", "picture", "warped-checkerboard", "warped-picture"]
    squares: int
    backdrop_distance: float
    supersampling: Literal["none", "prss", "real"]
    degree: int
    ray_spacing: int
    fresnel: bool
    mode: Literal["refract", "shaded"]
    width: int
    height: int
    depth: int
    device: Literal["auto", "cpu", "opencl"]
