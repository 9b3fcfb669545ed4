"""Compiled kernels: made ready for an image, and loaded before a worker's first task."""
