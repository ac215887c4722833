"""The pages of the window, one a file; `PAGES` names them in the order of the road.

A new page: a subclass of `Page` in its own file, and its name here.
"""

from stripe_gui.pages.capture_page import CapturePage
from stripe_gui.pages.decode_page import DecodePage
from stripe_gui.pages.page import Page
from stripe_gui.pages.start_page import StartPage

PAGES: tuple[type[Page], ...] = (StartPage, CapturePage, DecodePage)

__all__ = ["PAGES", "Page"]
