"""Build hook of hatchling: the built documentation as a part of wheel and sdist.

It is the folder in BENTRAY_DOCUMENTATION, which `make release` sets. Without it the packages have none: pages
of an earlier commit could lie in build/docs. A wheel that is built from an sdist has the pages of the sdist.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLACE = "bentray_service/web/built_documentation"


class DocumentationHook(BuildHookInterface[Any]):
    """Adds the folder, if there is one to add."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """See the module.

        Raises:
            FileNotFoundError: for a folder without a start page.
        """
        given, packed = os.environ.get("BENTRAY_DOCUMENTATION"), Path(self.root, "service", PLACE)
        if version == "editable" or not (given or packed.is_dir()):
            return
        folder = Path(self.root, given) if given else packed
        if not (folder / "index.html").is_file():
            raise FileNotFoundError(f"BENTRAY_DOCUMENTATION={given} has no index.html; make docs builds it")
        place = PLACE if self.target_name == "wheel" else f"service/{PLACE}"
        build_data["force_include"][str(folder)] = place
