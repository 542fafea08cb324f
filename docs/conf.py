"""Settings of the documentation site.

`python -m sphinx -W -b html docs site` builds it. Nothing in it is loaded from another host.
"""

from __future__ import annotations

import sys
from pathlib import Path

import uqpen

sys.path.insert(0, str(Path(__file__).parent))

import gallery
import reference_pages

sys.path.pop(0)  # the folder coverage would be numba's module of this name

project = "uqpen"
version = release = uqpen.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc", "sphinx_copybutton"]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext"}
# One page is a notebook and executed. Blocks of code on other pages are run by the tests
# (tests/test_documentation.py), not by the build.
nb_execution_mode = "force"
nb_execution_in_temp = True  # what a notebook writes
nb_execution_raise_on_error = True
nb_render_error_lexer = "text"  # a mistake is a message, not a traceback
# Links to a heading have the form that GitHub gives them.
myst_heading_anchors = 4

autodoc_typehints = "none"  # the docstrings have them
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

html_theme = "pydata_sphinx_theme"
html_title = "uqpen"
html_theme_options = {"secondary_sidebar_items": ["page-toc"], "show_toc_level": 2}
html_copy_source = False
html_show_sourcelink = False

reference_pages.write(Path(__file__).parent / "reference")
gallery.write(Path(__file__).parent / "reference" / "gallery")
