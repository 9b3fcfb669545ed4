"""Programs that tests of packages run to their end."""

import subprocess
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def run(*command: str, folder: Path, variables: Mapping[str, str]) -> str:
    """The output of a program that succeeds, in a folder and with the environment variables given."""
    done = subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout
