"""How Sphinx builds the reference and the gallery: `make docs` copies this folder to build/docs-source first."""

from __future__ import annotations

import importlib
import inspect
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).parent
PUBLIC = (  # rooms whose names other programs may use, in the order of the road
    "api",
    "model",
    "patterns",
    "geometry",
    "project",
    "devices",
    "capture",
    "decode",
    "measure",
    "calibrate",
    "reconstruct",
    "evaluate",
    "checks",
    "orient",
    "report",
    "exchange",
    "pipeline",
    "bench",
    "progress",
    "errors",
)

project = "Stripe workbench"
author = "the stripe workbench's authors"
release = version = version_of("stripe-workbench")
extensions = ["sphinx.ext.autodoc", "sphinx.ext.mathjax", "numpydoc", "sphinx_gallery.gen_gallery"]
exclude_patterns = ["examples", "extending"]  # their pages are made from what ran
html_theme = "alabaster"
html_theme_options = {"description": "camera, projector, stripes", "page_width": "1100px", "sidebar_width": "220px"}
html_static_path: list[str] = []
numpydoc_show_class_members = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
python_maximum_signature_line_length = 88
suppress_warnings = ["config.cache"]
sphinx_gallery_conf = {
    "examples_dirs": ["examples", "extending"],
    "gallery_dirs": ["auto_examples", "auto_extending"],
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "within_subsection_order": "FileNameSortKey",
    "remove_config_comments": True,
}


def names_of(module: str) -> list[str]:
    """Give the public names of a room."""
    found = importlib.import_module(f"core.{module}")
    listed = getattr(found, "__all__", None)
    if listed is None:
        own = (n for n, o in vars(found).items() if getattr(o, "__module__", "") == f"core.{module}")
        listed = [name for name in own if not name.startswith("_")]
    return sorted(listed, key=str.lower)


def page_of(module: str) -> str:
    """Write the page of a room: its docstring, then every name."""
    found, title = importlib.import_module(f"core.{module}"), f"core.{module}"
    lines = [title, "=" * len(title), "", f".. module:: core.{module}", ""]
    lines += [inspect.getdoc(found).splitlines()[0], ""]  # type: ignore[union-attr]
    for name in names_of(module):
        thing = getattr(found, name)
        if inspect.isclass(thing):
            lines += [f".. autoclass:: core.{module}.{name}", "   :members:", ""]
        elif callable(thing) and inspect.isroutine(thing):
            lines += [f".. autofunction:: core.{module}.{name}", ""]
        else:
            lines += [f".. py:data:: core.{module}.{name}", f"   :type: {type(thing).__name__}", ""]
    return "\n".join(lines)


def write_pages(_app: object) -> None:
    """Write a page for every room."""
    (HERE / "api").mkdir(exist_ok=True)
    for module in PUBLIC:
        (HERE / "api" / f"{module}.rst").write_text(page_of(module), encoding="utf-8")
    listed = "\n".join(f"   {module}" for module in PUBLIC)
    text = f"Reference\n=========\n\nEvery public name, room by room.\n\n.. toctree::\n   :maxdepth: 1\n\n{listed}\n"
    (HERE / "api" / "index.rst").write_text(text, encoding="utf-8")


def setup(app: object) -> None:
    """Hook into Sphinx."""
    app.connect("builder-inited", write_pages, priority=1)  # type: ignore[attr-defined]
