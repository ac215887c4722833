from pathlib import Path

import numpy as np
import pytest

from core.devices import CAMERA_KINDS, PROJECTOR_KINDS, open_camera, open_projector
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


def test_a_kind_of_camera_from_outside_opens_by_its_url(extension) -> None:
    """What the developer's guide shows: one function, one line, and every command knows the kind."""
    extension("device", CAMERA_KINDS)
    stripes = open_camera("striped:one?width=8").grab().pixels
    assert np.flatnonzero(np.diff(stripes[0].astype(int))).tolist() == list(range(7, 95, 8))
    with pytest.raises(InputError, match="wdth"):
        open_camera("striped:one?wdth=8")
    with pytest.raises(InputError, match="striped:NAME"):
        open_camera("pinhole:1")
