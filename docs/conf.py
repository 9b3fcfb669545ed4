"""Sphinx configuration of the documentation; `make docs` treats warnings as errors."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "Bentray"
author = "The Bentray founders"
release = version = version_of("bentray")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "from_code",
]
source_suffix = {".md": "markdown"}
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3

html_theme = "furo"
html_title = f"Bentray {release}"
html_favicon = "../service/bentray_service/web/static/icon.svg"
html_copy_source = False
html_show_sphinx = False

# A name in single backticks is code, as in the docstrings.
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_class_signature = "separated"
python_use_unqualified_type_names = True
