"""A third method of calibration, added by one assignment, is offered and shown by every page."""

from __future__ import annotations

from pathlib import Path

from core.pipeline import METHODS
from stripe_gui.presenters.report import load_report
from tests.gui.hands import click, idle


def choices(box) -> list[str]:
    return [box.itemData(i) for i in range(box.count())]


def cells(table) -> set[str]:
    rows, columns = range(table.model.rowCount()), range(table.model.columnCount())
    return {str(table.model.index(i, j).data()) for i in rows for j in columns}


def test_a_method_from_outside_goes_the_whole_way_through_the_window(
    window, finished_project: Path, notices, extension, qtbot
) -> None:
    extension("calibration_method", METHODS)
    window.open_path(finished_project)

    window.show_page("calibrate")
    idle(window, qtbot)
    page = window.page
    assert choices(page.form.method) == ["all", "photogrammetric", "polynomial", "lookup"]
    page.form.method.setCurrentIndex(3)
    assert not any(widget.isEnabled() for widget in (page.form.rigid, page.form.degree, page.form.low_pass))
    click(page.run_button, qtbot)
    idle(window, qtbot)
    assert "Plane look-up" in [table.title.text() for table in page.results.tables]
    assert any("plane look-up" in box.text.text() for box in page.results.verdicts.boxes)
    assert "lookup" in page.results.made.text()
    page.go_to("runs")
    assert any(cell.startswith("rms_mm ") for cell in cells(page.runs.table))

    window.show_page("reconstruct")
    idle(window, qtbot)
    page = window.page
    assert choices(page.method) == ["photogrammetric", "polynomial", "lookup"]
    page.method.setCurrentIndex(2)
    page.bench.session.choose_capture("object-sphere")
    click(page.run_button, qtbot)
    idle(window, qtbot)
    assert "% of the image" in page.state.text()

    window.show_page("evaluate")
    idle(window, qtbot)
    page = window.page
    page.go_to("choose")
    assert page.calibrations.chosen() == ["photogrammetric", "polynomial", "lookup"]
    click(page.run_button, qtbot)
    idle(window, qtbot)
    assert list(page._view.ways) == ["photogrammetric", "polynomial", "lookup"]
    assert "lookup" in cells(page.table)

    view = load_report(window.bench.session.opened)
    assert "lookup" in {e.method for e in view.evaluations}
    assert "plane look-up" in dict(view.summary.verdicts)
    assert any("lookup" in text for text in view.summary.findings)
    assert not [n for n in notices if n.kind == "error"]
