"""Help beside the work: the chapters of `resources/help`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt, QUrl, Signal
from PySide6.QtGui import QDesktopServices, QImage, QTextDocument
from PySide6.QtWidgets import QTextBrowser, QVBoxLayout, QWidget

from core.resources import resource
from stripe_gui import theme
from stripe_gui.widgets.layout import label, row, tool

WIDTH = 320  # px, as little as a chapter's tables take


def help_file(topic: str, language: str = "en") -> Path | None:
    """Give a chapter, in the operator's language where it has been translated; None where there is none."""
    for folder in (resource("help", language), resource("help")):
        if (folder / f"{topic}.md").is_file():
            return folder / f"{topic}.md"
    return None


class HelpText(QTextBrowser):
    """A chapter whose pictures are as wide as the panel."""

    def loadResource(self, kind: int, name: QUrl | str) -> Any:  # noqa: N802
        if kind != QTextDocument.ResourceType.ImageResource.value:
            return super().loadResource(kind, name)
        place = QUrl(name).path()
        found = (Path(folder) / place for folder in self.searchPaths())
        image = QImage(str(next((path for path in found if path.is_file()), "")))
        if image.isNull():
            return super().loadResource(kind, name)
        ratio = self.devicePixelRatioF()
        beside = 2 * self.frameWidth() + self.verticalScrollBar().sizeHint().width()
        width = self.width() - beside - 2 * self.document().documentMargin()
        image = image.scaledToWidth(round(ratio * max(width, 100.0)), Qt.TransformationMode.SmoothTransformation)
        image.setDevicePixelRatio(ratio)
        return image


class HelpPanel(QWidget):
    """One chapter at a time; links lead to other chapters."""

    closed = Signal()

    def __init__(self, language: str = "en") -> None:
        super().__init__()
        self._language = language
        self.setMinimumWidth(WIDTH)
        self.setAccessibleName(self.tr("Help"))
        self.browser = HelpText()
        self.browser.setOpenLinks(False)
        self.browser.setAccessibleName(self.tr("Help text"))
        self.browser.anchorClicked.connect(self._follow)
        self.browser.document().setDocumentMargin(14)
        # all of it wraps; Qt takes the margin beside a table for text
        self.browser.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        close = tool("close", self.tr("Close help"), self.closed.emit)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(4, 16, 16, 12)
        layout.addLayout(row(label(self.tr("Help"), "heading"), None, close))
        layout.addWidget(self.browser, 1)

    def show_topic(self, topic: str) -> None:
        """Show a chapter; a page without one gets the first."""
        file = help_file(topic, self._language) or help_file("index", self._language)
        if file is None:
            self.browser.setPlainText(self.tr("There is no help for this page."))
            return
        self.browser.setSearchPaths([str(file.parent), str(resource("help"))])
        self.browser.document().setDefaultStyleSheet(f"a {{ color: {theme.current().accent}; }}")
        self.browser.setMarkdown(file.read_text(encoding="utf-8"))
        self.browser.verticalScrollBar().setValue(0)

    def _follow(self, url: QUrl) -> None:
        if url.isRelative():
            name = Path(url.path()).stem
            if name:
                self.show_topic(name)
            elif url.hasFragment():
                self.browser.scrollToAnchor(url.fragment())
        else:
            QDesktopServices.openUrl(url)
