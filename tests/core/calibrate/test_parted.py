"""Captures that fit up to one of them, and again from there on, are told apart; what is wrong in all of them is not."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from core.calibrate import AdjustOptions, calibrate_photogrammetric
from core.calibrate.adjust import explained
from core.calibrate.diagnosis.parted import parted
from core.errors import AdjustmentError
from core.model import Rig
from tests.core.calibrate.test_rigid_rig import COLS, ROWS, target_sets

OPTIONS = AdjustOptions(variance_components=True, reject_beyond=5.0)


def changed(network, first, change, device="camera"):
    """Change the image coordinates of a device from a pose on."""
    late = np.array(
        [d == device and p >= first for d, p in zip(network.station_device, network.station_pose, strict=True)]
    )
    rows = np.flatnonzero(late[network.observation_station])
    uv = network.observation_uv.copy()
    uv[rows] = change(uv[rows])
    return replace(network, observation_uv=uv)


CHANGES = {
    "region of interest": partial(np.add, (8.0, 4.0)),
    "refocused": lambda uv: uv * 1.02 - (7.5, 5.8),
    "turned by half": partial(np.subtract, (747, 575)),
}


@pytest.mark.parametrize(("kind", "first"), list(zip(CHANGES, (4, 7, 6), strict=True)))
def test_the_capture_from_which_on_all_is_otherwise_is_named(simulate, kind, first):
    network = simulate(poses=10, rows=ROWS, cols=COLS, seed=first).network
    told = parted(changed(network, first, CHANGES[kind]), partial(explained, options=OPTIONS))
    assert told == f"1 to {first}, {first + 1} to 10 fit by themselves, but not together"


def test_a_rig_moved_twice_has_three_parts(simulate):
    network = simulate(poses=12, rows=ROWS, cols=COLS, seed=3).network
    network = changed(network, 4, partial(np.add, (0.0, 30.0)), "projector")
    network = changed(network, 8, partial(np.add, (15.0, -40.0)), "projector")
    told = parted(network, partial(explained, options=OPTIONS))
    assert told == "1 to 4, 5 to 8, 9 to 12 fit by themselves, but not together"


def test_what_is_wrong_in_every_capture_or_in_each_otherwise_has_no_parts(simulate):
    network = simulate(poses=10, rows=ROWS, cols=COLS, seed=4).network
    steps = changed(network, 0, lambda uv: uv + 8.0 * np.sin(uv[:, ::-1] / 20), "projector")
    loose = network
    for pose in range(10):
        loose = changed(loose, pose, partial(np.add, (5.0, -7.0)))
    for wrong in (steps, loose):
        assert parted(wrong, partial(explained, options=OPTIONS)) == ""


@pytest.mark.parametrize("shift", [[8.0, 4.0], [60.0, -40.0]])
def test_a_calibration_names_its_parts_first(simulate, shift):
    """By the verdict where it can still be adjusted, else by the refusal."""
    simulated = simulate(poses=10, rows=ROWS, cols=COLS)
    network = changed(simulated.network, 5, partial(np.add, shift))
    specs = {name: network.devices[name].spec for name in ("camera", "projector")}
    rig = Rig({"camera": specs["camera"]}, {"projector": specs["projector"]})
    field, sets, bar = target_sets(replace(simulated, network=network))
    words = "testfield-01 to testfield-05, testfield-06 to testfield-10 fit by themselves, but not together"
    if shift[0] > 10:
        with pytest.raises(AdjustmentError, match=words):
            calibrate_photogrammetric(rig, field, sets, scale=bar, options=OPTIONS)
        return
    calibration, adjustment = calibrate_photogrammetric(rig, field, sets, scale=bar, options=OPTIONS)
    assert any(words in warning for warning in calibration.warnings)
    assert [d.state for d in adjustment.doubts if words in d.text] == ["failed"]
