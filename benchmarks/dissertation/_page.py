"""The report as a page in HTML without outside requests: pictures are embedded as data URIs."""

import base64
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from ..shared._results_page import BASELINES, SIGNS, rounded

# Path of a picture by benchmark and file name; None where it is not at hand.
Find = Callable[[str, str], Path | None]

TEMPLATE = "report.html.j2"


def page(report: Mapping[str, Any], find: Find) -> str:
    """The whole page."""
    return _template().render(report=report, pictures=_embedded(report, find), whole=True)


def fragment(report: Mapping[str, Any], find: Find) -> str:
    """The content of the page, for a page of the documentation."""
    return _template().render(report=report, pictures=_embedded(report, find), whole=False)


@cache
def _template() -> Any:
    loader = FileSystemLoader(Path(__file__).parent)
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"rounded": rounded, "sign": SIGNS.__getitem__}
    environment.globals["baselines"] = BASELINES
    return environment.get_template(TEMPLATE)


def _embedded(report: Mapping[str, Any], find: Find) -> dict[str, str]:
    """Data URIs by file name; each picture once."""
    pictures: dict[str, str] = {}
    for chapter in report["chapters"]:
        for item in chapter["items"]:
            for picture in item["pictures"]:
                path = find(picture["benchmark"], picture["file"])
                if path is not None and path.is_file() and picture["file"] not in pictures:
                    coded = base64.b64encode(path.read_bytes()).decode()
                    pictures[picture["file"]] = f"data:image/png;base64,{coded}"
    return pictures
