"""Dataset files in the upload format ``uct-transmission`` 1.0."""

from .copy import Correction, copy_dataset, correct_dataset
from .read import read_dataset
from .write import write_dataset

__all__ = ["Correction", "copy_dataset", "correct_dataset", "read_dataset", "write_dataset"]
