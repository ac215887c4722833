"""What tests of captures share: a project of the flat scene's sizes."""

from pathlib import Path

import pytest

from core.model import DeviceSpec, Project
from core.project import read_project, write_project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A project without captures, of the sizes of the virtual devices that look at `virtual:flat`."""
    folder = tmp_path / "project"
    write_project(folder, "t", DeviceSpec(96, 72, (0.01, 0.01), 12.0), DeviceSpec(64, 64, (0.09, 0.09), 100.0))
    return read_project(folder)
