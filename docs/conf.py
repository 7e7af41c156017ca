"""Settings of the documentation: `make docs` builds it, without a network.

The pages of the topics lie beside this file, for reading in the repository as well; the gallery is made by running
`examples/`, the pictures of the algorithm and of the dependencies by the scripts in `docs/pictures/`.
"""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE / "pictures")]

os.environ.setdefault("MPLBACKEND", "Agg")
warnings.filterwarnings("ignore", message="FigureCanvasAgg is non-interactive")

import site_pages  # noqa: E402  the pages that are written by the code itself
from site_gallery import figure_scraper  # noqa: E402
from sphinx.application import Sphinx  # noqa: E402

import mirrorfold  # noqa: E402

project = "mirrorfold"
author = "The mirrorfold developers"
project_copyright = author
version = release = mirrorfold.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "_templates", "pictures", "**/README.md", "gallery/**/*.ipynb", "gallery/**/*.py"]
templates_path = ["_templates"]
default_role = "code"  # backticks mean names, in docstrings and in the gallery
suppress_warnings = [
    "config.cache",  # the gallery's scraper is a function
]

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"  # the docstrings give shapes and units beside the types
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"[\\/]plot_",
    "image_scrapers": (figure_scraper,),
    "reset_modules": (),
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "remove_config_comments": True,
    "capture_repr": (),
    "show_signature": False,
    "show_memory": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "thumbnail_size": (640, 440),
    "plot_gallery": "True",
    "abort_on_example_error": False,
    "only_warn_on_example_error": True,  # and warnings are errors
    "parallel": False,
}

html_theme = "pydata_sphinx_theme"
html_title = "mirrorfold"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_context = {"default_mode": "auto"}
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {"text": "mirrorfold"},
    "show_prev_next": False,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
    "show_toc_level": 2,
    "navigation_with_keys": False,
}
html_sidebars = {"quickstart": [], "index": [], "performance": []}


def setup(app: Sphinx) -> None:
    """Write the pages that are made from the code, before Sphinx looks for sources."""
    site_pages.write(HERE)
    app.connect("source-read", lambda app, name, source: source.append(site_pages.to_the_gallery(source.pop())))
