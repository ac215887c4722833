"""The figures show the numbers they are given, on the scales they state."""

import dataclasses
import re
from io import BytesIO

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from pypdf import PdfReader
from reportlab.pdfgen.canvas import Canvas
from scipy.integrate import trapezoid

from core.report import ReportData, pdf
from core.report.adjusted import correlations
from core.report.chapters import CHAPTERS, tables
from core.report.chapters import drawings as drawn
from core.report.figures import Drawing, network, planes, set_on_page, svg_text
from core.report.figures import images as over_images
from core.report.figures.canvas import CSS_VARIABLES, drawing_style
from core.report.figures.images import magnification
from core.report.figures.planes import colour_limit_mm

DRAWN = {
    "residuals": over_images.residuals,
    "coverage": over_images.coverage,
    "network": network.network,
    "convergence": network.convergence,
    "correlations": network.correlated,
    "deviations": planes.maps,
    "histograms": planes.histograms,
}
ALL = list(DRAWN)


def drawings(data):
    return [drawing for chapter in drawn(data).values() for drawing in chapter]


def drawing_of(data, key):
    """Draw the one figure, and those of its file; None where there is none of that name."""
    with drawing_style():
        found = DRAWN[key](data)
    return next(iter(found), None)


def images_of(drawing):
    return [image for axes in drawing.figure.axes for image in axes.images]


def test_every_figure_is_drawn_with_caption_and_alternative(data):
    result = drawings(data)
    assert [d.key for d in result] == ALL
    assert all(len(d.caption) > 80 and len(d.alternative) > 20 and d.title for d in result)


def test_the_response_is_drawn_and_told_by_its_power(data):
    level = np.linspace(0, 1, 65)
    curves = {name: np.column_stack([level, level**power]) for name, power in (("a", 2.2), ("b", 2.0), ("c", 2.1))}
    data = dataclasses.replace(data, responses={"projector": curves})
    with drawing_style():
        (drawing,) = CHAPTERS["response"].drawings[0](data)
    lines = drawing.figure.axes[0].get_lines()
    assert np.allclose(lines[-1].get_ydata(), level**2.1)
    (table,) = [t for t in tables(data) if t.title == "Response of projector"]
    assert [row[-1].text for row in table.rows] == ["2.20", "2.00", "2.10"]
    assert [cell.text for cell in table.rows[1][1:4]] == ["0.062", "0.250", "0.562"]


def test_figures_need_their_data(data):
    def keys(**parts):
        with drawing_style():
            shown = ReportData(data.project, **parts)
            return [d.key for c in CHAPTERS.values() for draw in c.drawings for d in draw(shown)]

    assert keys(photogrammetric=data.photogrammetric) == []
    assert keys(evaluations=data.evaluations) == ALL[5:]
    assert keys(adjustment=data.adjustment) == ALL[:5]


def test_deviation_maps_share_one_symmetric_scale(data, evaluations):
    images = images_of(drawing_of(data, "deviations"))
    limits = {image.get_clim() for image in images}
    assert len(images) == 4
    assert len(limits) == 1
    low, high = limits.pop()
    assert low == -high
    shown = {tuple(np.ma.getdata(image.get_array())[5, :3]) for image in images}
    assert shown == {tuple(e.deviation_mm[5, :3]) for e in evaluations}


def test_colour_limit_follows_the_spread_not_the_gross_errors(evaluations):
    limit = colour_limit_mm(evaluations)
    spoilt = evaluations[0].deviation_mm.copy()
    spoilt[10, :5] = 40.0
    gross = (dataclasses.replace(evaluations[0], deviation_mm=spoilt), *evaluations[1:])
    assert limit == pytest.approx(0.15, abs=0.011)  # three times the larger spread of 0.05 mm
    assert colour_limit_mm(gross) == limit


def test_colour_limit_can_be_given(data):
    images = images_of(drawing_of(dataclasses.replace(data, colour_limit_mm=0.25), "deviations"))
    assert images[0].get_clim() == (-0.25, 0.25)


def test_a_plane_without_deviations_leaves_its_panel_empty(data, evaluations):
    empty = dataclasses.replace(evaluations[0], deviation_mm=np.full((30, 40), np.nan, np.float32))
    drawing = drawing_of(dataclasses.replace(data, evaluations=(empty, *evaluations[1:])), "deviations")
    assert len(images_of(drawing)) == 3
    assert "not evaluated" in [text.get_text() for axes in drawing.figure.axes for text in axes.texts]
    alone = dataclasses.replace(data, evaluations=(empty,))
    assert drawing_of(alone, "deviations") is None


