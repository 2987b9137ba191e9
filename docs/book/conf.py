"""How Sphinx builds the book. `build.py` copies this file beside the pages."""

import re

from latex2mathml.converter import convert

project = "driftmesh"
author = "The driftmesh developers"
project_copyright = author
extensions = ["myst_parser"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # `page.md#a-heading` works as it does where Markdown is read unbuilt
html_theme = "furo"
html_title = "driftmesh"
html_math_renderer = "mathml"
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_static_path = ["_static"]
html_css_files = ["book.css"]
# Some blocks are parts of files, or have an ellipsis, which is not in their language.
suppress_warnings = ["misc.highlighting_failure"]


def mathml(latex, display):
    """An equation as MathML, which browsers draw without a script or a font from elsewhere."""
    return re.sub(r"\s+", " ", convert(latex, display=display))


def inline(writer, node):
    """Writes an equation in a line of text."""
    from docutils.nodes import SkipNode

    writer.body.append(mathml(node.astext(), "inline"))
    raise SkipNode


def displayed(writer, node):
    """Writes an equation in a line of its own."""
    from docutils.nodes import SkipNode

    writer.body.append(f'<div class="equation">{mathml(node.astext(), "block")}</div>\n')
    raise SkipNode


def setup(app):
    """Registers the renderer of equations."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
