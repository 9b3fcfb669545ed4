"""docker-compose.yml as a test reads it: variables filled in, commands and environment of each part."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "docker-compose.yml"

# ${NAME:-default}; our file gives every variable a default.
VARIABLE = re.compile(r"\$\{(\w+):-([^}]*)\}")


def read() -> dict[str, Any]:
    """The whole file, with the default of every variable in its place."""
    found: dict[str, Any] = yaml.safe_load(VARIABLE.sub(r"\2", FILE.read_text()))
    return found


def variables() -> set[str]:
    """The names of the variables that the file takes from the environment."""
    return {name for name, _ in VARIABLE.findall(FILE.read_text())}
