"""Whole captures through a serial projector and a camera that err: right or refused, never mislabelled."""

import time
from pathlib import Path

import pytest

from core.capture import run_capture
from core.devices import LINK_FAULTS
from core.errors import Cancelled
from core.model import Project, Subject
from core.progress import Progress
from core.project import read_project
from tests.devices.campaign import COMMANDS, PROFILES, QUICK, make_project, many, outcome, single_link


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return make_project(tmp_path)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("fault", LINK_FAULTS)
def test_a_single_fault_anywhere_in_a_capture_is_overcome(project: Project, profile: str, fault: str) -> None:
    offset = list(LINK_FAULTS).index(fault)
    for at in range(offset, COMMANDS[profile], 41):
        _, projector, camera = single_link(profile, fault, at)
        assert outcome(project, f"at{at}", projector, camera) == "right"


@pytest.mark.parametrize("at", [9, 60], ids=["while loading", "while stepping"])
def test_a_capture_is_cancelled_within_half_a_second_though_its_projector_is_silent(project: Project, at: int) -> None:
    start = time.monotonic()
    # a lost command is missed after 3 s, while loading after 6 s
    projector = f"emulated:flat?settle_ms=1&answer_ms=3000&faults=lost-command@{at}"
    with pytest.raises(Cancelled):
        run_capture(
            project,
            Subject("object", "a"),
            projector,
            "virtual:flat",
            progress=Progress(cancelled=lambda: time.monotonic() > start + 1.0),
        )
    assert 1.0 < time.monotonic() - start < 1.5
    assert not read_project(project.path).captures


@pytest.mark.parametrize("seed", range(6))
def test_many_faults_at_random_never_mislabel_a_frame(project: Project, seed: int) -> None:
    _, projector, camera = many(seed)
    assert outcome(project, "a", projector, camera) != "mislabelled"


@pytest.mark.parametrize("fault", LINK_FAULTS)
def test_a_projector_that_always_errs_is_refused_or_overcome_in_bounded_time(project: Project, fault: str) -> None:
    projector = f"emulated:flat?{QUICK}&faults={fault}:1"
    overcome = ("no-answer", "late-answer", "slow-switching")  # the last by waiting longer and longer
    result = outcome(project, "a", projector, "virtual:flat")
    assert result == "refused" or (fault in overcome and result == "right")
