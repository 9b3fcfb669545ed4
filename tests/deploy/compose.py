"""docker-compose.yml as a test reads it: variables filled in, commands and environment of each part."""

import re
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "docker-compose.yml"
TLS = ROOT / "deploy" / "tls.yml"

# ${NAME:-default}; our file gives every variable a default.
VARIABLE = re.compile(r"\$\{(\w+):-([^}]*)\}")


def read(*overrides: Path) -> dict[str, Any]:
    """The whole file with the default of every variable in its place, and on top of it the overrides."""
    result: dict[str, Any] = yaml.safe_load(VARIABLE.sub(r"\2", FILE.read_text()))
    for path in overrides:
        result = _merged(result, yaml.safe_load(VARIABLE.sub(r"\2", path.read_text())))
    return result


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Merge by the rules of compose: mappings key by key, secrets are joined, all else is replaced."""
    result = dict(below)
    for name, value in above.items():
        base = below.get(name)
        if isinstance(value, dict) and isinstance(base, dict):
            result[name] = _merged(base, value)
        else:
            result[name] = [*base, *value] if name == "secrets" and isinstance(base, list) else value
    return result


def variables() -> set[str]:
    """The names of the variables that the file takes from the environment."""
    return {name for name, _ in VARIABLE.findall(FILE.read_text())}
