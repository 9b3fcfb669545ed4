"""Headers of NumPy's files, parsed by one thread at a time."""

from __future__ import annotations

import threading

# NumPy parses a header as a Python expression. CPython before 3.11.8 counts the depth of the trees of all
# threads together and raises SystemError where two parse at once (python/cpython#106905).
PARSING = threading.Lock()
