"""What is known before against what the images say: adjusted values follow both, and residuals of images hardly any."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import adjust
from core.geometry import Pose, matrix_from_axis_angle
from core.model import Interior, Network, NetworkScale
from core.pipeline.judge import judge_adjustment
from tests.core.calibrate.conftest import CAMERA, CAMERA_TRUTH, simulated_network

SOUND = simulated_network(seed=3, use=("camera",), scale=False)
OF_IMAGES = adjust(SOUND.network).devices["camera"]  # nothing is known before there
NAMES = ("c_mm", "x0_mm", "y0_mm", "A1", "A2", "A3", "A4", "A5", "A6")


def judged(network: Network):
    return judge_adjustment(adjust(network)).verdict


def knowing(key: str, off: float, share: float) -> Network:
    """Know a parameter with a sigma of a `share` of what images leave, `off` combined sigmas beside what they say."""
    k, vector, sigmas = NAMES.index(key), CAMERA_TRUTH.vector.copy(), np.full(9, np.inf)
    sigmas[k] = share * OF_IMAGES.sigma[k]
    vector[k] = OF_IMAGES.interior.vector[k] + off * np.hypot(sigmas[k], OF_IMAGES.sigma[k])
    device = SOUND.network.devices["camera"]
    spec = replace(device.spec, interior=Interior.from_vector(vector, CAMERA_TRUTH.r0_mm), interior_sigma=tuple(sigmas))
    return replace(SOUND.network, devices={"camera": replace(device, spec=spec)})


@pytest.mark.parametrize("share", [0.02, 0.3, 3.0])
@pytest.mark.parametrize("key", ["c_mm", "A1", "A3"])
def test_what_is_known_of_a_lens_counts_by_what_both_leave_open(key: str, share: float) -> None:
    """The adjusted value lies between both by their weights: of a sure one it is hardly off, however wrong it is."""
    assert judged(knowing(key, 2.5, share)).state == "passed"
    for off, state in ((7.0, "doubtful"), (14.0, "failed")):
        verdict = judged(knowing(key, off, share))
        assert (verdict.state, verdict.because[0].startswith(f"camera: {key} is ")) == (state, True), verdict.because
        said = float(verdict.because[0].split(" is ")[1].split(" ± ")[0])
        k = NAMES.index(key)
        assert said == pytest.approx(OF_IMAGES.interior.vector[k], abs=0.5 * OF_IMAGES.sigma[k] + 1e-5 * abs(said))


@pytest.mark.parametrize(("off", "state"), [(2.5, "passed"), (7.0, "doubtful")])
def test_a_length_beside_known_points_counts_by_what_both_leave_open(off: float, state: str) -> None:
    """Control points of 0.2 mm give way to a length of 0.001 mm, all of them a little."""
    rng, true = np.random.default_rng(5), SOUND.points_mm
    known = true + rng.normal(0, 0.2, true.shape)
    held = replace(SOUND.network, point_xyz_mm=known, point_sigma_mm=np.full(true.shape, 0.2))
    bar = NetworkScale(0, len(true) - 1, float(np.linalg.norm(true[0] - true[-1])), 1e6)
    free = adjust(replace(held, scale=bar))
    by_points = float(np.linalg.norm(free.points_mm[0] - free.points_mm[-1]))
    sure = free.length_sigma_mm[0] / free.sigma0
    given = replace(bar, length_mm=by_points + off * np.hypot(sure, 0.001), sigma_mm=0.001)
    verdict = judged(replace(held, scale=given))
    assert verdict.state == state
    if state != "passed":
        said = float(verdict.because[0].split("by all else ")[1].split(" mm")[0])
        assert said == pytest.approx(by_points, abs=0.3 * sure)


@pytest.mark.parametrize("poses", [5, 24])
def test_sigmas_of_lengths_agree_with_monte_carlo(poses: int) -> None:
    """Points eliminated, or poses: a distance has the covariances of its ends between them."""
    found, told = [], []
    truth = Interior(12.1, 0.0, 0.0, (0.0,) * 6, CAMERA.zero_radius_mm)
    options = {"rows": 4, "cols": 5, "estimate": ("c",), "camera_truth": truth, "scale": False}
    for seed in range(40):
        network = simulated_network(seed=seed, use=("camera",), poses=poses, **options)
        true = network.points_mm
        lengths = [float(np.linalg.norm(true[a] - true[b])) for a, b in ((6, 13), (8, 11))]
        scale = NetworkScale(6, 13, lengths[0] + np.random.default_rng(seed).normal(0, 0.01), 0.01)
        rough = NetworkScale(8, 11, lengths[1], 1e4)  # so rough that the images alone give it
        result = adjust(replace(network.network, scale=scale, lengths=(rough,)))
        found.append(float(np.linalg.norm(result.points_mm[8] - result.points_mm[11])) - lengths[1])
        told.append(result.length_sigma_mm[1])
    assert np.std(found) / np.mean(told) == pytest.approx(1, abs=0.36)  # 40 draws: 3.2 sigmas of 0.11


def _turned_over(network: Network, device: str, some: slice) -> Network:
    """Count v upwards in some stations of a device."""
    height = network.devices[device].spec.height
    stations = [k for k, of in enumerate(network.station_device) if of == device][some]
    own = np.isin(network.observation_station, stations)
    uv = network.observation_uv.copy()
    uv[own, 1] = height - 1 - uv[own, 1]
    return replace(network, observation_uv=uv)


@pytest.mark.parametrize("some", [slice(None), slice(0, 3)])
@pytest.mark.parametrize("device", ["camera", "projector"])
def test_free_stations_that_see_a_flat_board_from_behind_are_named(device: str, some: slice) -> None:
    if device == "camera" and some == slice(None):
        some = slice(0, 5)  # of twelve: all of them would leave the projector as the odd one
    network = simulated_network(seed=2, depth_mm=0.0, rigid=False).network
    assert judged(network).state == "passed"
    verdict = judged(_turned_over(network, device, some))
    names = [n for n, of in zip(network.station_names, network.station_device, strict=True) if of == device][some]
    assert verdict.state != "passed"
    told = f"observations.csv: {', '.join(names[:8])}"
    assert any(text.startswith(told) and "from the other side" in text for text in verdict.because), verdict.because


@pytest.mark.parametrize(("factor", "state"), [(1.3, "passed"), (3.0, "doubtful")])
@pytest.mark.parametrize("rigid", [True, False])
def test_sigmas_of_one_device_too_large_beside_the_other_are_named(rigid: bool, factor: float, state: str) -> None:
    network = simulated_network(seed=4, rigid=rigid, scale=False).network
    of_projector = np.array(network.station_device)[network.observation_station] == "projector"
    sigma = np.where(of_projector[:, None], factor, 1.0) * network.observation_sigma
    verdict = judged(replace(network, observation_sigma=sigma))
    assert verdict.state == state
    if state != "passed":
        assert verdict.because[0].startswith("projector: residuals are 0.3")
    assert judged(replace(network, observation_sigma=3 * network.observation_sigma)).state == "passed"  # both alike


def test_stations_that_see_one_row_of_the_board_are_left_out() -> None:
    """The pose was anywhere about the row, and passed."""
    network = SOUND.network
    row = network.observation_point < 8
    use = (network.observation_station != 3) | row
    assert np.count_nonzero(use & (network.observation_station == 3)) >= 5
    parts = ("observation_station", "observation_point", "observation_uv", "observation_sigma")
    result = judge_adjustment(adjust(replace(network, **{part: getattr(network, part)[use] for part in parts})))
    assert result.verdict.state == "doubtful"
    assert "left out, all its points lie on one line: station 4/camera" in result.verdict.because[0]
    assert "4/camera" not in result.network.station_names


@pytest.mark.parametrize("seed", range(6))
def test_stations_of_four_points_of_a_deep_field_are_oriented(seed: int) -> None:
    """Three of four points fit some pose exactly: which of them is wrong, nothing tells."""
    network = simulated_network(seed=seed, use=("camera",), depth_mm=60.0, approximation_mm=0.5, scale=False).network
    rng, use = np.random.default_rng(seed), np.ones(len(network.observation_point), bool)
    for station in range(6, 12):
        own = np.flatnonzero(network.observation_station == station)
        use[np.setdiff1d(own, rng.choice(own, 4, replace=False))] = False
    parts = ("observation_station", "observation_point", "observation_uv", "observation_sigma")
    result = adjust(replace(network, **{part: getattr(network, part)[use] for part in parts}))
    assert result.sigma0 == pytest.approx(1.0, abs=0.15)
    assert len(result.network.station_names) == 12


@pytest.mark.parametrize("depth_mm", [0.0, 60.0])
def test_a_very_long_lens_far_away_is_oriented(depth_mm: float) -> None:
    """An image of a third of a degree, in which rays are nearly parallel."""
    lens = replace(SOUND.network.devices["camera"].spec, nominal_c_mm=1000.0)
    truth = Interior(1005.0, 0.0, 0.0, (0.0,) * 6, lens.zero_radius_mm)
    rng = np.random.default_rng(1)
    poses = [
        Pose(
            matrix_from_axis_angle([0, 0, 1], k * np.pi / 2)
            @ matrix_from_axis_angle([np.cos(k), np.sin(k), 0], rng.uniform(0.3, 0.6)),
            np.array([*rng.normal(scale=5.0, size=2), -45e3 * rng.uniform(0.95, 1.05)]),
        )
        for k in range(10)
    ]
    network = simulated_network(
        camera=lens, camera_truth=truth, use=("camera",), estimate=("c",), depth_mm=depth_mm, approximation_mm=0.3,
        camera_poses_given=poses, scale=False,
    ).network  # fmt: skip
    result = adjust(network)
    assert result.sigma0 == pytest.approx(1.0, abs=0.1)
    device = result.devices["camera"]
    assert abs(device.interior.c_mm - 1005.0) < 4 * device.sigma[0]
