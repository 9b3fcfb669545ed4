"""Slices of the 3-D breast phantom (Li 2008, Table 7): its skin varied, and scanned by waves in the plane."""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.phantoms.solids import Dome
from bentray_kernels.phantoms.table7 import SKIN_THICKNESS_M
from bentray_kernels.phantoms.volume import PhantomSlice, VolumePhantom
from bentray_workers.simulation.waves import WaveSimulationSettings

# 2.5 mm as in the phantom; one voxel of 128²; or fat up to the outline.
Skin = Literal["skin", "thin skin", "no skin"]

NODES = 128


def varied(coupling_mps: float, skin: Skin) -> VolumePhantom:
    """The phantom of Table 7, its skin as thick as stated.

    Args:
        coupling_mps: speed of the water, m/s.
        skin: see ``Skin``.
    """
    phantom = table7(coupling_mps)
    if skin == "skin":
        return phantom
    outline, fat, *rest = phantom.parts
    if skin == "no skin":
        filled = replace(outline, speed_mps=fat.speed_mps, attenuation_np_m=fat.attenuation_np_m)
        return replace(phantom, parts=(filled, fat, *rest))
    assert isinstance(fat.solid, Dome)
    a, b = fat.solid.semi_axes_m
    grown = SKIN_THICKNESS_M - TABLE7_SIDE_M / (NODES - 1)
    solid = replace(fat.solid, tip_m=fat.solid.tip_m + grown, semi_axes_m=(a + grown, b + grown))
    return replace(phantom, parts=(outline, replace(fat, solid=solid), *rest))


@dataclass(frozen=True)
class SliceWaves(WaveSimulationSettings):
    """A ring scan of one slice by 2-D waves, at the size of the phantom.

    Attributes:
        z_m: height of the slice, m.
        skin: see ``Skin``.
    """

    side_m: float = TABLE7_SIDE_M
    elements: int = 256
    nodes: int = NODES
    z_m: float = 0.0
    skin: Skin = "skin"

    phantom_side_m: ClassVar[float] = TABLE7_SIDE_M
    phantom_name: ClassVar[str] = "slice of the 3-D breast phantom (Li 2008, Table 7)"

    @property
    def phantom(self) -> PhantomSlice:
        """The slice."""
        return varied(self.coupling_mps, self.skin).at(self.z_m)
