"""Fitted ellipses against discs of a renderer of this test's own: another point image, another noise, loose lines."""

import cv2
import numpy as np
import pytest

from core.measure.centres.centroid import centroids, noise_model
from core.measure.centres.ellipse import ellipse_centres
from core.measure.centres.plateau import plateau_share
from core.measure.centres.profile import profiles
from core.measure.centres.rays import Rays
from core.measure.rows import row_shifts
from core.model import PhaseMap, TargetSet

FINE = 6  # samples per pixel along one axis
PITCH = 22  # px from dot to dot


def discs(semi_axes, defocus_px, rng, rows=7, cols=9, fall=(0.0, 0.0), widens=0.0, gaussian=False):
    """An image of tilted ellipses at random places in their pixels, out of focus: a disc, not a Gaussian.

    The light on each falls by a share per px. Every point is spread over a disc that `widens` from column to column, or
    a Gaussian of its variance. Of a tilted board that looks the same from all parts of the aperture a point sends more
    light to its softer side: the weights' slope is what keeps an evenly bright board evenly bright.
    """
    height, width = (rows + 1) * PITCH, (cols + 1) * PITCH
    v, u = (np.mgrid[0 : height * FINE, 0 : width * FINE] + 0.5) / FINE - 0.5
    grid = np.stack(np.meshgrid(np.arange(cols), np.arange(rows)), axis=-1).reshape(-1, 2)
    centre = (grid + 1.0) * PITCH + rng.uniform(-0.5, 0.5, grid.shape)
    turn = np.deg2rad(33)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shape = R @ np.diag(semi_axes) @ R.T
    cover, to_unit = np.zeros(u.shape, np.float32), np.linalg.inv(shape)
    for x, y in centre:
        part = np.s_[int((y - 10) * FINE) : int((y + 10) * FINE), int((x - 10) * FINE) : int((x + 10) * FINE)]
        p = np.stack([u[part] - x, v[part] - y], axis=-1) @ to_unit.T
        rho = np.maximum(np.linalg.norm(p, axis=-1), 1e-9)
        steep = np.linalg.norm(p @ to_unit, axis=-1) / rho
        lit = 1 + (u[part] - x) * fall[0] + (v[part] - y) * fall[1]
        cover[part] = lit * np.clip(0.5 + (1 - rho) / steep * FINE, 0, 1)
    radius = defocus_px + widens * (u - width / 2)
    steps = np.linspace(radius.min(), radius.max(), 12 if widens else 1)
    seen = np.zeros_like(cover)
    for step in steps:
        reach = int(np.ceil((2 if gaussian else 1) * step * FINE))
        dv, du = np.mgrid[-reach : reach + 1, -reach : reach + 1] / FINE
        away = np.hypot(dv, du)
        disc = np.exp(-2 * (away / step) ** 2) if gaussian else np.clip(0.5 + (step - away) * FINE, 0, 1)
        disc *= 1 - widens * du / step
        share = np.clip(1 - np.abs(radius - step) / (steps[1] - steps[0]), 0, 1) if widens else 1.0
        seen += cv2.filter2D(np.float32(cover * share), -1, disc / disc.sum(), borderType=cv2.BORDER_REPLICATE)
    return 12 + 90 * seen.reshape(height, FINE, width, FINE).mean(axis=(1, 3)), centre, shape


def measured(image, centre, shape, estimate=ellipse_centres, fall=(0.0, 0.0)):
    image = np.ascontiguousarray(image, np.float32)
    rays = Rays(np.round(centre), np.broadcast_to(shape, (len(centre), 2, 2)).copy())
    profile = profiles(image, rays, np.full(len(centre), PITCH / 6.0))
    noise = noise_model(image, rays, profile)
    return estimate(image, rays, profile, np.broadcast_to(fall, centre.shape), noise)


@pytest.mark.parametrize("semi_axes", [(6.0, 5.0), (3.5, 2.2)])
@pytest.mark.parametrize("defocus_px", [0.7, 1.6])
def test_nothing_depends_on_where_in_its_pixel_a_dot_lies(semi_axes, defocus_px):
    image, centre, shape = discs(semi_axes, defocus_px, np.random.default_rng(1))
    for estimate, most in (
        (ellipse_centres, 0.0014),
        (centroids, 0.0025),
    ):  # noise leaves 0.005
        uv, _ = measured(image, centre, shape, estimate)
        assert np.sqrt(np.mean((uv - centre) ** 2)) < most


