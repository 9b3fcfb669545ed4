"""`make tables`: write the tables of the pages that come from the code."""

import sys
from pathlib import Path

from . import filled

for page in sorted(Path(__file__).parents[1].rglob("*.md")):
    text = page.read_text()
    if (new := filled(text)) != text:
        page.write_text(new)
        sys.stdout.write(f"{page.name}: written\n")
