"""Control points: resection and intersection as textbooks have them, seen by the collinearity equations written out."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from core.calibrate import adjust
from core.errors import AdjustmentError, InputError
from core.model import NetworkScale
from core.pipeline.judge import judge_adjustment
from core.project import read_network

C_MM, PITCH_MM, WIDTH, HEIGHT = 8.0, 0.0045, 1600, 1200
SIGMA_PX = 0.05
PLACES = {"left": (-180.0, 20.0, 450.0), "right": (170.0, -30.0, 480.0)}


def seen_from(name: str, point: np.ndarray) -> np.ndarray:
    """Pixel of a point from one of the places, looking at the origin."""
    place = np.array(PLACES[name])
    turn = Rotation.align_vectors([[0, 0, 1]], [place / np.linalg.norm(place)])[0].as_matrix()
    X, Y, Z = turn @ (point - place)
    x, y = -C_MM * X / Z, -C_MM * Y / Z
    return np.array([x / PITCH_MM + (WIDTH - 1) / 2, (HEIGHT - 1) / 2 - y / PITCH_MM])


def network_of(folder: Path, points, told, sigma, seen):  # type: ignore[no-untyped-def]
    """Write a network of a camera that is known; `seen` maps stations to the numbers of the points they see."""
    camera = {"width": WIDTH, "height": HEIGHT, "pitch_mm": [PITCH_MM] * 2, "nominal_c_mm": C_MM, "estimate": []}
    stations = {name: {"device": "cam"} for name in seen}
    data = {"format": "stripe-network", "version": 2, "devices": {"cam": camera}, "stations": stations}
    (folder / "network.json").write_text(json.dumps(data))
    with open(folder / "points.csv", "w", newline="") as file:
        write = csv.writer(file).writerow
        write(["point", "x_mm", "y_mm", "z_mm", "sigma_x_mm", "sigma_y_mm", "sigma_z_mm"])
        for i, (xyz, s) in enumerate(zip(told, sigma, strict=True)):
            write([f"P{i}", *xyz, *([s] * 3 if np.isfinite(s) else [""] * 3)])
    rng = np.random.default_rng(5)
    with open(folder / "observations.csv", "w", newline="") as file:
        write = csv.writer(file).writerow
        write(["station", "point", "u", "v", "sigma_px"])
        for name, numbers in seen.items():
            for i in numbers:
                uv = seen_from(name, points[i]) + rng.normal(0, SIGMA_PX, 2)
                write([name, f"P{i}", *uv, SIGMA_PX])
    return read_network(folder)


@pytest.mark.parametrize("seed", range(8))
def test_new_points_are_intersected_from_control_however_rough_their_places(seed, tmp_path):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-100, 100, (9, 3))
    sigma = np.where(np.arange(9) < 5, 0.0, np.inf)
    told = points + np.where(np.isinf(sigma), 1.0, 0.0)[:, None] * rng.normal(0, 200, points.shape)
    result = adjust(network_of(tmp_path, points, told, sigma, dict.fromkeys(PLACES, range(9))))
    new = slice(5, None)
    sigmas = np.sqrt(np.diagonal(result.point_cov_mm2[new], axis1=1, axis2=2)) / result.sigma0
    assert np.abs((result.points_mm[new] - points[new]) / sigmas).max() < 4.5
    assert np.array_equal(result.points_mm[:5], points[:5])


def test_points_held_at_one_place_but_seen_apart_are_refused(tmp_path):
    """Three of them gave sigma0 696, failed; what is held exactly was never doubted by name."""
    points = np.random.default_rng(1).uniform(-100, 100, (9, 3))
    told = points.copy()
    told[[3, 4]] = told[2]
    with pytest.raises(InputError, match=r"points.csv.*'P2' and 'P3' are held at one place.*'left'"):
        network_of(tmp_path, points, told, np.zeros(9), dict.fromkeys(PLACES, range(9)))


@pytest.mark.parametrize("seed", range(8))
def test_four_control_points_orient_an_image(seed, tmp_path):
    points = np.random.default_rng(seed).uniform(-100, 100, (4, 3))
    result = adjust(network_of(tmp_path, points, points, np.zeros(4), {"left": range(4)}))
    assert result.redundancy == 2
    assert np.sqrt(result.redundancy) * result.sigma0 < 4.0
    pose = result.station_from_object[0]
    assert np.linalg.norm(-pose.rotation.T @ pose.translation_mm - PLACES["left"]) < 2.0


def test_control_ties_images_together_and_what_nobody_sees_is_no_hindrance(tmp_path):
    points = np.random.default_rng(1).uniform(-100, 100, (13, 3))
    seen = {"left": range(6), "right": range(6, 12)}
    result = adjust(network_of(tmp_path, points, points, np.zeros(13), seen))
    assert result.redundancy == 2 * 12 - 2 * 6
    assert 0.5 < result.sigma0 < 1.7  # chi-square of 12 degrees of freedom, 1 in 1000
    assert result.warnings == ("left out, not seen by two rays: point P12",)
    loose = np.where(np.isin(np.arange(13), [2, 3, 4, 5]), np.inf, 0.0)
    with pytest.raises(AdjustmentError, match=r"every station needs 4 points .* or that are known"):
        adjust(network_of(tmp_path, points, points, np.where(np.arange(13) > 7, np.inf, loose), seen))


def test_control_that_the_images_contradict_is_never_passed(tmp_path):
    rng = np.random.default_rng(2)
    points, sigma = rng.uniform(-100, 100, (9, 3)), np.full(9, 0.1)
    everywhere = dict.fromkeys(PLACES, range(9))
    sound = judge_adjustment(
        adjust(network_of(tmp_path, points, points + rng.normal(0, 0.1, (9, 3)), sigma, everywhere))
    )
    assert sound.verdict.state == "passed"
    told = points.copy()
    told[3, 0] += 3.0
    judged = judge_adjustment(adjust(network_of(tmp_path, points, told, sigma, everywhere)))
    assert judged.verdict.state != "passed"
    assert any("points.csv: x_mm" in text and "point P3" in text for text in judged.verdict.because)
    network = network_of(tmp_path, points, points, np.full(9, np.inf), everywhere)
    inches = NetworkScale(0, 1, float(np.linalg.norm(points[0] - points[1])) / 25.4, 0.001)
    judged = judge_adjustment(adjust(replace(network, scale=inches)))
    assert "inches instead of mm" in judged.verdict.because[0]


@pytest.mark.parametrize(
    ("factor", "scaled", "state"), [(1, True, "passed"), (3, True, "doubtful"), (3, False, "passed")]
)
def test_sigmas_stated_too_large_are_told_and_doubtful_beside_a_length(simulate, factor, scaled, state):
    """The length's sigma is multiplied by σ0 with all others; without one the sigmas stated do not matter."""
    network = simulate(seed=2, scale=scaled).network
    judged = judge_adjustment(adjust(replace(network, observation_sigma=factor * network.observation_sigma)))
    assert judged.verdict.state == state
    assert any("multiply sigma_px by 0.3" in text for text in judged.verdict.because) == (state == "doubtful")
    assert any("larger than the residuals show" in text for text in judged.verdict.because) == (not scaled)


