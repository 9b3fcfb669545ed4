"""The cache of compiled kernels survives changes of the types in its index."""

import pickle
from pathlib import Path

from bentray_kernels.compiled import kernel


@kernel
def double(x):
    return 2 * x


def test_an_index_with_an_unknown_type_counts_as_empty():
    index = double._cache._cache_file
    assert double(2) == 4
    stored = pickle.dumps(index._version)
    gone = b"cbentray_kernels.compiled\nNoSuchType\n."
    Path(index._index_path).write_bytes(stored + gone)
    assert index._load_index() == {}
    assert kernel(double.py_func)(3) == 6
