"""What the viewers share: the captures to the left, a choice of maps, and the map of the chosen capture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QWidget

from stripe_gui.pages.page import Page
from stripe_gui.presenters.maps import MapView
from stripe_gui.widgets.capture_list import CaptureList
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, choice, column, fit_button, label, refill, row, splitter
from stripe_gui.workbench import Workbench


class MapPage(Page):
    """A viewer of maps; the chosen kind of map stays from capture to capture.

    A subclass calls `lay_out` in its constructor, looks at the session's capture in `look`, and shows maps by
    `show_map`; `choose` is called when the operator wants another kind.
    """

    def __init__(self, bench: Workbench, title: str, purpose: str, map_name: str) -> None:
        super().__init__(bench, title, purpose)
        self.captures = CaptureList(bench.session)
        self.kind = choice(self.tr("Map"), self.choose, minimumWidth=150)
        self.kind.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.view = ImageView(map_name)
        self.state = label("", "muted", wrap=True)
        self.state.setHidden(True)
        bench.session.capture_changed.connect(self._capture_changed)

    def lay_out(self, middle: QWidget, *, before: Sequence[QWidget] = (), below: Sequence[QWidget] = ()) -> None:
        """Put the captures, with what is `below` them, beside what holds the map.

        What stands `before` the choice of maps is in one row with it, and leaves no room for its name.
        """
        top = row(*(before or (label(self.tr("Map")),)), self.kind, None, fit_button(self.fit))
        left = column(label(self.tr("Captures"), "heading"), self.captures, *below, spacing=8)
        self.body.addWidget(splitter(boxed(left), boxed(column(top, middle)), widest=1), 1)

    def offer(self, kinds: Sequence[str], name_of: Callable[[str], str]) -> None:
        """Offer kinds of maps; the one chosen stays where it can."""
        refill(self.kind, [(name_of(kind), kind) for kind in kinds], self.kind.currentData())

    def show_map(self, view: MapView | None, extra: Callable[[int, int], str] | None = None) -> None:
        if view is None:
            self.view.set_image(None)
            return
        self.view.set_image(
            view.image,
            view.levels,
            scale=view.scale,
            unit=view.unit,
            digits=view.digits,
            extra=extra,
            colours=view.colours,
        )

    def parts(self) -> Iterator[str]:
        """Show one kind of map after the other, and name it."""
        yield ""
        for i in range(1, self.kind.count()):
            self.kind.setCurrentIndex(i)
            yield f"-{self.kind.currentData()}"
        self.kind.setCurrentIndex(0)

    def fit(self) -> None:
        self.view.fit()

    def say(self, text: str, *, rich: bool = False) -> None:
        """Tell the state of the map in a line, `rich` with tags; none where there is nothing to tell."""
        self.state.setTextFormat(Qt.TextFormat.RichText if rich else Qt.TextFormat.PlainText)
        self.state.setText(text)
        self.state.setHidden(not text)

    def choose(self) -> None:
        """Show the kind of map that was chosen."""

    def look(self) -> None:
        """Look at the session's capture."""

    def _capture_changed(self) -> None:
        if self.isVisible():  # else it is refreshed when it comes to the front
            self.look()
