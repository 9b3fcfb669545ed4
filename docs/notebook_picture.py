"""Generate the picture of the ten-line start in a notebook: `.venv/bin/python docs/notebook_picture.py`.

The first recipe of the gallery is executed as the notebook that readers download, by Jupyter's kernel. This
needs the tools for tests and documentation, Debian's Chromium and `pip install -e ".[notebook]"`. The lock
files leave the last out: it would bring a hundred packages for one picture.
"""

import copy
import io
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

import nbformat
import notebook_titles
from browser import browser
from nbclient import NotebookClient
from nbconvert import HTMLExporter
from PIL import Image
from sphinx_gallery.notebook import python_to_jupyter_cli

RECIPE = Path(__file__).parent / "recipes" / "01_first_image.py"
PICTURE = Path(__file__).parent / "pictures" / "notebook.png"
BAR = re.compile(r'Reconstructing <progress value="(\d+)" max="(\d+)"')
# Of each of the two pictures side by side, pixels.
WIDTH = 800


class Recorder(NotebookClient):
    """Executes a notebook, and keeps it as it is while a progress bar is drawn."""

    def __init__(self, notebook: Any, **options: Any) -> None:
        super().__init__(notebook, **options)
        self.running: list[tuple[float, int, Any]] = []

    def process_message(self, msg: Any, cell: Any, cell_index: int) -> Any:
        """Process a message of the kernel; at a progress bar, copy the notebook."""
        made = super().process_message(msg, cell, cell_index)
        if msg["msg_type"] == "update_display_data" and (bar := BAR.search(str(msg["content"]["data"]))):
            self.running.append((int(bar[1]) / int(bar[2]), cell_index, copy.deepcopy(self.nb)))
        return made


def recorded() -> tuple[int, Any, Any]:
    """The number of the cell that reconstructs, the notebook during it, and the complete notebook."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(RECIPE, folder)
        python_to_jupyter_cli([str(Path(folder) / RECIPE.name)])
        notebook = nbformat.read(Path(folder) / f"{RECIPE.stem}.ipynb", as_version=4)
        recorder = Recorder(notebook, resources={"metadata": {"path": folder}})
        recorder.execute()
    if not recorder.running:
        raise SystemExit("no progress bar was drawn")
    _, cell, running = max(recorder.running, key=lambda one: one[0] * (one[0] < 1))
    return cell, running, notebook


def picture() -> Image.Image:
    """The notebook down to the running reconstruction, beside the rest when it is complete."""
    cell, running, complete = recorded()
    with browser((WIDTH, 1000)) as page:
        # The pages of nbconvert load scripts of other hosts, which these do not need.
        page.route("**", lambda route: route.abort())
        shots = [_shot(page, running, 0, cell), _shot(page, complete, cell, len(complete.cells) - 1)]
    both = Image.new("RGB", (2 * WIDTH, max(one.height for one in shots)), "white")
    for k, one in enumerate(shots):
        both.paste(one, (k * WIDTH, 0))
    return both


def _shot(page: Any, notebook: Any, first: int, last: int) -> Image.Image:
    """Some cells of a notebook."""
    page.set_content(HTMLExporter(template_name="lab").from_notebook_node(notebook)[0])
    begin, end = (page.locator(".jp-Cell").nth(number).bounding_box() for number in (first, last))
    clip = {"x": 0, "y": begin["y"], "width": WIDTH, "height": end["y"] + end["height"] - begin["y"]}
    return Image.open(io.BytesIO(page.screenshot(full_page=True, clip=clip))).convert("RGB")


if __name__ == "__main__":
    # As the documentation does: pages by their titles.
    notebook_titles.setup(None)
    picture().save(PICTURE, optimize=True)
