"""Calibrations of other programs over the working volume: what is not known of them is not said."""

import numpy as np
import pytest

from core.checks import volume
from core.errors import InputError
from core.geometry import Pose, matrix_from_rotation_vector
from core.pipeline import volumes
from core.pipeline.volumes import difference_figures, volume_figures
from tests.calibrated import calibration_of_pair
from tests.core.exchange.test_exchange_formats import CAMERA, INTERIORS, PROJECTOR, device

SIGMA = np.array(
    [*[2e-3] * 3, 3e-6, 3e-8, *[2e-5] * 4, *[2e-2] * 3, 3e-8, 3e-12, *[2e-5] * 4, *[3e-5] * 3, *[0.02] * 3]
)


@pytest.fixture
def known(monkeypatch):
    """Project and kept runs without files: None is the calibration in use, 1 that of the same rig without sigmas."""
    pose = Pose(matrix_from_rotation_vector([0.01, -0.42, 0.02]), np.array([-244.0, 3.0, -52.0]))
    sure, imported = (
        calibration_of_pair(device(CAMERA, INTERIORS[0]), device(PROJECTOR, INTERIORS[1]), pose, covariance)
        for covariance in (np.diag(SIGMA**2), np.zeros((24, 24)))
    )
    monkeypatch.setattr(volumes, "_kept", lambda project, run: (imported if run else sure, None))
    monkeypatch.setattr(volume, "working_depths", lambda *_: np.array([550.0, 600.0, 650.0]))

    class Folder:
        path = "project"

    return Folder()


def test_an_import_without_sigmas_is_not_called_exact(known):
    assert all(row["sigma_mm"] > 0.01 for row in volume_figures(known)[0]["depths"])
    with pytest.raises(InputError, match="tells no sigmas"):
        volume_figures(known, 1)


def test_no_difference_to_it_is_called_significant(known):
    figures, maps = difference_figures(known, 1)
    assert figures["significant"] is None
    assert figures["statistic"] is None
    assert max(row["difference_mm_max"] for row in figures["depths"]) < 1e-4
    assert not any("sigma" in name for name in (*figures["depths"][0], *maps))
