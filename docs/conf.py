"""Sphinx configuration of the documentation; `make docs` treats warnings as errors."""

import os
import re
import shutil
import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
# The gallery draws without a screen, and shows no progress bars on the terminal that builds it.
os.environ |= {"MPLBACKEND": "agg", "TTY_COMPATIBLE": "0"}

project = "Bentray"
author = "The Bentray founders"
copyright = f"{author}, BSD-3-Clause"  # noqa: A001 - the name of Sphinx
release = version = version_of("bentray")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "shared_scans",
    "notebook_titles",
    "sphinx_gallery.gen_gallery",
    "from_code",
    "mathml",
    "offline",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["recipes", "templates"]
templates_path = ["templates"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
math_number_all = False
html_math_renderer = "mathml"

html_theme = "furo"
html_title = f"Bentray {release}"
html_favicon = "../service/bentray_service/web/static/icon.svg"
html_static_path = ["static"]
html_css_files = ["pages.css"]
html_copy_source = False
html_show_sphinx = False

# A name in single backticks is code, as in the docstrings.
default_role = "code"
# A page for each object of the Python reference, in reference/api.
autosummary_generate = True
autosummary_imported_members = True
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_class_signature = "separated"
python_use_unqualified_type_names = True
python_display_short_literal_types = True

# The gallery: each file of recipes/ is executed, and becomes a page and a notebook. Recipes write files
# beside themselves, so copies of them are executed.
RECIPES = Path(__file__).parents[1] / "build" / "recipes"
shutil.rmtree(RECIPES, ignore_errors=True)
shutil.copytree(Path(__file__).parent / "recipes", RECIPES)
sphinx_gallery_conf = {
    "examples_dirs": str(RECIPES),
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "plot_gallery": "True",
    "abort_on_example_error": True,
    "only_warn_on_example_error": False,
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "within_subsection_order": "FileNameSortKey",
    "copyfile_regex": "",
    "image_scrapers": ("matplotlib",),
    "matplotlib_animations": False,
    "thumbnail_size": (400, 280),
}


def _with_short_types(
    app: object, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Show the types of attributes, which napoleon writes in full, by their last names."""
    lines[:] = [
        re.sub(r"(?<![~.\w])(?:\w+\.)+\w+", r"~\g<0>", line) if line.lstrip().startswith(":type:") else line
        for line in lines
    ]


def setup(app: Any) -> None:
    """Connect the function above, after that of napoleon."""
    app.connect("autodoc-process-docstring", _with_short_types, priority=900)
