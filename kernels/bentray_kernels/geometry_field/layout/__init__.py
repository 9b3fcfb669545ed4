"""Flat layouts of surfaces: cutting, conformal maps, distortion."""
