"""How bright things are: falloff laws, apertures, blur, contrast, the XOR of columns and rows, saturation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf

from core.bench import Board, Scene, lines_of, prepare, truth_maps
from core.bench.optics import DEFOCUS_STEP, PAD, PER_LINE, Lcd, blurred_lines, line_response, pixel_weights
from core.geometry import Pose, matrix_from_axis_angle
from core.patterns import Black, Code, CrossPatternLcd, Line, Phase, White

ALL, NONE = np.ones(96), np.zeros(64)


def at_projector(rig):
    return replace(rig, projector_from_camera=Pose())


def wall_at(distance, turned=None):
    return Scene(
        Board((400.0, 400.0)), Pose(np.eye(3) if turned is None else turned, np.array([0, 0, -distance])), ambient=0.0
    )


def middle(rig, scene):
    light = prepare(rig, scene).light(ALL, NONE)
    return float(light[39:41, 59:61].mean())


def test_white_at_the_reference_distance_has_the_white_level(ideal_rig, wall):
    assert middle(at_projector(ideal_rig), wall) == pytest.approx(100.0, rel=1e-4)


def test_light_falls_with_the_square_of_the_distance(ideal_rig):
    rig = at_projector(ideal_rig)
    assert middle(rig, wall_at(1000.0)) == pytest.approx(25.0, rel=1e-3)


@pytest.mark.parametrize("angle_deg", [20, 40, 60])
def test_light_falls_with_the_cosine_of_incidence(ideal_rig, angle_deg):
    turned = matrix_from_axis_angle([0, 1, 0], np.deg2rad(angle_deg))
    assert middle(at_projector(ideal_rig), wall_at(500.0, turned)) == pytest.approx(
        100 * np.cos(np.deg2rad(angle_deg)), rel=1e-3
    )


def test_camera_and_projector_each_fall_with_the_fourth_power_of_the_cosine(ideal_rig, wall):
    prepared = prepare(at_projector(ideal_rig), wall)
    light = prepared.light(ALL, NONE)
    x, y = np.meshgrid(np.arange(120) - 59.5, np.arange(80) - 39.5)
    cosine = 1 / np.sqrt(1 + (x**2 + y**2) / 500**2)
    inner = np.s_[12:-12, 16:-16]
    np.testing.assert_allclose(light[inner], 100 * cosine[inner] ** 8, rtol=1e-4)
    np.testing.assert_allclose(prepared.room, cosine**4, rtol=1e-4)


def test_ambient_light_reaches_what_the_projector_does_not(ideal_rig, wall):
    scene = replace(wall, ambient=7.0)
    dark = prepare(ideal_rig, scene).light(np.zeros(96), NONE)
    np.testing.assert_allclose(dark[39:41, 59:61], 7.0, rtol=1e-4)
    assert np.all(prepare(ideal_rig, wall).light(np.zeros(96), NONE) < 1e-6)


def test_no_light_outside_the_raster(ideal_rig, wall):
    light = prepare(at_projector(ideal_rig), wall).light(ALL, NONE)
    assert np.all(light[:, :12] == 0)
    assert np.all(light[:, 108:] == 0)
    assert np.all(light[:8] == 0)
    assert np.all(light[8:72, 12:108] > 80)


def test_contrast_is_bright_over_dark(ideal_rig, wall):
    rig = at_projector(replace(ideal_rig, lcd=replace(ideal_rig.lcd, contrast=40.0)))
    prepared = prepare(rig, wall)
    bright, dark = prepared.light(*lines_of(White(), rig)), prepared.light(*lines_of(Black(), rig))
    np.testing.assert_allclose(bright[20:60, 20:100] / dark[20:60, 20:100], 40.0, rtol=1e-4)


def test_columns_and_rows_show_their_exclusive_or(ideal_rig, wall):
    rng = np.random.default_rng(3)
    columns, rows = rng.random(96) > 0.5, rng.random(64) > 0.5
    light = prepare(at_projector(ideal_rig), wall).light(columns, rows)[8:72, 12:108]
    np.testing.assert_array_equal(light > 50, CrossPatternLcd(96, 64).image(columns, rows))


def test_grey_lines_show_their_grey(ideal_rig, wall):
    rig = at_projector(ideal_rig)
    pattern = Phase("x", 12.0, 4, 0, 0.0, "sine")
    light = prepare(rig, wall).light(*lines_of(pattern, rig))[40, 12:108]
    white = prepare(rig, wall).light(ALL, NONE)[40, 12:108]
    np.testing.assert_allclose(light / white, 0.5 + 0.5 * np.cos(2 * np.pi * (np.arange(96) + 0.5) / 12), atol=2e-3)


@pytest.mark.parametrize("sigma", [0.3, 0.7, 1.2])
@pytest.mark.parametrize("fill", [0.7, 1.0])
def test_a_line_is_a_rectangle_blurred_by_a_gaussian(sigma, fill):
    lines = np.zeros(30)
    lines[14] = 1
    table = blurred_lines(lines, fill, np.array([sigma]))[0]
    x = np.arange(table.size) / PER_LINE - PAD - 14
    assert table.sum() / PER_LINE == pytest.approx(fill, rel=1e-6)
    variance = (table * x**2).sum() / table.sum()
    assert variance == pytest.approx(sigma**2 + fill**2 / 12, rel=1e-2)
    np.testing.assert_allclose(table, line_response(x, fill, sigma), atol=1e-9)


@pytest.mark.parametrize("period", [4, 8])
def test_the_modulation_of_a_grating_is_aperture_times_blur(period):
    """Square grating of half period lit: 2/π · sinc(fill / P) / sinc(1 / P) · exp(-2 π² σ² / P²)."""
    fill, sigma = 0.85, 0.6
    on = (np.arange(160) % period < period // 2).astype(float)
    table = blurred_lines(on, fill, np.array([sigma]))[0]
    x = np.arange(table.size) / PER_LINE - PAD
    inner = (x >= 40) & (x < 40 + 10 * period)
    harmonic = 2 * abs(np.mean(table[inner] * np.exp(2j * np.pi * x[inner] / period)))
    # a comb of period lines, each a rectangle: sum of half a period of unit phasors, times the aperture's transform
    comb = abs(np.exp(2j * np.pi * np.arange(period // 2) / period).sum()) / period
    aperture = np.sin(np.pi * fill / period) / (np.pi / period)
    assert harmonic == pytest.approx(2 * comb * aperture * np.exp(-2 * np.pi**2 * sigma**2 / period**2), rel=1e-4)


def test_the_projector_loses_sharpness_off_its_focus():
    lcd = Lcd(blur_lines=0.5, defocus_lines=3.0, focus_mm=600.0)
    # the tabulated widths stand for the middle of their step of |Z_focus / Z - 1|
    assert lcd.table_sigmas()[4] == pytest.approx(np.hypot(0.5, 3 * 4.5 * DEFOCUS_STEP))


@pytest.mark.parametrize("sigma", [0.4, 1.0])
def test_pixel_weights_are_area_and_lens_blur(sigma):
    w = pixel_weights(8, sigma).astype(float)
    x = (np.arange(w.size) - (w.size - 1) / 2) / 8
    assert w.sum() == pytest.approx(1, abs=1e-5)
    assert (w * x**2).sum() == pytest.approx(sigma**2 + 1 / 12, rel=2e-2)
    assert pixel_weights(4, 0.0).tolist() == [0.25] * 4


@pytest.mark.parametrize("sigma_px", [0.5, 1.0])
def test_the_camera_blurs_an_edge_by_its_point_image(blurred, sigma_px):
    rig = at_projector(blurred(lens=sigma_px, subsamples=4))
    half = Scene(Board((400.0, 400.0)), Pose(np.eye(3), np.array([400.25, 0.0, -500.0])), ambient=100.0)
    edge = prepare(rig, half).room[40]  # white from x = 0.25 mm on: u = 59.75
    x = np.arange(120) - 59.75
    s = np.sqrt(2) * sigma_px

    def spread(a):  # integral of the Gaussian's distribution function
        return a / 2 * (1 + erf(a / s)) + s / 2 / np.sqrt(np.pi) * np.exp(-((a / s) ** 2))

    falloff = 1 / (1 + (np.arange(120) - 59.5) ** 2 / 500**2) ** 2
    np.testing.assert_allclose(edge / falloff, spread(x + 0.5) - spread(x - 0.5), atol=0.01)


def test_the_frame_kernel_against_plain_numpy(blurred, wall):
    rig = at_projector(blurred(lens=0.4, blur_lines=0.5, defocus_lines=1.0, fill=0.8, contrast=50.0))
    scene = replace(wall, camera_from_board=Pose(matrix_from_axis_angle([1, 2, 0], 0.5), np.array([3.0, 1.0, -480.0])))
    prepared = prepare(rig, scene)
    s, rng = prepared.samples, np.random.default_rng(4)
    columns, rows = rng.random(96), rng.random(64)
    sigma = rig.lcd.table_sigmas()[s.width]

    def blurred_at(place, lines):
        near = np.clip(np.rint(place).astype(int)[..., None] + np.arange(-6, 7), -1, lines.size)
        value = np.append(lines, [0.0, 0.0])[np.where(near < 0, lines.size + 1, near)]
        value[(near < 0) | (near >= lines.size)] = 0
        response = line_response(place[..., None] - near, 0.8, sigma[..., None])
        window = np.where(
            (near < 0) | (near >= lines.size), 0, line_response(place[..., None] - near, 1.0, sigma[..., None])
        )
        return (value * response).sum(-1) / np.maximum(window.sum(-1), 1e-9)

    c, r = blurred_at(s.u.astype(float), columns), blurred_at(s.v.astype(float), rows)
    light = s.gain * (0.02 + 0.98 * (c + r - 2 * c * r))
    w = pixel_weights(3, 0.4).astype(float)
    margin = (w.size - 3) // 2
    padded = np.pad(light, margin, mode="edge")
    across = sum(w[k] * padded[:, k : k + 360 : 3] for k in range(w.size))
    expected = 100 * sum(w[k] * across[k : k + 240 : 3] for k in range(w.size))
    np.testing.assert_allclose(prepared.light(columns, rows), expected, atol=0.15)  # tables are interpolated


def test_patterns_become_lines_along_their_axis(ideal_rig):
    columns, rows = lines_of(Code("gray", "y", 0, 5, 2), ideal_rig)
    assert not columns.any()
    assert rows.shape == (64,)
    assert rows.any()
    columns, rows = lines_of(Line("x", 3, 2), ideal_rig)
    assert np.flatnonzero(columns).tolist() == [3, 4]
    assert lines_of(White(), ideal_rig)[0].all()
    assert not any(lines.any() for lines in lines_of(Black(), ideal_rig))


def test_too_much_light_saturates(ideal_rig, wall):
    rig = at_projector(replace(ideal_rig, sensor=replace(ideal_rig.sensor, white_level=400.0)))
    image = prepare(rig, wall).frame(White())
    assert image.dtype == np.uint8
    assert image.max() == 255
    assert np.all(image[truth_maps(rig, wall).lit] == 255)
