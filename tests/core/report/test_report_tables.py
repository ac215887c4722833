"""The tables hold the numbers of the results, the published ones and those of the truth."""

import dataclasses
import json

import numpy as np
import pytest

from core.figures import photogrammetric_figures
from core.geometry import LENSES, at_radius, distort
from core.model import Interior
from core.report import Number, ReportData, Table, cell_text, tables, text_table
from core.report.document import compose
from core.report.published import published_names, read_published
from core.resources import resource


def by_row(table):
    """Every row as a mapping from column to cell, by the row's name."""
    return {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}


def test_all_tables_come_in_order(data):
    titles = [table.title for table in tables(data)]
    assert [t.split(".")[0] for t in titles] == [
        "Table 1a",
        "Table 1b",
        "Table 2",
        "Depth per pixel, from the positions of the plate",
        "Table 3",
    ]
    assert "camera" in titles[0]
    assert "projector" in titles[1]


def test_interior_orientation_stands_beside_published_and_true_values(data):
    rows = by_row(tables(data)[0])
    assert rows["c [mm]"]["value"] == Number(12.1, ".6f")
    assert cell_text(rows["c [mm]"]["published"]) == "12.102765"
    assert cell_text(rows["A1 [mm⁻²]"]["published"]) == "-0.603793e-3"
    assert cell_text(rows["A1 [mm⁻²]"]["σ"]) == "0.50e-5"
    assert cell_text(rows["c [mm]"]["true"]) == "12.097000"
    assert rows["c [mm]"]["(value - true)/σ"].value == pytest.approx(1.5)  # 3e-3 mm with a sigma of 2e-3 mm
    assert rows["A6 [mm⁻¹]"]["(value - true)/σ"].value == pytest.approx(0.0)
    assert rows["r0 [mm]"]["value"].value == 2.5


def test_every_published_parameter_is_printed_as_it_was_published(data):
    """The digits as the paper prints them."""
    camera = ["12.102765", "-0.081293", "-0.114492", "-0.603793e-3", "0.308968e-5", "-0.143177e-1", "0.308307e-4"]
    projector = ["181.915599", "1.178883", "0.331241", "0.555660e-6", "-0.266407e-9", "0.200536e-3", "0.133679e-3"]
    for table, expected in zip(tables(data), (camera, projector), strict=False):
        column = table.columns.index("published")
        assert [cell_text(row[column]) for row in table.rows[:7]] == expected


def test_parameter_held_fixed_has_no_sigma_and_no_normalised_error(data):
    row = by_row(tables(data)[1])["A6 [mm⁻¹]"]
    assert row["σ"] == "held fixed"
    assert row["(value - true)/σ"] is None


def test_published_columns_need_a_reference(data):
    plain = dataclasses.replace(data, project=dataclasses.replace(data.project, reference=None), truth=None)
    for table in tables(plain):
        assert not {"published", "published [mm]", "true"} & set(table.columns)
        assert all(len(row) == len(table.columns) for row in table.rows)


def test_c_referred_to_the_middle_is_told_with_the_interior_orientation(data):
    # on the axis the image is scaled by 1 - A1 r0² - A2 r0⁴
    assert f"{12.1 * (1 + 6e-4 * 2.5**2 - 3e-6 * 2.5**4):.6f} mm" in tables(data)[0].notes[0]


@pytest.mark.parametrize("r0", [0.0, 1.0, 4.0])
def test_another_radius_is_the_same_imaging(r0):
    first = Interior(12.1, -0.08, -0.11, (-6e-4, 3e-6, -0.0143, 3e-5, -1.2e-4, -7.6e-5), 2.5)
    second = at_radius(first, r0)
    slopes = np.stack(np.meshgrid(np.linspace(-0.25, 0.25, 9), np.linspace(-0.2, 0.2, 9)), axis=-1)
    np.testing.assert_allclose(distort(second, second.c_mm * slopes), distort(first, first.c_mm * slopes), atol=1e-12)
    assert second.r0_mm == r0


def test_truth_given_at_another_radius_is_referred_to_the_own_one(data):
    keys, truth = LENSES["A1..A6"].keys, data.truth["camera"]
    moved = at_radius(Interior.from_vector(np.array([truth[key] for key in keys]), truth["r0_mm"]), 0.0)
    entry = dict(zip(keys, moved.vector.tolist(), strict=True)) | {"r0_mm": 0.0}
    assert entry["c_mm"] > 12.13
    rows = by_row(tables(dataclasses.replace(data, truth={"camera": entry}))[0])
    assert cell_text(rows["c [mm]"]["true"]) == "12.097000"
    assert cell_text(rows["A1 [mm⁻²]"]["true"]) == "-0.600000e-3"


