"""The settings of jobs as types, for editors and type checkers; written by ``setting_stubs``."""

from typing import Literal, TypedDict

from bentray_kernels.requests.names import DeviceRequest, PickerName, SolverName, UpAxis

Method = Literal["sart", "gauss-newton", "auto", "waveform"]
PhantomName = Literal["table6", "table6-vertical", "detailed", "breast", "table7"]

class ReconstructionSettings(TypedDict, total=False):
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
    resolution_check: bool
    uncertainty: bool | None
    minutes: float | None
    penalty_strength: float
    picker: PickerName
    examine: bool
    max_left_out: float
    attenuation: bool
    amplitudes: Literal["recorded", "ratio", "spectrum"]
    reflection: bool

class SimulationSettings(TypedDict, total=False):
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
    up: UpAxis
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
    device: DeviceRequest
