"""Software bill of materials of a release in CycloneDX 1.6: ``python deploy/sbom.py`` prints it as JSON."""

import json
import os
import re
import sys
import tomllib
import uuid
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PINNED = re.compile(r"^([A-Za-z0-9._-]+)==(\S+)(?: ; (.+?))? \\$", re.MULTILINE)
OF_LICENCE = "License :: OSI Approved :: "


def bill(seconds: int) -> dict[str, Any]:
    """The bill: Bentray, and every package of requirements.lock with its licence.

    Args:
        seconds: time of the release, s since 1970; the same time gives the same bytes.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    own = _component("application", project["name"], project["version"])
    own["licenses"] = [{"license": {"id": project["license"]}}]
    libraries = list(_libraries())
    direct = {normal(re.split(r"[^A-Za-z0-9._-]", one)[0]) for one in project["dependencies"]}
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": uuid.uuid5(uuid.NAMESPACE_URL, json.dumps([own, libraries, seconds])).urn,
        "version": 1,
        "metadata": {
            "timestamp": f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%SZ}",
            "component": own,
        },
        "components": libraries,
        "dependencies": [
            {
                "ref": own["bom-ref"],
                "dependsOn": [one["bom-ref"] for one in libraries if one["name"] in direct],
            }
        ],
    }


def normal(name: str) -> str:
    """The name of a package as the packaging standards compare names."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _libraries() -> Iterator[dict[str, Any]]:
    for name, version, marker in PINNED.findall((ROOT / "requirements.lock").read_text()):
        library = _component("library", normal(name), version)
        licence = _licence(name)
        if licence is not None:
            library["licenses"] = [licence]
        if marker:
            library["properties"] = [{"name": "bentray:installed-where", "value": marker}]
        yield library


def _component(kind: str, name: str, version: str) -> dict[str, Any]:
    address = f"pkg:pypi/{name}@{version}"
    return {"type": kind, "bom-ref": address, "name": name, "version": version, "purl": address}


def _licence(name: str) -> dict[str, Any] | None:
    """As the installed package states it; None if it is not installed here or states none."""
    try:
        stated = metadata(name)
    except PackageNotFoundError:
        return None
    if "License-Expression" in stated:
        return {"expression": stated["License-Expression"]}
    named = [one.removeprefix(OF_LICENCE) for one in stated.get_all("Classifier", []) if OF_LICENCE in one]
    text = " or ".join(named) or (stated.get("License") or "").partition("\n")[0].strip()
    return {"license": {"name": text}} if text else None


if __name__ == "__main__":
    released = int(os.environ.get("SOURCE_DATE_EPOCH") or datetime.now(UTC).timestamp())
    json.dump(bill(released), sys.stdout, indent=2)
    sys.stdout.write("\n")
