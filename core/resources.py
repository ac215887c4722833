"""What the program brings along: help, fonts, templates, reference values, command profiles.

The folder is `resources` in a checkout, and `stripe_resources` where the program is installed: a name in the whole
environment should say whose it is.
"""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path

__all__ = ["resource", "user_cache"]


def resource(*parts: str) -> Path:
    """Give the place of a file or folder of the resources.

    Examples
    --------
    >>> resource("fonts", "DejaVuSans.ttf").is_file()
    True
    """
    return _folder().joinpath(*parts)


def user_cache() -> Path | None:
    """Give the user's folder of what is only there to save time; none where the system knows no home of the user."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    return base / "stripe-workbench" if base.is_absolute() else None


def _folder() -> Path:
    if getattr(sys, "frozen", False):
        return Path(sys._MEIPASS) / "stripe_resources"  # type: ignore[attr-defined]
    root = Path(__file__).parents[1]
    if (root / "pyproject.toml").is_file():
        return root / "resources"
    found = find_spec("stripe_resources")
    if found is None or found.origin is None:
        raise FileNotFoundError(root / "stripe_resources")
    return Path(found.origin).parent
