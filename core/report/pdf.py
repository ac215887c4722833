"""The report as PDF on A4 pages: the same content, numbered pages, an outline to move by."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from html import escape
from io import BytesIO
from typing import Any

from reportlab import rl_config
from reportlab.lib import colors
from reportlab.lib.enums import TA_RIGHT
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import Flowable, KeepTogether, ListFlowable, ListItem, Paragraph, SimpleDocTemplate, Spacer
from reportlab.platypus import Table as PageTable

from core.progress import SILENT, Progress
from core.report.document import Document, Section
from core.report.figures import Drawing, set_on_page
from core.report.figures.canvas import drawable
from core.report.figures.strokes import BOLD, FONT
from core.report.table import Table, cell_text, numeric_columns
from core.resources import resource

MARGIN, FRAME_PADDING = 17 * mm, 6
TEXT_WIDTH, TEXT_HEIGHT = A4[0] - 2 * MARGIN - 2 * FRAME_PADDING, A4[1] - 2 * MARGIN - 2 * FRAME_PADDING
VERDICTS = {
    name: colors.HexColor(c) for name, c in (("failed", "#b3261e"), ("doubtful", "#9a5b00"), ("passed", "#2f7d4f"))
}
MUTED, GRID = colors.HexColor("#57606b"), colors.HexColor("#c9ced4")

_BODY = ParagraphStyle("body", fontName=FONT, fontSize=9, leading=12.5, spaceAfter=4)
_SMALL = ParagraphStyle("small", _BODY, fontSize=7.5, leading=10, textColor=MUTED, spaceAfter=1)
_TITLE = ParagraphStyle("title", _BODY, fontName=BOLD, fontSize=18, leading=22, spaceAfter=4)
_CHAPTER = ParagraphStyle("chapter", _BODY, fontName=BOLD, fontSize=13, leading=16, spaceBefore=12, spaceAfter=6)
_HEADING = ParagraphStyle("heading", _BODY, fontName=BOLD, fontSize=9.5, spaceBefore=6, spaceAfter=3)
_CELL = ParagraphStyle("cell", _BODY, fontSize=7.2, leading=9, spaceAfter=0)
_NUMBER = ParagraphStyle("number", _CELL, alignment=TA_RIGHT)
_CAPTION = ParagraphStyle("caption", _BODY, fontSize=8, leading=11, spaceBefore=3, spaceAfter=10)


def pdf_bytes(document: Document, *, progress: Progress = SILENT) -> bytes:
    """Set the report in PDF."""
    register_fonts()
    story: list[Flowable] = [_text("Calibration and accuracy report", _SMALL), _text(document.title, _TITLE)]
    story += [_text(fact, _SMALL) for fact in document.facts]
    story += _summary(document)
    for section in progress.over(document.sections, "setting pages"):
        story += _chapter(section)
    if document.source:
        story += [Spacer(0, 8), _text(f"Published values: {document.source}.", _SMALL)]
    out = BytesIO()
    template = SimpleDocTemplate(
        out,
        pagesize=A4,
        leftMargin=MARGIN,
        rightMargin=MARGIN,
        topMargin=MARGIN,
        bottomMargin=MARGIN,
        title=f"{document.title}: calibration report",
        author="",
        lang="en",
        invariant=1,  # equal content gives equal files
    )
    with _binary():
        template.build(story, canvasmaker=_NumberedCanvas)
    return out.getvalue()


@contextmanager
def _binary() -> Iterator[None]:
    """Write pictures as bytes: as text they take a quarter more room, and longer than all the rest of the setting."""
    before, rl_config.useA85 = rl_config.useA85, 0
    try:
        yield
    finally:
        rl_config.useA85 = before


def _summary(document: Document) -> list[Flowable]:
    story: list[Flowable] = [_Bookmark("summary", "Summary"), _text("Summary", _CHAPTER)]
    for name, verdict in document.summary.verdicts:
        if verdict.state != "passed":
            told = tuple(f"{text[:1].upper()}{text[1:]}." for text in verdict.because)
            style = ParagraphStyle("verdict", _HEADING, textColor=VERDICTS[verdict.state])
            story += [_text(f"{name[:1].upper()}{name[1:]}: {verdict.state}", style), _bullets(told)]
    if sound := document.summary.passed:
        style = ParagraphStyle("sound", _BODY, textColor=VERDICTS["passed"])
        story.append(_text(f"Passed: {'; '.join(sound)}.", style))
    if document.summary.findings:
        story.append(_bullets(document.summary.findings))
    if document.summary.warnings:
        story += [_text(f"Warnings ({len(document.summary.warnings)})", _HEADING), _bullets(document.summary.warnings)]
    elif document.sections:
        story.append(_text("The calibration raised no warnings.", _BODY))
    if document.summary.missing:
        story += [_text("Not in this report", _HEADING), _bullets(document.summary.missing)]
    return story


def _chapter(section: Section) -> list[Flowable]:
    story: list[Flowable] = []
    for table in section.tables:
        notes = [_text(note, _SMALL) for note in table.notes]
        heading = _text(table.title, _HEADING)
        # a table that may not fit on one page must be allowed to break
        block: list[Flowable] = [heading, _page_table(table), Spacer(0, 2), *notes, Spacer(0, 6)]
        story += [KeepTogether(block)] if len(table.rows) <= 40 else block
    story += [_figure(drawing) for drawing in section.drawings]
    opening: list[Flowable] = [_Bookmark(section.key, section.title), _text(section.title, _CHAPTER)]
    if story and isinstance(story[0], KeepTogether):
        return [KeepTogether([*opening, *story[0]._content]), *story[1:]]
    return opening + story


def _page_table(table: Table) -> PageTable:
    right = numeric_columns(table)
    styles = [_NUMBER if flush else _CELL for flush in right]
    head = [
        Paragraph(f"<b>{_escaped(column).replace(' [', '<br/>[')}</b>", style)
        for column, style in zip(table.columns, styles, strict=True)
    ]
    body = [[_text(cell_text(cell), style) for cell, style in zip(row, styles, strict=True)] for row in table.rows]
    return PageTable(
        [head, *body],
        colWidths=_column_widths(table),
        repeatRows=1,
        hAlign="LEFT",
        style=[
            ("VALIGN", (0, 0), (-1, 0), "BOTTOM"),
            ("VALIGN", (0, 1), (-1, -1), "TOP"),
            ("LINEBELOW", (0, 0), (-1, 0), 0.8, MUTED),
            ("LINEBELOW", (0, 1), (-1, -1), 0.3, GRID),
            ("LEFTPADDING", (0, 0), (-1, -1), 0),
            ("RIGHTPADDING", (0, 0), (-1, -1), 8),
            ("TOPPADDING", (0, 0), (-1, -1), 1.5),
            ("BOTTOMPADDING", (0, 0), (-1, -1), 1.5),
        ],
    )


def _column_widths(table: Table) -> list[float]:
    """Widths that hold every cell on one line.

    Where the page is too narrow sentences wrap, then the names in the first column; only if that is not enough all
    columns shrink.
    """
    columns: list[float] = []
    for i, column in enumerate(table.columns):
        heads = [pdfmetrics.stringWidth(drawable(part), BOLD, _CELL.fontSize) for part in column.split(" [")]
        cells = [pdfmetrics.stringWidth(drawable(cell_text(row[i])), FONT, _CELL.fontSize) for row in table.rows]
        columns.append(max([*heads, *cells]) + 12)

    for i, flush in enumerate(numeric_columns(table)):
        if not flush:
            columns[i] = min(columns[i], max(TEXT_WIDTH - sum(columns) + columns[i], TEXT_WIDTH / 2))
    columns[0] = min(columns[0], max(TEXT_WIDTH - sum(columns[1:]), 70.0))
    shrink = min(1.0, TEXT_WIDTH / sum(columns))
    return [width * shrink for width in columns]


def _figure(drawing: Drawing) -> KeepTogether:
    width, height = drawing.size_in
    scale = min(TEXT_WIDTH / width, (TEXT_HEIGHT - 70) / height)  # the caption needs room on the same page
    shown = _Figure(drawing, width * scale, height * scale)
    caption = Paragraph(f"<b>{_escaped(drawing.title)}.</b> {_escaped(drawing.caption)}", _CAPTION)
    return KeepTogether([Spacer(0, 8), shown, caption])


def _bullets(texts: tuple[str, ...]) -> ListFlowable:
    items = [ListItem(_text(text, _BODY), leftIndent=12) for text in texts]
    return ListFlowable(items, bulletType="bullet", start="•", bulletFontName=FONT, bulletFontSize=8, leftIndent=12)


def _text(text: str, style: ParagraphStyle) -> Paragraph:
    return Paragraph(_escaped(text), style)


def _escaped(text: str) -> str:
    return escape(drawable(text), quote=False)


@cache
def register_fonts() -> None:
    """Read the fonts of the pages."""
    for name, file in ((FONT, "DejaVuSans.ttf"), (BOLD, "DejaVuSans-Bold.ttf")):
        pdfmetrics.registerFont(TTFont(name, str(resource("fonts", file))))
    pdfmetrics.registerFontFamily(FONT, normal=FONT, bold=BOLD, italic=FONT, boldItalic=BOLD)


class _Figure(Flowable):
    """A drawing in the middle of the column."""

    hAlign = "CENTER"  # noqa: N815  reportlab's name

    def __init__(self, drawing: Drawing, width: float, height: float) -> None:
        super().__init__()
        self.drawing, self.size = drawing, (width, height)

    def wrap(self, *_: float) -> tuple[float, float]:
        return self.size

    def draw(self) -> None:
        scale = self.size[0] / (72 * self.drawing.size_in[0])
        self.canv.scale(scale, scale)
        set_on_page(self.drawing, self.canv)


class _Bookmark(Flowable):
    """An entry of the outline, of no size."""

    def __init__(self, key: str, title: str) -> None:
        super().__init__()
        self.key, self.title = key, title

    def wrap(self, *_: float) -> tuple[float, float]:
        return 0.0, 0.0

    def draw(self) -> None:
        self.canv.bookmarkHorizontal(self.key, 0, 20)
        self.canv.addOutlineEntry(self.title, self.key)


class _NumberedCanvas(Canvas):
    """Writes "page i of n" on every page, which is known only at the end."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._pages: list[dict[str, Any]] = []

    def showPage(self) -> None:  # noqa: N802  reportlab's name
        self._pages.append(dict(self.__dict__))
        self._startPage()

    def save(self) -> None:
        for number, page in enumerate(self._pages, 1):
            self.__dict__.update(page)
            self.setFont(FONT, 7.5)
            self.setFillColor(MUTED)
            self.drawRightString(A4[0] - MARGIN, 9 * mm, f"page {number} of {len(self._pages)}")
            super().showPage()
        super().save()
