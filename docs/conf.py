"""Sphinx: the pages of this folder, and those that are drawn from the code when the site is built.

pip install '.[docs]'
python -m sphinx -W --keep-going docs build/site        # then open build/site/index.html
"""

import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "tests" / "tools")]

from cosim.support.version import __version__  # noqa: E402

project, author, release = "mount-cosim", "the authors of mount-cosim", __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build"]
html_theme, html_title = "furo", "mount-cosim"
html_static_path, html_css_files = ["static"], ["gallery.css"]
html_copy_source = html_show_copyright = html_show_sphinx = False
myst_heading_anchors = 3
default_role = "code"
autodoc_typehints, autodoc_member_order = "description", "bysource"
autodoc_default_options: dict[str, bool | str] = {"members": True, "exclude-members": "__init__,__new__"}
add_module_names = False
nitpicky = False
OUTSIDE = r"\[([^\]]+)\]\({up}([^)#]+)(?:#[^)]*)?\)"


def inside_the_site(app: Any, name: str, source: list[str]) -> None:
    """A link that leaves this folder leads to the source tree, which is not on the site: its path is said instead."""
    leaves = OUTSIDE.format(up=re.escape("../" * (name.count("/") + 1)))
    source[0] = re.sub(leaves, lambda link: f"{link[1]} (`{link[2]}` in the source)", source[0])


def draw(app: Any) -> None:
    """Write the gallery, and the list of pages that no list names yet."""
    from gallery import write_gallery

    folder = HERE / "_generated"
    write_gallery(folder)
    listed = set(re.findall(r"^([a-z_/]+)$", (HERE / "index.md").read_text("utf-8"), re.M))
    others = sorted(page.stem for page in HERE.glob("*.md") if page.stem not in listed | {"index"})
    text = "\n".join(["# Further pages", "", "```{toctree}", *(f"../{name}" for name in others), "```", ""])
    (folder / "further.md").write_text(text if others else "# Further pages\n\nThere are none.\n", "utf-8")


def setup(app: Any) -> None:
    """Called by Sphinx."""
    from pygments.lexers.special import TextLexer

    app.add_lexer("mermaid", TextLexer)  # drawn by code hosts, shown as text here: the site needs no network
    app.connect("source-read", inside_the_site)
    app.connect("builder-inited", draw)
