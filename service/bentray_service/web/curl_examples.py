"""Examples of the OpenAPI description: each operation by curl, and the address of the service."""

import json
import shlex
from pathlib import PurePosixPath
from typing import Any

ADDRESS = "http://127.0.0.1:8000"
SERVERS = [
    {
        "url": "{address}",
        "description": "The service, with its path in front where a proxy gives it one.",
        "variables": {"address": {"default": ADDRESS, "description": "As `bentray serve` prints it."}},
    }
]
# Of the path parameters that are not called as the beginning of their ids, and the files of uploads.
IDS: dict[str, str] = {"dataset_id": "ds", "volume_id": "vol"}
FILES = {"/v1/datasets": "scan.h5", "/v1/volumes": "volume.nii.gz", "/v1/meshes": "mesh.obj"}
# Values of required parameters that have no default.
VALUES: dict[str, Any] = {"upload-length": 104857600, "upload-offset": 0}


def add_examples(document: dict[str, Any]) -> None:
    """Add ``servers``, and ``x-codeSamples`` to each operation."""
    document["servers"] = SERVERS
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            source = _curl(method, path, operation)
            operation["x-codeSamples"] = [{"lang": "Shell", "label": "curl", "source": source}]


def _curl(method: str, path: str, operation: dict[str, Any]) -> str:
    """One line that sends the request; of several bodies the first."""
    words = ["curl"]
    for parameter in operation.get("parameters", ()):
        name, schema = parameter["name"], parameter["schema"]
        value = VALUES.get(name, schema.get("const"))
        if parameter["in"] == "path":
            path = path.replace(f"{{{name}}}", f"{IDS.get(name, name.removesuffix('_id'))}-…")
        elif parameter.get("required"):
            words += ["-H", f"{name.title()}: {value}"]
    content = operation.get("requestBody", {}).get("content", {})
    media = next(iter(content), "")
    body: dict[str, Any] = content.get(media, {})
    if "examples" in body:
        example = next(iter(body["examples"].values()))["value"]
        words += ["-H", f"Content-Type: {media}", "-d", json.dumps(example, ensure_ascii=False)]
    elif media:
        # The service recognises a file by its content; a piece of one it does not.
        words += [] if path in FILES else ["-H", f"Content-Type: {media}"]
        words += ["--data-binary", f"@{FILES.get(path, 'piece')}"]
    answer = operation["responses"].get("200", {}).get("content", {})
    if "text/event-stream" in answer:
        words += ["-N"]
    elif answer and not {"application/json", "text/plain"} & set(answer):
        words += ["-o", _output(path, next(iter(answer)))]
    if method != ("post" if content else "get"):
        words += ["-X", method.upper()]
    return shlex.join([*words, ADDRESS + path])


def _output(path: str, media: str) -> str:
    """The name of the file that an answer is written to."""
    name = PurePosixPath(path).name
    endings = {"application/x-hdf5": ".h5", "application/x-npy": ".npy", "application/zip": ".zip"}
    return name if "." in name else name + endings[media]
