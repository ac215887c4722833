"""What tests of captures share: a project of the flat scene's sizes."""

from pathlib import Path

import pytest

from core.model import DeviceSpec, Project
from core.patterns import SequenceSpec
from core.project import read_project, write_project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A project without captures, of the sizes of the devices that look at `virtual:flat`; the paper's sequence."""
    folder = tmp_path / "project"
    camera, projector = DeviceSpec(96, 72, (0.01, 0.01), 12.0), DeviceSpec(64, 64, (0.09, 0.09), 100.0)
    write_project(folder, "t", camera, projector, sequence=SequenceSpec("paper"))
    return read_project(folder)
