"""The camera's electronics against the statistics they promise."""

import numpy as np
import pytest

from core.bench.sensor import Sensor, digitise, shift_rows


def flat(level, shape=(300, 400)):
    return np.full(shape, level, np.float32)


def test_photon_transfer_is_a_straight_line():
    """Variance = read² + gain · signal + 1/12 for the rounding."""
    sensor = Sensor(offset=20.0, read_noise=1.4, shot_gain=0.05)
    levels = np.array([0.0, 40.0, 90.0, 150.0])
    variance = [digitise(sensor, flat(v), np.random.default_rng(i)).var() for i, v in enumerate(levels)]
    # 120 000 pixels: the variance itself is known to 0.4 %; 1.5 % is 3.7 of its sigmas
    np.testing.assert_allclose(variance, 1.4**2 + 0.05 * levels + 1 / 12, rtol=0.015)


def test_the_mean_is_signal_plus_offset():
    image = digitise(Sensor(offset=11.0, read_noise=2.0), flat(60.4), np.random.default_rng(5))
    assert image.mean() == pytest.approx(71.4, abs=5 * 2.3 / np.sqrt(image.size))


@pytest.mark.parametrize(("bits", "dtype", "ceiling"), [(8, np.uint8, 255), (12, np.uint16, 4095)])
def test_grey_values_stay_within_their_bits(bits, dtype, ceiling):
    sensor = Sensor(read_noise=3.0, offset=0.0, bits=bits)
    bright = digitise(sensor, flat(1e5), np.random.default_rng(0))
    assert bright.dtype == dtype
    assert np.all(bright == ceiling)
    assert digitise(sensor, flat(0.0), np.random.default_rng(0)).min() == 0


def test_line_jitter_displaces_whole_rows():
    """The slope of a ramp turns displacement into grey values, equal along a row."""
    sensor = Sensor(offset=0.0, read_noise=0.0, shot_gain=0.0, jitter_px=0.05, bits=12)
    ramp = np.tile(np.arange(40, dtype=np.float32) * 100, (4000, 1))
    shift = (ramp - digitise(sensor, ramp.copy(), np.random.default_rng(1)))[:, 1:-1] / 100
    assert shift.mean(axis=1).std() == pytest.approx(0.05, rel=0.04)  # 4000 rows: known to 1.1 %
    assert np.abs(shift - shift.mean(axis=1, keepdims=True)).max() < 0.011  # rounding of one grey value


def test_shifted_rows_follow_a_sine():
    x = np.arange(200, dtype=np.float64)
    wave = np.sin(2 * np.pi * x / 8)
    shift = np.array([-0.1, 0.0, 0.05], np.float32)
    got = shift_rows(np.tile(wave + 2, (3, 1)).astype(np.float32), shift)[:, 2:-2] - 2
    expected = np.sin(2 * np.pi * (x - shift[:, None]) / 8)[:, 2:-2]
    # central differences see a sine of 8 px with sin(2π/8) / (2π/8) = 0.90 of its slope
    np.testing.assert_allclose(got, expected, atol=0.1 * 2 * np.pi / 8 * 0.11)


def test_equal_seeds_give_equal_noise():
    sensor = Sensor(read_noise=2.0, jitter_px=0.02)
    a, b = (digitise(sensor, flat(50.0), np.random.default_rng(9)) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    assert np.any(a != digitise(sensor, flat(50.0), np.random.default_rng(10)))
