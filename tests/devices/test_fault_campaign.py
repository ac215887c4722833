"""Whole captures through a serial projector and a camera that err: right or refused, never mislabelled."""

import random
from pathlib import Path

import numpy as np
import pytest

from core.capture import run_capture
from core.devices import CAMERA_FAULTS, LINK_FAULTS
from core.devices.scene import FlatScene
from core.errors import DeviceError
from core.model import DeviceSpec, Project
from core.project import read_capture, read_image, read_project, write_project

PROFILES = ["stripe-lines", "stripe-frames"]
QUICK = "settle_ms=1&answer_ms=15"
COMMANDS = {"stripe-lines": 75, "stripe-frames": 51}  # of one capture of 24 shots without faults


@pytest.fixture
def project(tmp_path: Path) -> Project:
    write_project(tmp_path, "t", DeviceSpec(96, 72, (0.01, 0.01), 12.0), DeviceSpec(64, 64, (0.09, 0.09), 100.0))
    return read_project(tmp_path)


def outcome(project: Project, name: str, projector: str, camera: str) -> str:
    """Capture, and compare every listed frame with the noise-free image of its pattern: the emulator cannot hide."""
    try:
        folder = run_capture(project, name, "object", projector, camera).folder
    except DeviceError:
        return "refused"
    scene = FlatScene(noise=0.0)
    for frame in read_capture(folder).frames:
        # two different patterns differ by 30 grey values on average, noise of 1 by 0.8
        if np.abs(read_image(frame.path).astype(float) - scene.frame(frame.pattern, 0)).mean() > 1.5:
            return "mislabelled"
    return "right"


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("fault", LINK_FAULTS)
def test_a_single_fault_anywhere_in_a_capture_is_overcome(project: Project, profile: str, fault: str) -> None:
    offset = list(LINK_FAULTS).index(fault)
    for at in range(offset, COMMANDS[profile], 41):
        projector = f"emulated:flat?profile={profile}&{QUICK}&faults={fault}@{at}&fault_seed={at}"
        assert outcome(project, f"at{at}", projector, "virtual:flat") == "right"


@pytest.mark.parametrize("seed", range(6))
def test_many_faults_at_random_never_mislabel_a_frame(project: Project, seed: int) -> None:
    rng = random.Random(seed)
    rate = 10 ** rng.uniform(-2.5, -1.0)  # of faults per command, 0.3 to 10 %
    link = ",".join(f"{name}:{2 * rate * rng.random() / len(LINK_FAULTS):.5f}" for name in LINK_FAULTS)
    camera = ",".join(f"{name}:{0.2 * rate * rng.random():.5f}" for name in CAMERA_FAULTS)
    projector = f"emulated:flat?profile={PROFILES[seed % 2]}&{QUICK}&faults={link}&fault_seed={seed}"
    assert outcome(project, "a", projector, f"virtual:flat?faults={camera}&fault_seed={seed}") != "mislabelled"


@pytest.mark.parametrize("fault", LINK_FAULTS)
def test_a_projector_that_always_errs_is_refused_or_overcome_in_bounded_time(project: Project, fault: str) -> None:
    projector = f"emulated:flat?{QUICK}&faults={fault}:1"
    overcome = ("no-answer", "late-answer", "slow-switching")  # the last by waiting longer and longer
    result = outcome(project, "a", projector, "virtual:flat")
    assert result == "refused" or (fault in overcome and result == "right")
