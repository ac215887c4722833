"""What the images lack is told with what to photograph next."""

from dataclasses import replace

import numpy as np

from core.calibrate import adjust


def without(network, drop):
    """The network without some observations."""
    keep = ~drop
    return replace(
        network,
        observation_station=network.observation_station[keep],
        observation_point=network.observation_point[keep],
        observation_uv=network.observation_uv[keep],
        observation_sigma=network.observation_sigma[keep],
    )


def test_empty_corners_are_named_for_the_device_that_has_them(simulate):
    network = simulate(seed=3, poses=12).network
    camera = np.array(network.station_device)[network.observation_station] == "camera"
    u, v = network.observation_uv.T
    upper_left = camera & (u < 748 / 4) & (v < 576 / 4)
    lower_right = camera & (u > 748 * 3 / 4) & (v > 576 * 3 / 4)
    warnings = adjust(without(network, upper_left | lower_right)).warnings
    assert [w for w in warnings if "corner" in w] == [
        "camera: no image points in the upper left and lower right corners of the image: A1, A2, A3, A4, A5, A6 are "
        "extrapolated there; photograph the field there"
    ]


def test_corners_do_not_matter_where_no_additional_parameter_is_estimated(simulate):
    network = simulate(seed=3, poses=12, estimate=("c", "x0", "y0")).network
    upper_left = (network.observation_uv < 150).all(axis=1)
    assert not any("corner" in w for w in adjust(without(network, upper_left)).warnings)


def test_few_images_are_told_with_how_many_to_take(simulate):
    warnings = adjust(simulate(poses=5).network).warnings
    assert sum("only 5 images: photograph the field at least 6 times" in w for w in warnings) == 2
    assert not any("images: photograph" in w for w in adjust(simulate(poses=6).network).warnings)


def test_missing_rolls_come_with_the_turn_to_make(simulate):
    warnings = adjust(simulate(use=("camera",), poses=20, rows=13, cols=19, rolled=False).network).warnings
    assert any("turned by 90° in its own plane" in w for w in warnings)


def test_missing_convergence_names_the_sides_that_no_image_shows(simulate):
    hardly = adjust(simulate(tilt_deg=6.0, poses=12).network).warnings
    assert any("tilt the field by 30° so that it faces left, right, up, down" in w for w in hardly)
