"""Dask tasks of Bentray: files and slices in, checkpoints, volumes and images out."""