@pytest.mark.parametrize("defocus_px", [0.7, 1.6])
def test_light_that_falls_across_a_dot_does_not_move_its_centre(defocus_px):
    fall, blur = np.array([0.006, -0.008]), defocus_px**2 / 4 + 1 / 12
    image, centre, shape = discs((6.0, 5.0), defocus_px, np.random.default_rng(5), fall=fall)
    for estimate, most in ((centroids, 0.1), (ellipse_centres, 0.35)):
        off = np.mean(measured(image, centre, shape, estimate, fall)[0] - centre, axis=0) @ fall / 0.01
        # unheeded, the light moves it by 0.07 px; dividing the blurred dot by it takes 0.01 x the blur's variance more
        assert abs(off) < most * 0.01 * blur


@pytest.mark.parametrize("gaussian", [True, False])
def test_dots_that_are_softer_on_one_side_are_drawn_to_neither(gaussian):
    widens = 0.011  # px of the disc's radius per px: a board tilted out of a small depth of field
    image, centre, shape = discs((6.0, 5.0), 1.6, np.random.default_rng(7), widens=widens, gaussian=gaussian)
    change = widens * (1.6 + widens * (centre[:, 0] - image.shape[1] / 2)) / 2  # of a disc's variance, radius² / 4
    for estimate, most in ((centroids, 0.2), (ellipse_centres, 0.1)):  # as if spread evenly: 0.44 to 0.72
        uv, cov = measured(image, centre, shape, estimate)
        off = (uv - centre)[:, 0]
        assert abs(np.sum(off * change) / np.sum(change**2)) < most
        assert np.mean(off**2 / cov[:, 0, 0]) < 1.5


def noisy(clean, loose, rng, read=1.0, shot=0.02):
    """Noise that grows with the light, and lines that are off by `loose` px."""
    waves = np.exp(-2j * np.pi * np.fft.rfftfreq(clean.shape[1]) * loose)
    image = np.fft.irfft(np.fft.rfft(clean, axis=1) * waves, clean.shape[1], axis=1)
    return np.rint(image + rng.normal(size=image.shape) * np.sqrt(read + shot * image))


def test_errors_are_as_large_as_their_sigmas():
    rng, ratios = np.random.default_rng(2), []
    clean, centre, shape = discs((6.0, 5.0), 0.8, rng)
    for _ in range(12):
        uv, cov = measured(noisy(clean, 0.0, rng), centre, shape)
        ratios.append((uv - centre) / np.sqrt(np.diagonal(cov, axis1=1, axis2=2)))
    # 756 values of each coordinate: their r.m.s. is known to 2.6 %
    assert np.sqrt(np.mean(np.concatenate(ratios) ** 2, axis=0)) == pytest.approx([1.0, 1.0], abs=0.08)


@pytest.mark.parametrize(
    ("semi_axes", "defocus_px", "within"),
    [((6.0, 5.0), 0.9, 0.08), ((3.5, 3.0), 0.9, 0.08), ((6.0, 5.0), 4.0, 0.2), ((4.0, 3.6), 3.0, 0.2)],
)
def test_the_noise_of_light_is_told_by_small_and_blurred_dots_too(semi_axes, defocus_px, within):
    """The blurred ones have no flat top, and draw each other a little, in every image alike."""
    rng, shot, errors, variances = np.random.default_rng(6), [], [], []
    clean, centre, shape = discs(semi_axes, defocus_px, rng)
    for _ in range(12):
        image = np.ascontiguousarray(noisy(clean, 0.0, rng, 0.3, 0.05), np.float32)
        rays = Rays(np.round(centre), np.broadcast_to(shape, (len(centre), 2, 2)).copy())
        shot.append(noise_model(image, rays, profiles(image, rays, np.full(len(centre), PITCH / 6.0)))[1])
        uv, cov = measured(image, centre, shape, centroids)
        errors.append(uv - centre)
        variances.append(np.diagonal(cov, axis1=1, axis2=2))
    assert np.mean(shot) == pytest.approx(0.05, rel=0.15)  # 12 x 63 middles tell it to 6 %
    square = np.var(errors, axis=0, ddof=1) if within > 0.1 else np.mean(np.square(errors), axis=0)
    # 2.2 from the dark background's noise alone
    assert np.sqrt(np.mean(square / np.mean(variances, axis=0))) == pytest.approx(1.0, abs=within)


@pytest.mark.parametrize("semi_axes", [(5.4, 5.4), (4.2, 3.8), (3.8, 3.8)])
def test_the_light_of_dots_that_blur_leaves_no_flat_top_is_known(semi_axes):
    image, centre, shape = discs(semi_axes, 3.0, np.random.default_rng(8), gaussian=True)  # sigma 1.5 px
    rays = Rays(centre, np.broadcast_to(shape, (len(centre), 2, 2)).copy())
    seen = profiles(np.ascontiguousarray(image, np.float32), rays, np.full(len(centre), PITCH / 6.0))
    contour = rays.ellipse * seen.contour[:, 0, None, None]
    assert seen.contrast.mean() < 0.99 * 90
    for mirrored in (1, -1):  # as the outlines of rows that count upwards are
        share = plateau_share(contour * [1, mirrored], seen.blur)
        assert (seen.contrast / share).mean() == pytest.approx(90, rel=0.012)


