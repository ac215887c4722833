"""The sign-off in the report, the verdict against a tolerance, and CSV files read again."""

from __future__ import annotations

import csv
import dataclasses
import re

import numpy as np
import pytest
from pypdf import PdfReader

from core.errors import Cancelled, InputError
from core.progress import Progress
from core.report import (
    Number,
    SignOff,
    Table,
    Tolerance,
    conformity,
    summary,
    tables,
    write_columns_csv,
    write_report,
    write_table_csv,
)


@pytest.fixture
def judged(evaluations):
    """The four evaluations with round figures: r.m.s. 0.030, 0.040, 0.050, 0.060 and three times that at most."""
    figures = [0.030, 0.040, 0.050, 0.060]
    return tuple(
        dataclasses.replace(e, rms_mm=f, max_mm=3 * f) for e, f in zip(evaluations, figures, strict=True)
    )  # plane+00 photogrammetric, polynomial; plane-15 photogrammetric, polynomial


def test_within_the_tolerance_is_passed_and_the_greatest_is_named(judged) -> None:
    found = conformity(judged, Tolerance(0.06))
    assert found.passed
    assert found.text.startswith("Passed: the r.m.s. deviation")
    assert "0.0600 mm, plane-15 polynomial" in found.text


def test_beyond_the_tolerance_is_failed_and_told_worst_first(judged) -> None:
    found = conformity(judged, Tolerance(0.045))
    assert not found.passed
    assert "in 2 of 4 evaluations" in found.text
    assert found.text.index("0.0600 mm") < found.text.index("0.0500 mm")


def test_the_largest_deviation_can_be_judged_instead(judged) -> None:
    assert conformity(judged, Tolerance(0.06)).passed
    assert not conformity(judged, Tolerance(0.06, "max")).passed
    assert conformity(judged, Tolerance(0.18 + 1e-9, "max")).passed


def test_what_is_not_known_does_not_pass(judged) -> None:
    unknown = dataclasses.replace(judged[0], rms_mm=float("nan"))
    assert not conformity((unknown, *judged[1:]), Tolerance(1.0)).passed


def test_the_sign_off_stands_in_html_and_pdf(data, judged, tmp_path) -> None:
    signed = SignOff(
        "A. Operator", "Rig <7>", "after a night of warming up" + 30 * " and more", "2026-11-21", Tolerance(0.05)
    )
    small = dataclasses.replace(data, adjustment=None, photogrammetric=None, evaluations=judged, sign_off=signed)
    paths = write_report(small, tmp_path)
    html = paths.html.read_text(encoding="utf-8")
    pdf = " ".join("".join(page.extract_text() for page in PdfReader(paths.pdf).pages).split())
    for text in ("A. Operator", "after a night of warming up", "2026-11-21", "Failed: the r.m.s. deviation exceeds"):
        assert text in html
        assert text in pdf
    assert "Rig &lt;7&gt;" in html
    assert " instrument Rig" in pdf  # words are not broken, however long the remark
    names = re.findall(r'\bid="([^"]+)"', html)
    assert len(names) == len(set(names))
    assert "Rig <7>" in pdf
    assert summary(small).findings[0].startswith("Signed off by A. Operator on 2026-11-21. Failed")
    assert [entry.title for entry in PdfReader(paths.pdf).outline][-1] == "Sign-off"


def read(path):
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    return list(csv.reader(line for line in lines if not line.startswith("#")))


def test_a_table_read_again_has_its_figures_with_units_and_without_marks(data, tmp_path) -> None:
    table = tables(data)[-1]
    write_table_csv(tmp_path / "t.csv", table)
    head, *rows = read(tmp_path / "t.csv")
    assert "r.m.s. [mm]" in head
    assert len(rows) == len(data.evaluations)
    for row, cells in zip(rows, table.rows, strict=True):
        for text, cell in zip(row, cells, strict=True):
            if isinstance(cell, Number):
                assert float(text) == pytest.approx(cell.value, abs=5e-4)
            else:
                assert text == (cell or "")
    notes = [line for line in (tmp_path / "t.csv").read_text(encoding="utf-8-sig").splitlines() if line[0] == "#"]
    assert [note[2:] for note in notes] == list(table.notes)


def test_quotes_commas_and_line_breaks_survive(tmp_path) -> None:
    odd = 'a, "b"\nc'
    write_table_csv(tmp_path / "t.csv", Table("T", ("name", "value [mm]"), ((odd, Number(1.5, ".2f")),)))
    with (tmp_path / "t.csv").open(encoding="utf-8-sig", newline="") as file:
        assert list(csv.reader(file))[1] == [odd, "1.50"]


def test_columns_read_again_are_the_arrays(tmp_path) -> None:
    rng = np.random.default_rng(1)
    u, d = np.arange(50_000.0), rng.normal(0, 30, 50_000)
    d[7] = np.nan
    assert write_columns_csv(tmp_path / "d.csv", {"u [px]": u, "deviation [µm]": d}, (0, 3)) == 50_000
    head, *rows = read(tmp_path / "d.csv")
    assert head == ["u [px]", "deviation [µm]"]
    again = np.array([[float(x) if x else np.nan for x in row] for row in rows])
    np.testing.assert_array_equal(again[:, 0], u)
    np.testing.assert_allclose(again[:, 1], d, atol=0.00051)


def test_a_cancelled_file_leaves_the_one_before(tmp_path) -> None:
    path = tmp_path / "d.csv"
    path.write_text("before")
    seen: list[float] = []
    progress = Progress(lambda fraction, _: seen.append(fraction), lambda: len(seen) > 1)
    with pytest.raises(Cancelled):
        write_columns_csv(path, {"u [px]": np.arange(90_000.0)}, (0,), progress=progress)
    assert path.read_text() == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["d.csv"]


def test_a_place_that_cannot_be_written_is_told(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_table_csv(tmp_path / "file" / "t.csv", Table("T", ("a",), ()))
