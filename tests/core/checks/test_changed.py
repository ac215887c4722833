"""Boards that bend and lenses that are refocused from some image on, against what was done to them."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import adjust
from core.checks.forms import form_concerns
from core.geometry import project
from core.model import Network
from tests.core.calibrate.conftest import Simulated, simulated_network

SINCE = 6  # of twelve stations


def made(seed: int) -> Simulated:
    return simulated_network(seed=seed, use=("camera",), approximation_mm=1.0)


def changed(simulated: Simulated, bend_mm: float = 0.0, c: float = 0.0) -> Network:
    """Let the board bend by so much from its middle to its rim, or c be longer by a share, from one image on."""
    network = simulated.network
    xyz, device, lens = simulated.points_mm, network.devices["camera"].spec, simulated.interior["camera"]
    along = (xyz[:, 0] - xyz[:, 0].mean()) / np.abs(xyz[:, 0] - xyz[:, 0].mean()).max()
    bent = xyz + np.outer(bend_mm * along**2, [0.0, 0.0, 1.0])
    uv = network.observation_uv.copy()
    for station in range(SINCE, len(network.station_names)):
        rows = network.observation_station == station
        points, pose = network.observation_point[rows], simulated.stations[station]
        other = replace(lens, c_mm=lens.c_mm * (1 + c))
        uv[rows] += project(device, other, bent[points], pose) - project(device, lens, xyz[points], pose)
    return replace(network, observation_uv=uv)


@pytest.mark.parametrize("bend_mm", [0.1, -0.2])
def test_a_board_that_bends_is_told_with_the_image_and_by_how_much(bend_mm: float) -> None:
    """Residuals grew by a twentieth, and parameters were off by three of their sigmas."""
    simulated = made(1)
    (concern,) = form_concerns(adjust(changed(simulated, bend_mm=bend_mm)))
    found = re.match(r"by camera the points are bent by (\S+) mm more from (\S+) on", concern.text)
    assert found is not None
    assert float(found[1]) == pytest.approx(abs(bend_mm), rel=0.25)
    assert found[2] == simulated.network.station_names[SINCE].rpartition("/")[0]


def test_a_lens_that_is_refocused_is_told_with_the_image_and_by_how_much() -> None:
    simulated = made(2)
    (concern,) = form_concerns(adjust(changed(simulated, c=2e-3)))
    found = re.match(r"camera: its c is (\S+)% another one from (\S+) on", concern.text)
    assert found is not None
    assert float(found[1]) == pytest.approx(0.2, rel=0.25)
    assert found[2] == simulated.network.station_names[SINCE].rpartition("/")[0]


def test_an_adjustment_without_points_tells_nothing() -> None:
    """As in the place of one that another program made."""
    found = adjust(made(1).network)
    assert form_concerns(replace(found, points_mm=np.zeros((0, 3)))) == []


@pytest.mark.parametrize("seed", range(6))
def test_images_that_are_alike_are_not_accused(seed: int) -> None:
    assert form_concerns(adjust(made(seed).network)) == []
