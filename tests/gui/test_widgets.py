"""Image view, residual plot, tables, colours: what they show, and how fast."""

from __future__ import annotations

import gc
import time

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QGuiApplication, QTextDocument
from PySide6.QtTest import QTest

from core.model import PlaneEvaluation
from core.report import Number, Table
from stripe_gui.widgets.colours import lookup, nice_ticks
from stripe_gui.widgets.help_panel import HelpPanel
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.residual_view import ResidualPlot
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.widgets.sign_off import SignOffForm


@pytest.fixture
def view(qtbot) -> ImageView:
    made = ImageView("picture")
    made.resize(500, 400)
    qtbot.addWidget(made)
    with qtbot.waitExposed(made):
        made.show()
    return made


def on_screen(view: ImageView, u: float, v: float) -> QPoint:
    return view.canvas.mapFromScene(view.canvas.box.mapViewToScene(QPointF(u, v)))


def test_the_cursor_reads_the_pixel_whose_centre_is_nearest(view, qtbot) -> None:
    image = np.arange(12 * 16, dtype=np.float32).reshape(12, 16)
    view.set_image(image, (0, 200), digits=1, unit="grey")
    QTest.mouseMove(view.canvas.viewport(), on_screen(view, 7.3, 4.4))
    qtbot.waitUntil(lambda: "71.0 grey" in view.readout.text())  # row 4, column 7
    assert view.value_at(-0.4, -0.4) == 0
    assert view.value_at(-0.6, 0) is None


def test_a_click_tells_device_pixels(view, qtbot) -> None:
    view.set_image(np.zeros((12, 16), np.uint8))
    seen = []
    view.clicked.connect(lambda u, v, *_: seen.append((u, v)))
    qtbot.mouseClick(view.canvas.viewport(), Qt.MouseButton.LeftButton, pos=on_screen(view, 5.0, 3.0))
    # a screen pixel here is a thirtieth of an image pixel
    assert np.allclose(seen, [(5.0, 3.0)], atol=0.05)


def test_the_zoom_stays_when_the_image_changes_and_not_when_its_size_does(view) -> None:
    view.set_image(np.zeros((100, 150), np.uint8))
    view.canvas.box.scaleBy((0.2, 0.2))
    view.centre_on(20, 30)
    kept = np.array(view.canvas.box.viewRange())
    view.set_image(np.ones((100, 150), np.uint8))
    assert np.allclose(view.canvas.box.viewRange(), kept)
    view.set_image(np.ones((120, 150), np.uint8))
    assert not np.allclose(view.canvas.box.viewRange(), kept)


def test_keys_zoom_and_zero_shows_all(view, qtbot) -> None:
    view.set_image(np.zeros((100, 150), np.uint8))
    whole = np.ptp(view.canvas.box.viewRange()[0])
    qtbot.keyClick(view.canvas, Qt.Key.Key_Plus)
    assert np.ptp(view.canvas.box.viewRange()[0]) == pytest.approx(0.8 * whole)
    qtbot.keyClick(view.canvas, Qt.Key.Key_0)
    assert np.ptp(view.canvas.box.viewRange()[0]) == pytest.approx(whole, rel=0.05)


def test_levels_are_fixed_and_what_is_not_a_number_is_not_drawn(view) -> None:
    image = np.full((4, 4), 50.0, np.float32)
    image[0, 0] = np.nan
    view.set_image(image, (0, 100), scale="deviation")
    assert tuple(view.image_item.levels) == (0, 100)
    assert view.value_at(0, 0) is None
    view.set_image(image * 1000, (0, 100), scale="deviation")
    assert tuple(view.image_item.levels) == (0, 100)


def test_sixty_image_views_come_and_go(qtbot) -> None:
    """Some versions of Qt's bindings lose references to None here and abort after a dozen."""
    for i in range(60):
        made = ImageView(f"picture {i}")
        made.set_image(np.zeros((40, 60), np.float32), (0, 1), scale="map")
        made.show()
        made.grab()
        made.close()
        made.deleteLater()
        qtbot.wait(1)
        if i % 20 == 0:
            gc.collect()


def test_five_thousand_vectors_are_drawn_quickly(qtbot) -> None:
    """A frame must not be felt: 0.1 s is the usual limit; shared machines are allowed 0.4."""
    rng = np.random.default_rng(1)
    plot = ResidualPlot("residuals")
    plot.resize(600, 500)
    qtbot.addWidget(plot)
    plot.set_residuals(rng.uniform(0, 700, (5000, 2)), rng.normal(0, 0.1, (5000, 2)), (748, 576), (8.0, 8.0))
    plot.grab()
    start = time.perf_counter()
    plot.grab()
    assert time.perf_counter() - start < 0.4