def test_adjustment_table(data):
    rows = by_row(tables(data)[2])
    expected = {
        "stations": ("8", "40"),
        "image points": ("96", "6656"),
        "object points": ("12", "–"),
        "redundancy": ("117", "–"),
        "σ0 (unit weight)": ("1.0500", "–"),
        "iterations": ("5", "–"),
        "residuals camera x, r.m.s.": ("0.28", "0.28"),
        "residuals projector y, r.m.s.": ("9.90", "9.90"),
        "σ of object points Z, r.m.s.": ("20.0", "20.1"),
        "variance factor projector": ("0.900", "–"),
        "base camera to projector": ("250.000", "–"),  # hypot(240, 70)
        "σ of the base": ("0.0500", "–"),
        "angle between the viewing axes": ("25.000", "–"),
    }
    for name, (own, published) in expected.items():
        assert (cell_text(rows[name]["this adjustment"]), cell_text(rows[name]["published"])) == (own, published)


def test_what_was_never_observed_is_held_and_has_no_sigma_of_0(data):
    """The place of a projector across its coded columns was printed with a sigma of 0, its residuals as 0."""
    found = data.photogrammetric
    pose = found.orientations["projector"].device_from_base
    pose = dataclasses.replace(pose, translation_mm=pose.translation_mm * [1, 0, 1])
    covariance = found.covariance.copy()
    covariance[22] = covariance[:, 22] = 0
    device = dataclasses.replace(found.devices["projector"], residual_rms_um=(7.66, 0.0))
    found = dataclasses.replace(
        found,
        devices={**found.devices, "projector": device},
        orientations={"projector": dataclasses.replace(found.orientations["projector"], device_from_base=pose)},
        covariance=covariance,
    )
    table = tables(dataclasses.replace(data, photogrammetric=found))[2]
    assert cell_text(by_row(table)["residuals projector y, r.m.s."]["this adjustment"]) == "not observed"
    assert any("place of projector" in note and "held at 0" in note for note in table.notes)
    figures = photogrammetric_figures(found)
    for told in (figures["orientations"]["projector"], figures["projector_from_camera"]):
        assert told["translation_sigma_mm"] == [pytest.approx(0.05), None, pytest.approx(0.05)]
        assert told["held"] == ["ty"]
    assert not any("held" in note for note in tables(data)[2].notes)
    assert "held" not in photogrammetric_figures(data.photogrammetric)["projector_from_camera"]


def test_rows_of_a_device_have_one_name(data):
    """Residuals were those of "projector" beside the variance factor of the device's own name."""
    found = data.photogrammetric
    devices = {"camera": found.devices["camera"], "beamer": found.devices["projector"]}
    names = tuple(name.replace("projector.", "beamer.") for name in found.parameter_names)
    orientations = {"beamer": found.orientations["projector"]}
    found = dataclasses.replace(found, devices=devices, orientations=orientations, parameter_names=names)
    assert "residuals beamer x, r.m.s." in by_row(tables(dataclasses.replace(data, photogrammetric=found))[2])


def test_adjustment_without_calibration_gives_the_same_counts(data):
    rows = by_row(tables(dataclasses.replace(data, photogrammetric=None))[2])
    assert [cell_text(rows[n]["this adjustment"]) for n in ("stations", "image points", "object points")] == [
        "8",
        "96",
        "12",
    ]
    assert cell_text(rows["σ of object points Y, r.m.s."]["this adjustment"]) == "6.0"


def test_devices_of_any_name_have_tables(data):
    renamed = {"left": data.adjustment.devices["camera"]}
    adjustment = dataclasses.replace(data.adjustment, devices=renamed)
    first = tables(ReportData(data.project, adjustment=adjustment))[0]
    assert first.title.startswith("Table 1. ")
    assert "left" in first.title
    assert all(cell_text(row[first.columns.index("published")]) == "–" for row in first.rows)


