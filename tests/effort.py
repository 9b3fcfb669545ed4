"""How much a test tries: a little for each change (`make test`), a lot at night (`make test-all`)."""

import os
from typing import TypeVar

Effort = TypeVar("Effort")

NIGHTLY = os.environ.get("HYPOTHESIS_PROFILE") == "nightly"


def effort(push: Effort, nightly: Effort) -> Effort:
    """Number that this run takes of the two."""
    return nightly if NIGHTLY else push