def test_a_click_near_a_point_picks_it_and_elsewhere_nothing(qtbot) -> None:
    plot = ResidualPlot("residuals")
    plot.resize(600, 500)
    qtbot.addWidget(plot)
    with qtbot.waitExposed(plot):
        plot.show()
    uv = np.array([[100.0, 100.0], [400.0, 300.0], [np.nan, 5.0]])
    plot.set_residuals(uv, np.full((3, 2), 0.1), (748, 576), (8.0, 8.0))
    seen = []
    plot.picked.connect(seen.append)
    for u, v in ((402, 301), (700, 500)):
        at = plot.canvas.mapFromScene(plot.canvas.box.mapViewToScene(QPointF(u, v)))
        qtbot.mouseClick(plot.canvas.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert seen == [1]
    assert "2 points" in plot.legend.text()


TABLE = Table(
    "Deviations",
    ("plane", "r.m.s. [mm]"),
    (("a", Number(0.2, ".3f")), ("b", Number(0.1, ".3f")), ("c", None), ("d", Number(0.03, ".3f", "x"))),
    ("one note",),
)


def shown(table: ResultTable) -> list[str]:
    model = table.view.model()
    return [model.index(i, 0).data() for i in range(model.rowCount())]


def test_a_table_sorts_by_its_numbers_and_puts_the_unknown_last(qtbot) -> None:
    table = ResultTable("table")
    qtbot.addWidget(table)
    table.show_table(TABLE)
    assert shown(table) == ["a", "b", "c", "d"]
    table.view.sortByColumn(1, Qt.SortOrder.AscendingOrder)
    assert shown(table) == ["d", "b", "a", "c"]


def test_a_chosen_row_is_told_by_its_place_in_the_table(qtbot) -> None:
    table = ResultTable("table")
    qtbot.addWidget(table)
    table.show_table(TABLE)
    table.view.sortByColumn(1, Qt.SortOrder.AscendingOrder)
    seen = []
    table.row_chosen.connect(seen.append)
    table.view.selectRow(0)
    assert seen == [3]


def test_a_table_is_copied_with_its_columns(qtbot) -> None:
    table = ResultTable("table")
    qtbot.addWidget(table)
    table.show_table(TABLE)
    table.copy()
    assert QGuiApplication.clipboard().text().splitlines()[:2] == ["plane\tr.m.s. [mm]", "a\t0.200"]


@pytest.mark.parametrize("name", ["grey", "map", "deviation"])
def test_colour_scales_have_256_distinct_steps(name: str) -> None:
    assert len(np.unique(lookup(name), axis=0)) > 200


def test_the_deviation_scale_is_palest_in_the_middle_and_as_dark_at_both_ends() -> None:
    luminance = lookup("deviation") @ [0.2126, 0.7152, 0.0722]
    assert 120 < int(np.argmax(luminance)) < 136
    assert abs(luminance[0] - luminance[-1]) < 25


@pytest.mark.parametrize(("low", "high"), [(0, 1), (-0.05, 0.05), (0, 639), (1e-6, 3e-6)])
def test_ticks_are_round_and_within_the_limits(low: float, high: float) -> None:
    ticks = nice_ticks(low, high)
    assert 2 <= len(ticks) <= 8
    assert min(ticks) >= low - 1e-12
    assert max(ticks) <= high + 1e-12


def test_pictures_of_the_help_are_as_wide_as_the_panel(qtbot) -> None:
    panel = HelpPanel()
    qtbot.addWidget(panel)
    panel.resize(360, 600)
    panel.show()
    for topic in ("evaluate", "report"):
        panel.show_topic(topic)
        image = panel.browser.loadResource(QTextDocument.ResourceType.ImageResource.value, QUrl(f"images/{topic}.png"))
        assert 250 < image.deviceIndependentSize().width() < 360
        assert panel.browser.horizontalScrollBar().maximum() == 0


def test_what_failed_is_signed_with_a_reason_only(qtbot) -> None:
    form = SignOffForm()
    qtbot.addWidget(form)
    form.show()
    plane = PlaneEvaluation("plane+00", 0.0, "photogrammetric", 9, 0.1, 0.3, -0.3, 0.1, 0, "", np.array([0, 0, 1.0, 5]))
    form.show_evaluations((plane,), ())
    form.operator.setText("A. Brenner")
    assert not form.reason.isVisible()
    form.show_evaluations((plane,), ("photogrammetric",))
    assert form.reason.isVisible()
    assert "photogrammetric" in form.failed.text()
    form.remark.setText("warm room")
    assert form.sign_off().despite == ""  # a remark is no reason: the core refuses
    form.reason.setText("for training only")
    assert (form.sign_off().remark, form.sign_off().despite) == ("warm room", "for training only")