def test_plane_table(data, evaluations):
    table = tables(data)[-1]
    assert len(table.rows) == 4
    cells = dict(zip(table.columns, table.rows[3], strict=True))
    assert (cells["capture"], cells["method"], cells["pixels"].value) == ("plane-15", "polynomial", 27 * 40)
    d = evaluations[3].deviation_mm[3:]
    assert cells["r.m.s. [mm]"].value == pytest.approx(np.linalg.norm(d) / np.sqrt(d.size), rel=1e-6)
    assert cells["max |d| [mm]"].value == pytest.approx(max(d.max(), -d.min()))
    assert cells["min d [mm]"].value == pytest.approx(d.min())
    assert cells["predicted [mm]"] is None
    assert cell_text(cells["published [mm]"]) == "0.031"  # the paper: polynomial at -15°
    assert cell_text(cells["excluded"]) == "7 (a)"
    assert "(a) excluded: outside the calibrated depths" in table.notes


def test_methods_stand_side_by_side_whatever_the_order_of_evaluation(data, evaluations):
    by_method = tuple(sorted(evaluations, key=lambda e: e.method))
    shuffled = tables(dataclasses.replace(data, evaluations=by_method))[-1]
    names = [(row[0], row[2]) for row in shuffled.rows]
    assert names == [(c, m) for c in ("plane+00", "plane-15") for m in ("photogrammetric", "polynomial")]


def test_angles_that_were_not_published_have_a_dash(data, evaluations):
    odd = tuple(dataclasses.replace(e, angle_deg=7.0) for e in evaluations[:1])
    unknown = tuple(dataclasses.replace(e, angle_deg=None) for e in evaluations[:1])
    table = tables(ReportData(data.project, evaluations=odd + unknown))[0]
    assert [cell_text(row[-1]) for row in table.rows] == ["–", "–"]
    assert cell_text(table.rows[1][1]) == "–"


@pytest.mark.usefixtures("plain_reports")
def test_an_unknown_reference_leaves_the_own_results_alone(data):
    own = dataclasses.replace(data, project=dataclasses.replace(data.project, reference=None))
    for name in ("../brenner1999", "nobody1900", ""):
        other = dataclasses.replace(data, project=dataclasses.replace(data.project, reference=name))
        assert tables(other) == tables(own)
        told = [fact for fact in compose(other).facts if fact not in compose(own).facts]
        assert [repr(name) in fact for fact in told] == ([True] if name else [])


def test_reference_files_are_complete():
    for name in published_names():
        published = read_published(name)
        raw = json.loads(resource("reference", f"{name}.json").read_text(encoding="utf-8"))
        assert published.name
        assert published.source
        assert len(published.rms_mm) == sum(len(v) for v in raw["plane_table"]["rms_mm"].values())


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (1.0, 3, "0.100e1"),
        (0.1, 3, "0.100e0"),
        (-9.99999e-7, 3, "-0.100e-5"),  # rounds up to the next power of ten
        (0.0, 3, "0.000"),
        (float("nan"), 3, "–"),
        (123.456, 6, "0.123456e3"),
    ],
)
def test_printed_exponents(value, digits, text):
    assert Number(value, f"E{digits}").text == text


def test_terminal_table_is_aligned_for_wide_characters_too():
    rows = (("計測", Number(1.5, ".2f"), "x"), ("plane-15", Number(-10.25, ".2f"), "y"))
    lines = text_table(Table("Title", ("capture", "r.m.s. [mm]", "note"), rows)).split("\n")
    assert lines[1:] == [
        "capture   r.m.s.  note",
        "            [mm]",
        "--------  ------  ----",
        "計測        1.50  x",
        "plane-15  -10.25  y",
    ]


def test_terminal_tables_hold_every_cell(data):
    for table in tables(data):
        text = text_table(table)
        assert all(cell_text(cell) in text for row in table.rows for cell in row)
        assert all(note in text for note in table.notes)


def test_one_reason_has_one_note_whatever_the_numbers(data, evaluations):
    """Of 27 rows by several devices there were 13 notes that differed by their numbers, which the rows have."""
    pairs = zip(evaluations, (3, 5, 3, 0), strict=True)
    some = tuple(dataclasses.replace(e, excluded=n, excluded_rule=f"{n} not decoded" if n else "") for e, n in pairs)
    table = tables(dataclasses.replace(data, evaluations=some))[-1]
    at = table.columns.index("excluded")
    assert sorted(cell_text(row[at]) for row in table.rows) == ["0", "3 (a)", "3 (a)", "5 (a)"]
    assert [note for note in table.notes if "excluded" in note] == ["(a) excluded: not decoded"]
