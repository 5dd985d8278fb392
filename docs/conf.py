"""Sphinx: ``sphinx-build -W docs out/docs``."""

import nuno

project = "Nuno"
author = "The Nuno authors"
copyright = f"2026, {author}"
release = nuno.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["out"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_theme = "alabaster"
html_theme_options = {"description": "A simulator of deformable objects that lives inside a robot's own program"}

autodoc_member_order = "bysource"
autodoc_typehints = "none"
default_role = "code"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