def test_gross_errors_are_named_before_the_residuals_that_they_cause(simulate):
    network = simulate(seed=1).network
    uv = network.observation_uv.copy()
    uv[40] += 30.0
    told = judge_adjustment(adjust(replace(network, observation_uv=uv))).verdict
    assert told.state == "failed"
    station, point = network.observation_station[40], network.observation_point[40]
    assert f"station {network.station_names[station]} point {network.point_names[point]} " in told.because[0]


@pytest.mark.parametrize("axes", [[0, 1], [2]])
def test_coordinates_known_in_part_that_leave_a_flat_field_open_are_refused_by_name(simulate, axes):
    """Of a plane known in x and y alone, or in z alone, a turn or the scale changes what is known by its square."""
    network = simulate(seed=4, use=("camera",), scale=False, approximation_mm=1.0).network
    sigma, known = np.full(network.point_xyz_mm.shape, np.inf), [10, 13, 34, 37]
    sigma[np.ix_(known, axes)] = 10.0
    with pytest.raises(InputError, match=r"points\.csv: sigmas of .* of 4 points leave a turn or the scale"):
        adjust(replace(network, point_sigma_mm=sigma))
    sigma[known] = 2.0
    assert judge_adjustment(adjust(replace(network, point_sigma_mm=sigma))).verdict.state == "passed"
