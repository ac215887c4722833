"""The summary's sentences carry the figures, the warnings and what is missing."""

import dataclasses

import numpy as np
import pytest

from core.model import Verdict
from core.report import Number, ReportData, cell_text, summary
from core.report.data import side_by_side
from core.report.numbers import plane_table
from core.report.words import highlights


def test_findings_name_the_figures(data, evaluations):
    text = " ".join(summary(data).findings)
    assert "96 image points of 8 stations to 12 object points in 5 iterations: σ0 = 1.050" in text
    assert "0.28 and 0.24 µm (x and y) in the image of the camera" in text
    assert "17 of 17 parameters" in text  # 18 less the one held fixed
    assert "it covers 50% of the image" in text  # 215424 of 748 · 576 pixels
    rms = sorted(e.rms_mm for e in evaluations if e.method == "photogrammetric")
    assert f"photogrammetric method: {rms[0]:.3f} to {rms[1]:.3f} mm" in text
    assert "published for these angles: 0.031 to 0.040 mm" in text
    assert "7 of 4327 valid pixels were left out" in text  # 4 · 1080 + 7


@pytest.mark.parametrize(
    ("predicted", "state", "said"),
    [
        (0.029, "passed", "noise dominates"),
        (0.029, "doubtful", "other errors exceed the noise"),
        (0.02, "passed", "other errors exceed the noise"),
    ],
)
def test_the_noise_dominates_only_where_the_verdict_says_so(data, evaluations, predicted, state, said):
    """The deviations have a spread of 0.03 mm; the ratio turns at √2 times the prediction."""
    one = dataclasses.replace(evaluations[0], predicted_rms_mm=predicted, verdict=Verdict(state))
    assert said in " ".join(summary(dataclasses.replace(data, evaluations=(one,))).findings)


def test_form_that_the_calibration_explains_is_not_called_noise(data, evaluations):
    one = dataclasses.replace(evaluations[0], predicted_rms_mm=0.029, verdict=Verdict("passed"), noisy=False)
    told = " ".join(summary(dataclasses.replace(data, evaluations=(one,))).findings)
    assert "the sigmas of the calibration explain the rest" in told
    assert "noise dominates" not in told


def test_planes_that_nobody_judged_are_not_called_noise(data, evaluations):
    assert "noise dominates" not in " ".join(summary(dataclasses.replace(data, evaluations=evaluations)).findings)


def test_warnings_of_all_calibrations_are_told_once(data):
    assert summary(data).warnings == (
        "Network: no images rolled by 90°: A3 and x0 are weak",
        "Depth calibration: sparse",
    )


def test_normalised_errors_are_judged_against_truth(data):
    # one of 17 errors is 1.5 sigma, the others are zero
    assert f"r.m.s. of {np.sqrt(1.5**2 / 17):.2f}" in " ".join(summary(data).findings)


@pytest.mark.parametrize(
    ("left_out", "said"),
    [
        (("adjustment", "photogrammetric"), "There is no photogrammetric calibration"),
        (("adjustment",), "The adjustment itself was not kept"),
        (("depth",), "There is no polynomial depth calibration"),
        (("evaluations",), "No plane was evaluated"),
    ],
)
def test_missing_parts_are_named(data, left_out, said):
    empty = {name: () if name == "evaluations" else None for name in left_out}
    missing = summary(dataclasses.replace(data, **empty)).missing
    assert any(said in text for text in missing)
    assert summary(data).missing == ()


def test_a_plane_that_one_method_did_not_evaluate_is_named(data, evaluations):
    text = summary(dataclasses.replace(data, evaluations=evaluations[:3])).missing
    assert text == ("plane-15 was not evaluated by the polynomial method.",)


def test_figures_that_do_not_exist_are_dashes(data, evaluations):
    """One axis only: no residuals in y; a plane without a single pixel."""
    camera = dataclasses.replace(data.photogrammetric.camera, residual_rms_um=(0.3, float("nan")))
    nothing = dataclasses.replace(evaluations[0], n=0, rms_mm=float("nan"), max_mm=float("nan"))
    changed = dataclasses.replace(
        data,
        photogrammetric=dataclasses.replace(
            data.photogrammetric, devices={**data.photogrammetric.devices, "camera": camera}, sigma0=float("nan")
        ),
        evaluations=(nothing,),
    )
    text = " ".join(summary(changed).findings)
    assert "nan" not in text
    assert "0.30 and – µm" in text
    assert "no pixel could be evaluated" in text
    assert not any("nan" in h.value for h in highlights(changed))


def test_empty_report_says_what_is_missing(project):
    result = summary(ReportData(project))
    assert result.findings == ()
    assert len(result.missing) == 3


def test_a_small_rig_keeps_its_digits(data, evaluations):
    small = tuple(
        dataclasses.replace(e, rms_mm=e.rms_mm * 1e-3, max_mm=e.max_mm * 1e-3, min_mm=e.min_mm * 1e-3)
        for e in evaluations
    )
    of_small, of_usual = (dataclasses.replace(data, evaluations=e) for e in (small, evaluations))
    told = next(h.value for h in highlights(of_small) if h.label.startswith("plane-table"))
    values = [e.rms_mm for e in small if e.method == "photogrammetric"]
    low, high = (float(word) for word in told.removesuffix(" mm").split(" to "))
    assert (low, high) == pytest.approx((min(values), max(values)), rel=0.05)
    for row, e in zip(plane_table(small, None).rows, side_by_side(small), strict=True):
        shown = [float(cell.text) for cell in row if isinstance(cell, Number) and "." in cell.text]
        assert shown[:3] == pytest.approx([e.rms_mm, e.max_mm, e.min_mm], rel=0.05)
    assert [len(cell_text(c)) for c in plane_table(of_usual.evaluations, None).rows[0][5:8]] == [6, 5, 6]
