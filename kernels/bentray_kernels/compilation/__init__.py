"""Compiled kernels: decorator, cache on disk, atomics, single precision and thread teams."""
