"""The benchmarks are a namespace package of the checkout, as `bentray bench` has them."""

import sys
from pathlib import Path

ROOT = str(Path(__file__).resolve().parents[2])

if ROOT not in sys.path:
    sys.path.insert(0, ROOT)