def test_many_captures_are_spread_over_figures_on_one_scale(data, evaluations):
    many = tuple(dataclasses.replace(evaluations[0], capture=f"plane {i}", angle_deg=None) for i in range(9))
    with drawing_style():
        maps = planes.maps(ReportData(data.project, evaluations=many))
    assert [drawing.key for drawing in maps] == ["deviations-1", "deviations-2", "deviations-3"]
    assert [len(images_of(d)) for d in maps] == [3, 3, 3]
    assert len({image.get_clim() for d in maps for image in images_of(d)}) == 1


def test_histogram_counts_every_pixel_and_the_curve_is_the_predicted_normal(data):
    axes = drawing_of(data, "histograms").figure.axes[0]
    bars = next(patch for patch in axes.patches if hasattr(patch, "get_data"))
    values, edges, _ = bars.get_data()
    assert values.sum() == pytest.approx(100.0, abs=0.5)  # a normal of 0.03 mm lies within ±0.15 mm
    x, y = axes.lines[0].get_data()
    assert trapezoid(y, x) / (edges[1] - edges[0]) == pytest.approx(100.0, abs=0.1)
    assert np.sqrt(trapezoid(y * x**2, x) / trapezoid(y, x)) == pytest.approx(0.03, rel=1e-3)


def test_residual_vectors_are_the_residuals_magnified_as_stated(data, adjustment):
    axes = drawing_of(data, "residuals").figure.axes[1]  # the projector
    vertices = axes.lines[0].get_xydata().reshape(-1, 6, 2)
    mine = np.array(
        [adjustment.network.station_device[s] == "projector" for s in adjustment.network.observation_station]
    )
    np.testing.assert_allclose(vertices[:, 0], adjustment.network.observation_uv[mine])
    factor = float(re.search(r"magnified (\S+)×", " ".join(t.get_text() for t in axes.texts)).group(1))
    np.testing.assert_allclose(vertices[:, 1] - vertices[:, 0], adjustment.residuals[mine] * factor)
    assert f"projector {factor:g} times" in drawing_of(data, "residuals").caption


def test_magnification_keeps_arrows_short_but_visible(project):
    for scale in (1e-3, 0.37, 9.9):
        residuals = np.random.default_rng(3).normal(0, scale, (500, 2))
        length = np.quantile(np.hypot(*residuals.T), 0.95) * magnification(residuals, project.camera)
        width_um = 748 * 8.0
        assert 0.025 * width_um < length <= 0.05 * width_um  # rounding down to one digit halves at most
    assert magnification(np.zeros((5, 2)), project.camera) == 1.0


def test_points_seen_in_one_coordinate_only_are_left_out_of_the_image(data, adjustment):
    uv, residuals = adjustment.network.observation_uv.copy(), adjustment.residuals.copy()
    uv[0, 1] = residuals[0, 1] = np.nan
    network = dataclasses.replace(adjustment.network, observation_uv=uv)
    changed = dataclasses.replace(adjustment, network=network, residuals=residuals)
    axes = drawing_of(dataclasses.replace(data, adjustment=changed), "residuals").figure.axes[0]
    assert len(axes.lines[0].get_xydata()) == 6 * 47


def test_coverage_counts_all_image_points(data):
    for axes in drawing_of(data, "coverage").figure.axes:
        assert sum(int(text.get_text()) for text in axes.texts) == 48


def test_network_shows_projection_centres_in_both_views(data, adjustment):
    above, side = drawing_of(data, "network").figure.axes
    # X_device = R X_object + t is zero at the projection centre
    centres = np.array([np.linalg.solve(p.rotation, -p.translation_mm) for p in adjustment.station_from_object])
    for axes, columns in ((above, [0, 1]), (side, [0, 2])):
        camera = next(line for line in axes.lines if line.get_label() == "camera")
        np.testing.assert_allclose(camera.get_xydata(), centres[::2][:, columns], atol=1e-9)


def test_viewing_axes_lead_towards_the_object(data, adjustment):
    side = drawing_of(data, "network").figure.axes[1]
    strokes = side.lines[1].get_xydata().reshape(-1, 3, 2)
    assert np.all(strokes[:, 1, 1] < strokes[:, 0, 1])  # all stations stand above the field and look down
    assert np.all(np.abs(strokes[:, 1, 0]) <= np.abs(strokes[:, 0, 0]) + 1e-9)  # and inwards


