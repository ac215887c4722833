"""Networks whose files are wrong in ways that leave no residual: each is named, and sound ones are not accused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.calibrate import adjust, calibrate_photogrammetric
from core.checks import nominal_concerns, uneven_axes
from core.errors import InputError
from core.model import AdjustedDevice, Network, NetworkScale
from core.pipeline.calibrate import adjust_network
from core.pipeline.judge import judge_adjustment
from core.project import write_network
from tests.core.calibrate.conftest import CAMERA, CAMERA_TRUTH, simulated_network
from tests.core.checks.rigs import simulate

SOUND = simulated_network(seed=3, use=("camera",), approximation_mm=1.0).network
KNOWN_MM = 0.05


def told(network: Network) -> tuple[str, ...]:
    verdict = judge_adjustment(adjust(network)).verdict
    assert verdict.state in ("passed", "doubtful")
    return verdict.because if verdict.state == "doubtful" else ()


def from_the_centre(n: Network) -> Network:
    return replace(n, observation_uv=n.observation_uv - (np.array([CAMERA.width, CAMERA.height]) - 1) / 2)


def a_station_twice(n: Network) -> Network:
    again = n.observation_station == 4
    return replace(
        n,
        station_names=(*n.station_names, "again"),
        station_device=(*n.station_device, n.station_device[4]),
        station_pose=(*n.station_pose, max(n.station_pose) + 1),
        observation_station=np.append(n.observation_station, np.full(again.sum(), len(n.station_names))),
        observation_point=np.append(n.observation_point, n.observation_point[again]),
        observation_uv=np.vstack([n.observation_uv, n.observation_uv[again]]),
        observation_sigma=np.vstack([n.observation_sigma, n.observation_sigma[again]]),
    )


def times(scale: NetworkScale, factor: float) -> NetworkScale:
    return replace(scale, length_mm=scale.length_mm * factor, sigma_mm=scale.sigma_mm * factor)


def surer(n: Network) -> Network:
    sigma = n.observation_sigma.copy()
    sigma[n.observation_station == 4] /= 30
    return replace(n, observation_sigma=sigma)


def half_surer(n: Network) -> Network:
    sigma = n.observation_sigma.copy()
    sigma[n.observation_station % 2 == 0] /= 2
    return replace(n, observation_sigma=sigma)


def half_noisier(n: Network) -> Network:
    """Every second image moved a little more than the file says."""
    own = n.observation_station % 2 == 0
    more = np.random.default_rng(5).normal(0, np.sqrt(8) * n.observation_sigma[own])
    uv = n.observation_uv.copy()
    uv[own] += more
    return replace(n, observation_uv=uv)


def rows_noisier(n: Network) -> Network:
    uv = n.observation_uv.copy()
    uv[:, 1] += np.random.default_rng(6).normal(0, np.sqrt(8) * n.observation_sigma[:, 1])
    return replace(n, observation_uv=uv)


def in_metres(n: Network) -> Network:
    return replace(n, point_xyz_mm=n.point_xyz_mm / 1000, scale=times(n.scale, 1e-3))


def longer(n: Network) -> Network:
    return replace(n, scale=times(n.scale, 1.1))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (from_the_centre, "observations by camera lie outside its 748 x 576 px"),
        (a_station_twice, f"observations of again are those of {SOUND.station_names[4]}: remove one of the two"),
        (surer, f"sigma_px of station {SOUND.station_names[4]} is 0.00067, of the other images by camera 0.02, but"),
        (half_surer, "is 0.01, of the other images by camera 0.02, but by the residuals it is 2"),
        (half_noisier, "times too small beside theirs (F test of 6 and 6 images)"),
        (rows_noisier, "times as large in v as in u (F test): the sigmas of v are too small"),
        (in_metres, "give coordinates and lengths in mm, not in m"),
        (longer, "whose points keep their shape: correct the length"),
    ],
)
def test_what_no_residual_shows_is_named(change: Callable[[Network], Network], words: str) -> None:
    assert words in told(change(SOUND))[0]


@pytest.mark.parametrize("axis", [0, 1])
def test_images_that_are_mirrored_adjust_to_a_mirrored_field(axis: int) -> None:
    uv = SOUND.observation_uv.copy()
    uv[:, axis] = (CAMERA.width, CAMERA.height)[axis] - 1 - uv[:, axis]
    verdict = judge_adjustment(adjust(replace(SOUND, observation_uv=uv))).verdict
    assert verdict.state == "failed"
    assert "adjusted to the mirror image of their coordinates" in verdict.because[0]
    left = SOUND.point_xyz_mm * (1, 1, -1)
    assert judge_adjustment(adjust(replace(SOUND, point_xyz_mm=left))).verdict.state == "failed"


def test_images_that_fit_only_when_mirrored_are_bad_input(tmp_path: Path) -> None:
    deep = simulated_network(seed=3, use=("camera",), approximation_mm=1.0, depth_mm=100.0).network
    uv = deep.observation_uv * (1, -1) + (0, CAMERA.height - 1)
    write_network(tmp_path, replace(deep, observation_uv=uv))
    with pytest.raises(
        InputError, match=r"observations\.csv: camera: images fit the points only when they are mirrored"
    ):
        adjust_network(tmp_path)


@pytest.mark.parametrize("seed", range(8))
def test_a_flat_field_whose_heights_are_rough_is_not_called_mirrored(seed: int) -> None:
    made = simulated_network(seed=seed, use=("camera",), approximation_mm=0.0, depth_mm=0.0)
    rough = made.network.point_xyz_mm + np.random.default_rng(seed).normal(0, 0.3, made.network.point_xyz_mm.shape)
    assert not any("mirror" in text for text in told(replace(made.network, point_xyz_mm=rough)))


def test_a_single_known_point_that_is_off_is_named() -> None:
    made = simulated_network(seed=3, use=("camera",), scale=False)
    xyz = made.points_mm + np.random.default_rng(0).normal(0, KNOWN_MM, made.points_mm.shape)
    known = replace(made.network, point_xyz_mm=xyz, point_sigma_mm=np.full(xyz.shape, KNOWN_MM))
    assert told(known) == ()
    xyz[20, 1] += 10 * KNOWN_MM
    assert f"y_mm of point {known.point_names[20]} is off by" in told(known)[0]


@pytest.mark.parametrize("seed", range(4))
def test_one_of_four_known_points_is_named_though_the_datum_follows_it(seed: int) -> None:
    """Seven of twelve coordinates make the datum: the wrong one was off by 4 to 6 of its sigmas, which 16 passed."""
    made = simulated_network(seed=seed, use=("camera",), scale=False, approximation_mm=1.0)
    corners = [0, 7, 40, 47]  # of 6 x 8 points
    rng, xyz, sigma = np.random.default_rng(seed), made.network.point_xyz_mm.copy(), np.full((48, 3), np.inf)
    sigma[corners] = KNOWN_MM
    xyz[corners] = made.points_mm[corners] + rng.normal(0, KNOWN_MM, (4, 3))
    known = replace(made.network, point_xyz_mm=xyz, point_sigma_mm=sigma)
    assert told(known) == ()
    xyz[corners[0], 0] += 15 * KNOWN_MM
    verdict = judge_adjustment(adjust(known)).verdict
    assert verdict.state != "passed"
    assert f"point {known.point_names[corners[0]]} " in verdict.because[0]


@pytest.mark.parametrize("seed", range(3))
def test_of_two_known_points_one_that_a_single_image_shows_holds_nothing(seed: int) -> None:
    """All turned about its ray, and "images fit the points only when they are mirrored"."""
    made = simulated_network(seed=seed, use=("camera",), scale=False, approximation_mm=1.0)
    network, sigma = made.network, np.full((48, 3), np.inf)
    sigma[[0, 47]] = KNOWN_MM
    keep = (network.observation_point != 47) | (network.observation_station == 3)
    parts = ("observation_station", "observation_point", "observation_uv", "observation_sigma")
    few = {name: getattr(network, name)[keep] for name in parts}
    found = adjust(replace(network, point_sigma_mm=sigma, **few))
    assert f"left out, not seen by two rays: point {network.point_names[47]}" in found.warnings
    assert judge_adjustment(found).verdict.state == "passed"


@pytest.mark.parametrize("seed", range(3))
def test_rough_places_of_another_scale_are_not_accused(seed: int) -> None:
    sound = simulated_network(seed=seed, approximation_mm=20.0).network
    assert told(sound) == ()
    assert told(replace(sound, point_xyz_mm=sound.point_xyz_mm * 1.04)) == ()


def sharper(n: Network, sharp: np.ndarray) -> Network:
    """Let all other images be blurred to four times the noise, and their sigmas say so."""
    sigma = np.where(sharp, 1, 4)[:, None] * n.observation_sigma
    blur = np.random.default_rng(7).normal(0, np.sqrt(sigma**2 - n.observation_sigma**2))
    return replace(n, observation_uv=n.observation_uv + blur, observation_sigma=sigma)


def test_images_that_are_sharper_than_others_are_not_accused() -> None:
    assert told(sharper(SOUND, SOUND.observation_station % 4 == 0)) == ()


@pytest.mark.parametrize("seed", range(8))
def test_sigmas_that_are_off_by_little_are_not_accused(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, cols = [(3, 5), (6, 8)][seed % 2]
    made = simulated_network(seed=seed, use=("camera",), approximation_mm=1.0, rows=rows, cols=cols, scale=False)
    off = np.exp(0.1 * rng.normal(size=len(made.stations)))[made.network.observation_station]
    assert told(replace(made.network, observation_sigma=made.network.observation_sigma * off[:, None])) == ()


@pytest.mark.parametrize("seed", range(3))
def test_half_of_many_images_of_few_points_are_named_by_their_sigmas_and_sound_ones_are_not(seed: int) -> None:
    made = simulated_network(seed=seed, poses=20, use=("camera",), approximation_mm=1.0, rows=3, cols=4, scale=False)
    assert told(made.network) == ()
    assert any("times too small beside theirs" in text for text in told(half_surer(made.network)))


def test_an_axis_of_a_calibration_that_claims_too_much_is_named() -> None:
    made = simulate("paper", 1)
    surer = [replace(t, projector_sigma=t.projector_sigma * [1, 0.3]) for t in made.fields]
    for fields, accused in ((made.fields, 0), (surer, 1)):
        _, adjustment = calibrate_photogrammetric(made.rig, made.board, fields, scale=made.scale)
        assert len(uneven_axes(adjustment)) == accused
    assert uneven_axes(adjustment)[0].text.startswith("projector: residuals over sigmas are 3")


@pytest.mark.parametrize("px", [0.3, 1.0])
def test_a_few_gross_errors_do_not_accuse_the_sigmas_of_a_sharp_image(px: float) -> None:
    found = sharper(SOUND, SOUND.observation_station % 4 == 0)
    uv, own = found.observation_uv.copy(), np.flatnonzero(found.observation_station == 4)
    uv[own[[5, 17, 30]]] += px
    because = judge_adjustment(adjust(replace(found, observation_uv=uv))).verdict.because
    assert any(f"errors (normalised residual above 4.9): station {SOUND.station_names[4]}" in t for t in because)
    assert not any("sigma_px of station" in text for text in because)


def test_what_all_images_fail_to_hold_does_not_accuse_the_sigmas_of_a_sharp_one() -> None:
    """The principal point is held at a wrong place."""
    found = simulated_network(
        seed=8,
        use=("camera",),
        approximation_mm=1.0,
        rows=3,
        cols=4,
        scale=False,
        estimate=("c",),
        camera_truth=replace(CAMERA_TRUTH, a=(0.0,) * 6),
    ).network
    verdict = judge_adjustment(adjust(sharper(found, np.isin(found.observation_station, (1, 2))))).verdict
    assert verdict.state == "failed"
    assert not any("sigma_px of station" in text for text in verdict.because)


@pytest.mark.parametrize(("part", "state"), [(0.1, "passed"), (0.25, "doubtful"), (1.0, "failed")])
def test_residuals_of_a_hundredth_of_a_pixel_fail_nothing_however_small_the_sigmas(part: float, state: str) -> None:
    """Five times what the sigmas allow: coarsely rendered dots were off by 0.009 and 0.014 px at a noise of 0.002."""
    made = simulated_network(seed=5, use=("camera",), noise=0.0, approximation_mm=1.0)
    seen, sigma = made.network.observation_uv, made.network.observation_sigma
    off = np.random.default_rng(7).normal(size=seen.shape) * 0.05 * part
    network = replace(made.network, observation_uv=seen + off, observation_sigma=np.full_like(sigma, 0.01 * part))
    verdict = judge_adjustment(adjust(network)).verdict
    assert verdict.state == state
    words = " ".join(verdict.because)
    assert ("times what the sigmas of its observations allow" in words) == (state != "passed")
    assert ("coarse rendering" in words) == (state == "doubtful")
    assert ("px, more than by their noise alone" in words) == (state == "passed")


def test_columns_alone_are_held_against_the_image_without_a_warning() -> None:
    """Warnings are errors here: what was never observed has no extent."""
    made = simulated_network(seed=3, approximation_mm=1.0).network
    uv, own = made.observation_uv.copy(), np.array(made.station_device)[made.observation_station] == "projector"
    uv[own] = np.column_stack([uv[own, 0] + 400, np.full(own.sum(), np.nan)])
    texts = [text for text in told(replace(made, observation_uv=uv)) if "outside its 640 x 640 px (u " in text]
    assert len(texts) == 1
    assert "nan" not in texts[0]


def test_a_principal_point_that_was_foretold_is_far_off_for_nobody() -> None:
    """Of a region of the sensor's: it stayed doubtful, whatever was given before."""
    known = replace(CAMERA_TRUTH, x0_mm=0.4 * CAMERA.width * CAMERA.pitch_mm[0])
    sigma = np.array([0.01, 0.02, 0.02, *np.zeros(6)])
    for foretold in (False, True):
        spec = replace(CAMERA, interior=known, interior_sigma=tuple(sigma)) if foretold else CAMERA
        device = AdjustedDevice(spec, known, sigma / 10, (0.0, 0.0), 1)
        found = [concern.text for concern in nominal_concerns({"camera": device})]
        assert any("principal point" in text for text in found) != foretold
