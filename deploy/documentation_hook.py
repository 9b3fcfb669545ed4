"""Build hook of hatchling: the built documentation as a part of wheel and sdist.

It is the folder in BENTRAY_DOCUMENTATION, which `make release` sets. Without it a wheel has the pages as they
are written: built ones of an earlier commit could lie in build/docs. A wheel that is built from an sdist has
the pages of the sdist.
"""

import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLACE = "bentray_service/web/built_documentation"
WRITTEN = "bentray_service/web/written_documentation"
SHOWN = (".md", ".png")
# Of the pages as they are written: in a checkout, and in the image, whose folder docs holds built ones.
PLACES = ("docs", "written")


class DocumentationHook(BuildHookInterface[Any]):
    """Adds the built pages or, to a wheel, those that are written."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """See the module.

        Raises:
            FileNotFoundError: for a folder without a start page.
        """
        given, packed = os.environ.get("BENTRAY_DOCUMENTATION"), Path(self.root, "service", PLACE)
        if version == "editable":
            return
        if not (given or packed.is_dir()):
            docs = next(
                (one for one in map(Path(self.root).joinpath, PLACES) if (one / "conf.py").is_file()), None
            )
            if docs is None or self.target_name != "wheel":
                return
            pages = [path for path in docs.rglob("*") if path.suffix in SHOWN]
            for path in [*pages, *docs.glob("recipes/*.py")]:
                build_data["force_include"][str(path)] = f"{WRITTEN}/{path.relative_to(docs).as_posix()}"
            return
        folder = Path(self.root, given) if given else packed
        if not (folder / "index.html").is_file():
            raise FileNotFoundError(f"BENTRAY_DOCUMENTATION={given} has no index.html; make docs builds it")
        place = PLACE if self.target_name == "wheel" else f"service/{PLACE}"
        build_data["force_include"][str(folder)] = place
