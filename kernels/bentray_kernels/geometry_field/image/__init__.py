"""Geometry images: a surface as a square image, and a mesh again."""
