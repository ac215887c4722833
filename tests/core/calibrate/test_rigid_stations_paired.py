"""Stations of rigid devices that were paired wrongly, or not at all, in a network's files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.calibrate import adjust
from core.errors import AdjustmentError, InputError
from core.project import read_network, write_network
from tests.core.calibrate.conftest import simulated_network

NETWORK = simulated_network(seed=3, poses=8).network


@pytest.fixture
def written(tmp_path: Path) -> tuple[Path, dict]:
    write_network(tmp_path, NETWORK)
    return tmp_path, json.loads((tmp_path / "network.json").read_text())


def test_poses_that_pair_other_images_are_the_cause_that_is_named() -> None:
    """What was named before: nominal focal lengths, or the identities of all points of some stations."""
    poses = np.array(NETWORK.station_pose)
    of_projector = np.array(NETWORK.station_device) == "projector"
    poses[of_projector] = np.roll(poses[of_projector], 1)
    with pytest.raises(AdjustmentError, match="fit where every station stands for itself, not where devices are rigid"):
        adjust(replace(NETWORK, station_pose=tuple(poses.tolist())))


def test_rigid_devices_that_share_no_pose_are_refused(written: tuple[Path, dict]) -> None:
    """They were adjusted as free ones without a word."""
    folder, data = written
    for name, station in data["stations"].items():
        station["pose"] = name
    (folder / "network.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match="projector is rigid with camera, but no station of another"):
        read_network(folder)


def test_devices_that_name_one_another_are_one_rig(written: tuple[Path, dict]) -> None:
    """A third one beside a circle of two was not of their rig."""
    folder, data = written
    data["devices"]["camera"]["rigid_with"] = "projector"
    data["devices"]["a third"] = {**data["devices"]["camera"], "rigid_with": "projector"}
    for name, station in [*data["stations"].items()]:
        if station["device"] == "camera":
            data["stations"][f"{name} again"] = {"device": "a third", "pose": station["pose"]}
    (folder / "network.json").write_text(json.dumps(data))
    poses = read_network(folder).station_pose
    assert poses == (*NETWORK.station_pose, *range(8))


def test_parameters_that_are_null_are_the_usual_ones(written: tuple[Path, dict]) -> None:
    folder, data = written
    data["devices"]["camera"]["estimate"] = None
    (folder / "network.json").write_text(json.dumps(data))
    assert read_network(folder).devices["camera"].estimate is None
