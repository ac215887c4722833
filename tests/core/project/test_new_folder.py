"""A new project: in a new or empty folder, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError
from core.model import DeviceSpec, ScaleBar
from core.project import boards, create_project, nominal_testfield, read_project, read_testfield

CAMERA, PROJECTOR = DeviceSpec(2448, 2048, (0.00345, 0.00345), 16.0), DeviceSpec(1280, 800, (0.0076, 0.0076), 28.0)
FIELD = nominal_testfield(5, 7, 20.0, 8.0, "black-on-white")


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "rig"
    scale = ScaleBar((0, 0), (4, 6), 144.2, 0.02)
    create_project(folder, "Rig", CAMERA, PROJECTOR, {"testfield.csv": FIELD}, scale)
    project = read_project(folder)
    assert (project.name, project.camera, project.projector, project.scale) == ("Rig", CAMERA, PROJECTOR, scale)
    assert project.captures == ()
    found = read_testfield(folder / "testfield.csv")
    np.testing.assert_allclose(found.xyz_mm, FIELD.xyz_mm)
    assert found.polarity == "black-on-white"


@pytest.mark.parametrize("held", ["project.json", ".hidden", "folder/"])
def test_a_folder_that_holds_anything_is_refused(tmp_path: Path, held: str) -> None:
    (tmp_path / held).mkdir() if held.endswith("/") else (tmp_path / held).touch()
    with pytest.raises(InputError, match=held.strip("/")):
        create_project(tmp_path, "Rig", CAMERA, PROJECTOR, {"testfield.csv": FIELD})
    assert len(list(tmp_path.iterdir())) == 1


def test_a_file_in_its_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "rig").touch()
    with pytest.raises(InputError, match="is a file"):
        create_project(tmp_path / "rig", "Rig", CAMERA, PROJECTOR, {"testfield.csv": FIELD})


def test_a_failure_at_the_last_file_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **named: object) -> None:
        raise InputError("project.json", "cannot be written (No space left on device)", "make room")

    monkeypatch.setattr(boards, "write_project", full)
    for folder in (tmp_path / "a" / "b", tmp_path):
        with pytest.raises(InputError, match="No space"):
            create_project(folder, "Rig", CAMERA, PROJECTOR, {"testfield.csv": FIELD, "plate.csv": FIELD})
        assert list(tmp_path.iterdir()) == []
