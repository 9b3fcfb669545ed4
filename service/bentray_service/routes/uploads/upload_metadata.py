"""Metadata of an upload: from query parameters, the name of the file, or the metadata header of tus."""

import base64
import re
from collections.abc import Callable, Sequence
from email.message import Message
from typing import Any

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import SPACING_M
from bentray_kernels.requests.ranges import Range
from bentray_workers.files.dataset.counts import text

from ...ingest.ingest_process import ACCEPTED, FILE_NAME

LONGEST_TITLE = 200
# Nodes along an axis of a volume of raw bytes.
SIDE = Range(2, 2**31)
FORM = "names, each with its value in base 64, separated by commas"
KNOWN = (
    "kind",
    "title",
    "filename",
    "spacing_m",
    "shape",
    "dtype",
    "map",
    "unit",
    "temperature_c",
    "sound_speed_mps",
    "frequency_hz",
)

# Formats of text in requests, for the OpenAPI description. A space may follow a comma.
_PAIR = r"[!-+\--~]+( ([A-Za-z0-9+/]{4})*([A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?)?"
METADATA = f"^({_PAIR}(, ?{_PAIR})*)?$"
_DISTANCE = r"([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?"
SPACING = f"^{_DISTANCE}(, ?{_DISTANCE}, ?{_DISTANCE})?$"
NUMBER = r"[+-]?([0-9]{1,15}\.?[0-9]{0,15}|\.[0-9]{1,15})([eE][+-]?[0-9]{1,2})?"
_COUNT = r"[1-9][0-9]{0,9}"
SHAPE = f"^{_COUNT}, ?{_COUNT}, ?{_COUNT}$"


def read_metadata(header: str) -> tuple[str, dict[str, Any]]:
    """Parse the metadata header of tus.

    Args:
        header: e.g. ``kind bWVzaA==,title Tm9zZQ==``; unknown names may have any bytes as values.

    Returns:
        type of the result, and metadata for the ingest process.

    Raises:
        InvalidInput: for a wrong format or invalid values.
    """
    if not re.fullmatch(METADATA, header):
        raise InvalidInput("Upload-Metadata", repr(header[:80]), FORM)
    metadata = {}
    for pair in header.split(","):
        name, _, value = pair.strip().partition(" ")
        if name not in KNOWN:
            continue
        try:
            # The name of a file may have any bytes.
            errors = "replace" if name == "filename" else "strict"
            metadata[name] = base64.b64decode(value).decode(errors=errors)
        except UnicodeDecodeError:
            raise InvalidInput(
                "Upload-Metadata", repr(pair[:80]), f"{FORM}; the value of {name} is text"
            ) from None
    what = metadata.get("kind", "dataset")
    if what not in ACCEPTED:
        raise InvalidInput("Upload-Metadata kind", repr(what[:80]), " or ".join(ACCEPTED))
    title = metadata.get("title", "")[:LONGEST_TITLE]
    file = {FILE_NAME: named} if (named := file_name(metadata.get("filename", ""))) else {}
    if what == "mesh":
        return what, {"title": title, **file}
    if what == "volume":
        given = volume_metadata(
            title, metadata.get("spacing_m"), metadata.get("shape"), metadata.get("dtype")
        )
        return what, {**given, **file}
    variables, units = (metadata[name].split(",") if metadata.get(name) else [] for name in ("map", "unit"))
    temperature_c, sound_speed_mps, frequency_hz = (
        _number(name, metadata[name]) if metadata.get(name) else None
        for name in ("temperature_c", "sound_speed_mps", "frequency_hz")
    )
    stated = scan_metadata(variables, units, temperature_c, sound_speed_mps, frequency_hz)
    return what, {**stated, **file}


def name_of_body(disposition: str) -> str:
    """The name of a file in the header Content-Disposition of its upload; empty without one."""
    message = Message()
    # Headers are read as Latin-1; people and curl write UTF-8.
    message["Content-Disposition"] = disposition.encode("latin-1", "replace").decode(errors="replace")
    try:
        return file_name(message.get_filename(""))
    except (UnicodeError, ValueError):
        # An unusable character set of RFC 2231.
        return ""


def file_name(path: str) -> str:
    """The last part of a path of any system, printable."""
    return text(re.split(r"[/\\]", path)[-1].strip())


def scan_metadata(
    map: Sequence[str] = (),  # noqa: A002 - the name of the parameter of a request
    unit: Sequence[str] = (),
    temperature_c: float | None = None,
    sound_speed_mps: float | None = None,
    frequency_hz: float | None = None,
) -> dict[str, Any]:
    """Arguments of ``ScanMetadata.from_options`` that the user states about a scan; absent ones are left out.

    Raises:
        InvalidInput: as ``ScanMetadata.from_options``.
    """
    given: dict[str, Any] = {
        "map": list(map),
        "unit": list(unit),
        "temperature_c": temperature_c,
        "sound_speed_mps": sound_speed_mps,
        "frequency_hz": frequency_hz,
    }
    stated = {name: value for name, value in given.items() if value not in ([], None)}
    if stated:
        from bentray_workers.foreign_scans import ScanMetadata

        ScanMetadata.from_options(**stated)
    return stated


def _number(field: str, text: str) -> float:
    if not re.fullmatch(NUMBER, text):
        raise InvalidInput(field, repr(text[:40]), "a number")
    return float(text)


def volume_metadata(
    title: str, spacing_m: str | None, shape: str | None, dtype: str | None
) -> dict[str, Any]:
    """The metadata of a volume as arguments of ``volume_formats.VolumeMetadata``.

    Raises:
        InvalidInput: for values that are not numbers or out of range.
    """
    return {
        "title": title,
        "spacing_m": _numbers(
            "spacing_m", spacing_m, SPACING, float, SPACING_M, "0.001 or 0.001,0.001,0.002"
        ),
        "shape": _numbers("shape", shape, SHAPE, int, SIDE, "nx,ny,nz"),
        "dtype": dtype,
    }


def _numbers(
    field: str, text: str | None, form: str, kind: Callable[[str], float], within: Range, accepted: str
) -> list[float] | None:
    """Parse numbers separated by commas."""
    if text is None:
        return None
    if not re.fullmatch(form, text):
        raise InvalidInput(field, repr(text[:80]), accepted)
    numbers = [kind(number) for number in text.split(",")]
    for number in numbers:
        within.check(field, number)
    return numbers
