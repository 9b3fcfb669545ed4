"""Headers of NumPy's files, parsed by one thread at a time."""

import threading
from typing import IO, Any

import numpy as np

# Header before the values of a file.
LONGEST_HEADER = 2**20

# NumPy parses a header as a Python expression. CPython before 3.11.8 counts the depth of the trees of all
# threads together and raises SystemError where two parse at once (python/cpython#106905). A thread may parse
# several headers of an archive that it keeps to itself.
PARSING = threading.RLock()


def read_header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether the first axis varies fastest, and type of an array; ``file`` is then at its values.

    Raises:
        ValueError: for another file, and for the version of the format that NumPy writes for names of fields.
    """
    version = np.lib.format.read_magic(file)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        raise ValueError(f"NumPy's format {version}, not 1.0 or 2.0, as numpy.save writes numbers")
    with PARSING:
        shape, fortran, dtype = readers[version](file, max_header_size=LONGEST_HEADER)
    return tuple(int(n) for n in shape), bool(fortran), dtype
