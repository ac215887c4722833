import time
from pathlib import Path

import numpy as np
import pytest

from core.devices import CAMERA_KINDS, PROJECTOR_KINDS, DeviceKind, Image, no_check, open_camera, open_projector
from core.errors import InputError


@pytest.mark.parametrize(
    ("url", "seen"),
    [
        ("virtual", "virtual"),
        ("", "''"),
        ("laser:1", "'laser'"),
        ("virtual:nowhere", "'nowhere'"),
        ("virtual:flat?speed=3", "'speed'"),
        ("virtual:flat?settle_ms=slow", "'slow'"),
        ("virtual:flat?settle_ms=nan", "'nan'"),
        ("virtual:flat?settle_ms", "'settle_ms'"),
        ("virtual:quick?pose=99", "testfield-99"),
        ("virtual:quick?pose=1.5", "'1.5'"),
        ("replay:/no/such/capture", "cannot be read"),
    ],
)
def test_a_wrong_url_is_refused_with_the_value_seen(url: str, seen: str) -> None:
    with pytest.raises(InputError, match=seen) as caught:
        open_projector(url)
    assert caught.value.remedy


def test_a_kind_that_does_not_exist_lists_those_that_do() -> None:
    with pytest.raises(InputError) as caught:
        open_camera("pinhole:1")
    for kind in CAMERA_KINDS.values():
        assert kind.text in str(caught.value)
    with pytest.raises(InputError) as caught:
        open_projector("folder:/tmp")
    for kind in PROJECTOR_KINDS.values():
        assert kind.text in str(caught.value)


@pytest.mark.parametrize("faults", ["stale", "stale-frame:2", "stale-frame@-1", "stale-frame"])
def test_faults_are_named_and_rated_rightly(faults: str) -> None:
    with pytest.raises(InputError, match="fault"):
        open_camera(f"virtual:flat?faults={faults}")


def test_a_folder_camera_needs_a_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        open_camera(f"folder:{tmp_path / 'none'}")


def test_devices_of_the_same_scene_share_it_and_others_do_not() -> None:
    projector, camera = open_projector("virtual:quick?pose=2"), open_camera("virtual:quick?pose=2")
    other = open_camera("virtual:quick?pose=3")
    assert projector.stage is camera.stage
    assert other.stage is not camera.stage


def test_a_kind_of_camera_from_outside_opens_by_its_url(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the developer's guide shows: one function, one line, and every command knows the kind."""

    class GreyCamera:
        bits, name = 8, "grey"

        def __init__(self, level: int) -> None:
            self.size, self.level = (6, 4), level

        def grab(self, timeout_s: float = 5.0, check=no_check) -> Image:
            return Image(np.full((4, 6), self.level, np.uint8), 8, time.monotonic())

        def close(self) -> None:
            pass

    def open_grey(address, note, check) -> GreyCamera:
        level = address.integer("level", 128, 0, 255)
        address.finish()
        return GreyCamera(level)

    monkeypatch.setitem(CAMERA_KINDS, "grey", DeviceKind("grey:NAME, an evenly grey image", open_grey))
    assert np.all(open_camera("grey:one?level=77").grab().pixels == 77)
    with pytest.raises(InputError, match="lvel"):
        open_camera("grey:one?lvel=77")
    with pytest.raises(InputError, match="grey:NAME"):
        open_camera("pinhole:1")
