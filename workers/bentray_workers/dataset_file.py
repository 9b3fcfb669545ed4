"""Datasets as files in the upload format ``uct-transmission`` 1.0."""

from .dataset_copying import copy_dataset
from .dataset_reading import read_dataset
from .dataset_writing import write_dataset
from .hdf5_reading import Limits

__all__ = ["Limits", "copy_dataset", "read_dataset", "write_dataset"]
