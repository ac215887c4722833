"""The HTML and PDF files: whole, self-contained, the same each time, never half written."""

import dataclasses
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from pypdf import PdfReader

from core.errors import Cancelled, InputError
from core.progress import Progress
from core.report import CHAPTERS, ReportData, cell_text, summary, tables, write_report

VOID = {"meta", "link", "br", "img", "hr", "input"}
FIGURES = {"residuals", "coverage", "network", "convergence", "correlations", "deviations", "histograms"}


class Page(HTMLParser):
    """Collects what a page holds, and fails on elements that are not closed in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.text, self.cells = [], [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag in ("td", "th", "caption"):
            self.cells.append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        self.text.append(text)
        if {"td", "th", "caption"} & set(self.open):
            self.cells[-1] += text

    def all(self, tag):
        return [attrs for name, attrs in self.elements if name == tag]


@pytest.fixture
def paths(data, once):
    """The whole report, written once for all workers."""
    folder = once("report", lambda folder: write_report(data, folder))
    return folder / "report.html", folder / "report.pdf"


@pytest.fixture
def page(paths):
    return Page(paths[0].read_text(encoding="utf-8"))


@pytest.fixture
def pdf_text(paths):
    return "\n".join(p.extract_text() for p in PdfReader(paths[1]).pages)


def test_html_holds_every_cell_caption_and_note(page, data):
    for table in tables(data):
        assert table.title in page.cells
        for row in table.rows:
            assert all(cell_text(cell) in page.cells for cell in row)
        assert all(note in "".join(page.text) for note in table.notes)
    assert len(page.all("table")) == len(tables(data))


def test_html_tables_have_headers_with_scope(page, data):
    headers = page.all("th")
    assert len(headers) == sum(len(t.columns) + len(t.rows) for t in tables(data))
    assert all(h["scope"] in ("col", "row") for h in headers)


def test_html_holds_every_figure_with_a_text_alternative(page):
    figures = {a["id"].removeprefix("figure-") for a in page.all("figure")}
    assert figures == FIGURES
    images = [a for _, a in page.elements if a.get("role") == "img"]
    assert len(images) == len(FIGURES) == len(page.all("svg")) == len(page.all("figcaption"))
    assert all(len(a["aria-label"]) > 20 for a in images)


def test_html_loads_nothing_from_outside(paths, page):
    text = paths[0].read_text(encoding="utf-8")
    assert not page.all("script")
    assert not page.all("link")
    for _, attributes in page.elements:
        for name in ("src", "href", "xlink:href"):
            assert attributes.get(name, "#").startswith(("#", "data:"))
    assert all(target.startswith(("#", "data:")) for target in re.findall(r"url\(\"?([^)\"]+)", text))
    assert "@import" not in text


def test_names_within_the_page_are_unique_and_all_links_lead_somewhere(paths, page):
    names = [a["id"] for _, a in page.elements if "id" in a]
    assert len(names) == len(set(names))
    links = [a[n][1:] for _, a in page.elements for n in ("href", "xlink:href") if a.get(n, "").startswith("#")]
    links += re.findall(r"url\(#([^)]+)\)", paths[0].read_text(encoding="utf-8"))
    assert len(links) > 10
    assert set(links) <= set(names)


def test_summary_stands_in_both_files(page, pdf_text, data):
    flowing = " ".join(pdf_text.split())
    for text in (*summary(data).findings, *summary(data).warnings):
        assert text in page.text
        assert text in flowing


def test_pdf_holds_every_cell_and_caption(pdf_text, data):
    flowing = " ".join(pdf_text.split())
    for table in tables(data):
        assert table.title in flowing
        assert all(cell_text(cell) in flowing for row in table.rows for cell in row)
    for title in ("Residual vectors over the image.", "Deviation maps of the plane-table.", "The network."):
        assert title in flowing


def test_pdf_pages_are_numbered_and_outlined(paths):
    reader = PdfReader(paths[1])
    for number, p in enumerate(reader.pages, 1):
        assert f"page {number} of {len(reader.pages)}" in p.extract_text()
    titles = [entry.title for entry in reader.outline]
    assert titles == ["Summary", "Photogrammetric calibration", "Depth calibration", "Plane-table"]
    assert reader.metadata.title == "Reference rig: calibration report"


def test_pdf_figures_are_lines_and_words_that_can_be_found(paths, pdf_text):
    images = [image for p in PdfReader(paths[1]).pages for image in p.images]
    assert len(images) == 4 + 1 + 2  # maps, correlations, and the colours of their scales
    for words in ("weighted sum of squares", "iteration", "magnified", "from above (along Z)", "deviation in mm"):
        assert words in pdf_text


def test_equal_data_give_equal_files(data, paths, tmp_path):
    again = write_report(data, tmp_path)
    assert again.html.read_bytes() == paths[0].read_bytes()
    assert again.pdf.read_bytes() == paths[1].read_bytes()


@pytest.mark.usefixtures("plain_reports")
@pytest.mark.parametrize(
    ("kept", "sections"),
    [
        ((), []),
        (("depth",), ["depth"]),
        (("photogrammetric",), ["adjustment"]),
        (("adjustment",), ["adjustment"]),
        (("evaluations",), ["planes"]),
        (("depth", "evaluations"), ["depth", "planes"]),
    ],
)
def test_missing_parts_leave_their_sections_out(data, kept, sections, tmp_path):
    part = ReportData(data.project, **{name: getattr(data, name) for name in kept})
    paths = write_report(part, tmp_path)
    page = Page(paths.html.read_text(encoding="utf-8"))
    assert [a["id"] for a in page.all("section")] == ["summary", *sections]
    assert "Not in this report" in page.text
    text = " ".join("".join(p.extract_text() for p in PdfReader(paths.pdf).pages).split())
    assert all(said in text for said in summary(part).missing)


def test_names_are_shown_as_they_are_written(data, evaluations, tmp_path):
    name = "Prüfstand № 5 <script>alert(1)</script> & Söhne 計測"
    project = dataclasses.replace(data.project, name=name, reference=None)
    odd = tuple(dataclasses.replace(e, capture="plané <b>") for e in evaluations[:1])
    paths = write_report(ReportData(project, evaluations=odd), tmp_path)
    page = Page(paths.html.read_text(encoding="utf-8"))
    assert name in page.text
    assert "plané <b>" in page.cells
    assert not page.all("script")
    assert "Prüfstand № 5 <script>" in PdfReader(paths.pdf).pages[0].extract_text()


def test_a_project_without_a_name_is_called_by_its_folder(project, tmp_path):
    paths = write_report(ReportData(dataclasses.replace(project, name="")), tmp_path)
    assert "<h1>rig</h1>" in paths.html.read_text(encoding="utf-8")


def test_maps_of_nothing_but_nan_are_no_reason_to_fail(data, evaluations, tmp_path):
    blank = tuple(dataclasses.replace(e, deviation_mm=np.full((30, 40), np.nan, np.float32)) for e in evaluations)
    paths = write_report(ReportData(data.project, evaluations=blank), tmp_path)
    page = Page(paths.html.read_text(encoding="utf-8"))
    assert page.all("figure") == []
    assert len(page.all("table")) == 1


def test_a_long_table_runs_over_pages_with_its_header(data, evaluations, tmp_path):
    many = tuple(
        dataclasses.replace(evaluations[0], capture=f"plane {i:03d}", deviation_mm=np.zeros((0, 0), np.float32))
        for i in range(120)
    )
    paths = write_report(ReportData(data.project, evaluations=many), tmp_path)
    pages = [p.extract_text() for p in PdfReader(paths.pdf).pages]
    assert "plane 119" in pages[-1]
    assert all("predicted" in text for text in pages)


def test_cancelled_report_writes_nothing(project, depth, tmp_path):
    seen = []

    def report(fraction, message):
        seen.append(fraction)

    with pytest.raises(Cancelled):
        write_report(
            ReportData(project, depth=depth),
            tmp_path / "out",
            progress=Progress(report, lambda: bool(seen) and seen[-1] > 0.9),
        )
    assert not (tmp_path / "out").exists()


def test_progress_runs_from_start_to_end(project, evaluations, tmp_path):
    seen = []
    progress = Progress(lambda fraction, message: seen.append(fraction))
    write_report(ReportData(project, evaluations=evaluations), tmp_path, progress=progress)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert [p.name for p in sorted(tmp_path.iterdir())] == ["report.html", "report.pdf"]


def test_a_file_in_place_of_the_folder_is_refused(project, tmp_path):
    (tmp_path / "out").write_text("here")
    with pytest.raises(InputError, match="cannot be written"):
        write_report(ReportData(project), tmp_path / "out")


@pytest.mark.usefixtures("plain_reports")
def test_a_chapter_from_outside_stands_in_both_files(data, tmp_path, extension):
    """What the developer's guide shows; where it has nothing to say it is left out."""
    extension("report_section", CHAPTERS)
    paths = write_report(data, tmp_path)
    assert "Weather of the day" in paths.html.read_text(encoding="utf-8")
    text = "".join(page.extract_text() for page in PdfReader(paths.pdf).pages)
    assert "Weather of the day" in text
    assert "20.5" in text
    CHAPTERS["weather"] = dataclasses.replace(CHAPTERS["weather"], tables=lambda data: [])
    without = write_report(data, tmp_path)
    assert "Weather" not in without.html.read_text(encoding="utf-8")