def test_correlations_leave_out_what_was_held_fixed(adjustment):
    found = correlations(adjustment)
    assert "projector.A6" not in found.names
    assert found.values.shape == (23, 23)
    np.testing.assert_allclose(np.diag(found.values), 1.0)
    assert found.strongest(1) == [("camera.x0", "camera.A6", pytest.approx(-0.96))]


def test_strongest_correlation_is_written_into_its_cell(data):
    drawing = drawing_of(data, "correlations")
    assert [text.get_text() for text in drawing.figure.axes[0].texts] == ["-96"]
    assert "camera.x0 with camera.A6 -0.96" in drawing.alternative


def test_convergence_copes_with_zero_and_undefined_sums(data, adjustment):
    for values in ((5.0, 0.0), (5.0, float("nan"), 4.0), (3.0,)):
        changed = dataclasses.replace(data, adjustment=dataclasses.replace(adjustment, convergence=values))
        assert svg_text(drawing_of(changed, "convergence")).startswith("<svg")
    nothing = dataclasses.replace(data, adjustment=dataclasses.replace(adjustment, convergence=()))
    assert drawing_of(nothing, "convergence") is None


def test_colours_of_the_svg_are_the_page_s(data):
    text = svg_text(drawing_of(data, "network"))
    assert not any(colour in text for colour in CSS_VARIABLES)
    assert "var(--ink)" in text
    assert "var(--camera)" in text


def test_names_that_no_font_holds_do_not_stop_a_figure(data, evaluations):
    odd = tuple(dataclasses.replace(e, capture="計測$1_^{x} " * 4) for e in evaluations[:2])
    for drawing in drawings(ReportData(data.project, evaluations=odd)):
        assert svg_text(drawing).startswith("<svg")


def test_drawing_leaves_the_callers_matplotlib_alone(data):
    before = dict(mpl.rcParams)
    assert svg_text(drawing_of(data, "convergence"))
    assert dict(mpl.rcParams) == before


@pytest.mark.parametrize(
    ("drawn_as", "up", "place"),
    [("nearest", 1, [144, 0, 0, 108, 72, 54]), ("none", -1, [144, 0, 0, -108, 72, 162])],  # its own pixels, upside down
)
def test_lines_texts_and_images_of_the_page_stand_where_the_data_are(drawn_as, up, place):
    figure = Figure((4, 3))
    axes = figure.add_axes((0.25, 0.25, 0.5, 0.5), xlim=(0, 10), ylim=(0, 1))  # 144 by 108 points from (72, 54)
    axes.set_axis_off()
    axes.plot([2, 9], [0.25, 0.75], color="#ff0000", linewidth=3, dashes=(2, 1))
    axes.plot([5], [0.5], "s", markersize=10, markeredgewidth=0, color="#0000ff", alpha=0.5)
    axes.text(1, 1, "up", rotation=90, rotation_mode="anchor", fontsize=9)
    levels = np.array([[0.0, 1.0], [0.5, 0.25]])
    axes.imshow(levels, cmap="gray", extent=(0, 10, 0, 1), aspect="auto", interpolation=drawn_as)
    out = BytesIO()
    canvas = Canvas(out, pagesize=(288, 216))
    pdf.register_fonts()
    set_on_page(Drawing("any", "any", "", "", figure), canvas)
    canvas.save()
    page = PdfReader(out).pages[0]
    told = [(name.decode(), list(on)) for on, name in page.get_contents().operations]
    for one in (
        ("l", [201.6, 135]),  # the line's end
        ("d", [[6, 3], 0]),  # dashes in points: twice and once the width of three
        ("cm", [1, 0, 0, 1, 144, 108]),  # the marker's middle
        ("m", [-5, -5]),
        ("cm", [0, 1, -1, 0, 86.4, 162]),  # upwards, from the text's beginning
        ("Tj", ["up"]),
        ("cm", place),  # the image fills the axes
    ):
        assert one in told
    assert told[told.index(("l", [201.6, 135])) - 1] == ("m", [100.8, 81])
    assert {state["/ca"] for state in page["/Resources"]["/ExtGState"].values() if "/ca" in state} >= {0.5}
    shown = np.asarray(page.images[0].image.convert("L"))
    quarters = np.ix_(*([n // 4, 3 * n // 4] for n in shown.shape))
    assert shown[::up][quarters].tolist() == [[0, 255], [128, 64]]
