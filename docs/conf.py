"""The site of the documentation: ``sphinx-build -W -n docs build/site``, without a network."""

import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

sys.path.insert(0, str(Path(__file__).parent))
import gallery

from symgen.version import __version__

project = "symgen"
author = "the symgen authors"
copyright = author
version = release = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc"]
numpydoc_show_class_members = False
autodoc_typehints_format = "short"
autodoc_member_order = "groupwise"
autodoc_default_options = {"exclude-members": "MISSING, KIND"}
autodoc_preserve_defaults = True
autodoc_type_aliases = {"Array": "Array", "ArrayLike": "ArrayLike"}
nb_execution_mode = "force"  # the notebooks are kept without results
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # the anchors that repository browsers give to headings

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = f"symgen {version}"
html_math_renderer = "mathml"
html_show_copyright = False


def inline_mathml(self: HTML5Translator, node: nodes.math) -> None:
    """Write an equation within a line as MathML, which browsers draw without a script."""
    self.body.append(mathml(node, "inline"))
    raise nodes.SkipNode


def displayed_mathml(self: HTML5Translator, node: nodes.math_block) -> None:
    """Write a displayed equation as MathML."""
    self.body.append(f'<div class="math">{mathml(node, "block")}</div>')
    raise nodes.SkipNode


def mathml(node: nodes.Element, display: str) -> str:
    """Return an equation as MathML; a command that the converter does not know is a warning."""
    drawn = convert(node.astext(), display=display)
    if unknown := re.search(r"\\\w+", drawn):
        logging.getLogger(__name__).warning("unknown LaTeX: %s", unknown[0], location=node)
    return drawn


#: Pages of the site that include files above this folder.
INCLUDED = {"README": "index", "CHANGELOG": "changelog", "CONTRIBUTING": "contributing"}


def link_files_above(app: Sphinx, page: str, source: list[str]) -> None:
    """Link a file above this folder by its page if it has one, otherwise as a download."""

    def target(found: re.Match[str]) -> str:
        name = found[1]
        return f"]({INCLUDED[name]}.md" if name in INCLUDED else f"](path:../{name}.md"

    source[0] = re.sub(r"\]\(\.\./([\w/]+)\.md", target, source[0])


def link_types(app: Sphinx, env: BuildEnvironment, node: nodes.Element, shown: nodes.Element) -> Any:
    """Link a type in a signature by its short name, if it is documented; other types stay plain text."""
    if node["refdomain"] != "py" or "refexplicit" in node:  # a role of a page or of a docstring
        return None
    python, name = env.domains.python_domain, node["reftarget"].rpartition(".")[2]
    for full in (f"symgen.{name}", *(o for o in python.objects if o.endswith(f".{name}"))):
        if full in python.objects and python.objects[full].objtype == "class":
            return python.resolve_xref(env, node["refdoc"], app.builder, "class", full, node, shown)
    return shown


def write_gallery(app: Sphinx) -> None:
    """Run, draw and describe all shipped scenes."""
    gallery.write(app.srcdir / "gallery", app.outdir / "gallery")


def setup(app: Sphinx) -> None:
    """Register equations as MathML, links of types and of files above this folder, and the gallery."""
    app.connect("builder-inited", write_gallery)
    app.add_html_math_renderer("mathml", (inline_mathml, None), (displayed_mathml, None))
    app.connect("missing-reference", link_types)
    app.connect("source-read", link_files_above)
