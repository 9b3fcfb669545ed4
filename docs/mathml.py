"""Sphinx extension: formulas as MathML, which browsers draw without scripts, fonts or another host."""

from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number

log = logging.getLogger(__name__)

# Bars enclose; browsers would space them as operators.
BAR = '<mo stretchy="false">|</mo>'
TIGHT_BAR = '<mo stretchy="false" lspace="0" rspace="0">|</mo>'


def converted(text: str, *, block: bool) -> str:
    """A formula in LaTeX as MathML.

    Raises:
        MathError: for what the converter of docutils does not know or cannot parse.
    """
    # Lines are aligned at the ampersands, as mathjax does.
    if block and r"\\" in text and r"\begin" not in text:
        text = rf"\begin{{aligned}}{text}\end{{aligned}}"
    try:
        found = str(tex2mathml(text.strip(), as_block=block))
    except IndexError as error:
        raise MathError(f"incomplete: {error}") from error
    return found.replace(BAR, TIGHT_BAR)


def _shown(node: Any, *, block: bool) -> str:
    try:
        return converted(node.astext(), block=block)
    except MathError as error:
        log.warning("formula: %s in %s", error, node.astext(), location=node)
        return ""


def visit_math(self: Any, node: Any) -> None:
    """Within a line."""
    self.body.append(_shown(node, block=False))
    raise nodes.SkipNode


def visit_displaymath(self: Any, node: Any) -> None:
    """On lines of its own, with its number if it has one."""
    self.body.append(self.starttag(node, "div", CLASS="math"))
    if node["number"]:
        self.body.append(f'<span class="eqno">({get_node_equation_number(self, node)})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append(_shown(node, block=True) + "</div>\n")
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Register the renderer as ``mathml``."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_displaymath, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