@pytest.mark.parametrize("defocus_px", [0.3, 0.8, 1.6])
def test_fitted_ellipses_are_more_precise_than_centroids_out_of_focus(defocus_px):
    rng = np.random.default_rng(3)
    clean, centre, shape = discs((6.0, 5.0), defocus_px, rng)
    images = [noisy(clean, 0.0, rng) for _ in range(8)]
    fitted, weighted = (
        np.sqrt(np.mean([(measured(image, centre, shape, estimate)[0] - centre) ** 2 for image in images]))
        for estimate in (ellipse_centres, centroids)
    )
    assert fitted < 0.9 * weighted  # 1008 values each: known to 3 %


@pytest.mark.parametrize("loose_px", [0.0, 0.03])
def test_shifts_of_rows_are_found_and_shared_by_the_dots_of_a_row(loose_px):
    rng, found, errors = np.random.default_rng(4), [], []
    clean, centre, shape = discs((6.0, 5.0), 0.8, rng)
    # some of the frames that tell the projector's u make up the image, too; v does not change along the rows
    true = loose_px**2 * np.array([[1.0, -0.5, 0.0], [-0.5, 0.6, 0.0], [0.0, 0.0, 0.0]])
    y, x = np.mgrid[: clean.shape[0], : clean.shape[1]]
    none = np.full(clean.shape, np.nan, np.float32)
    ellipse, one = np.broadcast_to(shape, (len(centre), 2, 2)), np.ones(len(centre))
    for _ in range(24):
        loose, read = rng.multivariate_normal(np.zeros(2), true[:2, :2], len(clean)).T[..., None]
        image = np.ascontiguousarray(noisy(clean, loose, rng), np.float32)
        uv, cov = measured(image, centre, shape, centroids)
        noise = 0.05 * rng.standard_normal((2, *clean.shape))
        at = x + read
        u, v = 200 + 1.3 * at + 0.2 * y + 1e-3 * at**2 + noise[0], 300 + 1.1 * y + noise[1]
        sigma = np.full(clean.shape, 0.05, np.float32)
        phase = PhaseMap(np.float32(u), np.float32(v), sigma, sigma, none, image, np.zeros(clean.shape, np.uint8))
        found.append(row_shifts(image, phase, uv, ellipse, 1.5 * one, np.outer(one, [12.0, 0, 0])))
        errors.append(uv - centre)
    # of 24 images with some 250 products of dots in each of 77 rows: good to 2 %
    found = np.mean(found, axis=0)
    assert found == pytest.approx(true, rel=0.2, abs=4e-6)
    target = np.arange(len(centre))
    height = np.full(len(centre), 2 * np.linalg.norm(shape[1]))
    unread = np.full((len(centre), 2), np.nan)
    targets = TargetSet(
        "", target, target, centre, cov, unread, unread, 0 * centre, height, row_shifts=true, height_px=height
    )
    shared = loose_px**2 * targets.row_share
    u, v = np.mean(np.square(errors), axis=(0, 1)) - np.diagonal(cov.mean(axis=0))
    # lines move along themselves only; 168 rows of dots share theirs: good to 11 %
    assert u - v == pytest.approx(np.diagonal(shared).mean(), rel=0.3, abs=1e-5)
    e = np.array(errors)[:, :, 0]
    beside = (np.abs(centre[:, None, 1] - centre[:, 1]) < 1) & ~np.eye(len(centre), dtype=bool)
    together = np.mean(e[:, :, None] * e[:, None, :], axis=0)
    assert together[beside].mean() == pytest.approx(shared[beside].mean(), rel=0.3, abs=1e-6)


def test_a_dot_that_no_ellipse_fits_keeps_its_centroid():
    image, centre, shape = discs((6.0, 5.0), 0.8, np.random.default_rng(3))
    image[:, : PITCH * 2] = 12.0  # the first column of dots is not there
    with np.errstate(all="ignore"):
        fitted, weighted = measured(image, centre, shape), measured(image, centre, shape, centroids)
    gone = centre[:, 0] < PITCH * 1.5
    assert np.allclose(fitted[0][gone], weighted[0][gone], atol=1e-4, equal_nan=True)
    assert np.isfinite(fitted[0][~gone]).all()
