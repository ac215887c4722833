"""Lenses with a term that the model lacks, by a simulator of its own: what it would change is known."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import calibrate_photogrammetric
from core.checks.forms import form_concerns, lacking_terms
from core.geometry import ray_directions
from core.model import Adjustment
from tests.core.checks.rigs import RIGS, Project, simulate


def adjusted(p: Project) -> Adjustment:
    return calibrate_photogrammetric(p.rig, p.board, p.fields, scale=p.scale)[1]


def off_at_rim(p: Project, adjustment: Adjustment) -> float:
    """By how much the adjusted camera is off the true one somewhere in its image, px, but for a rotation."""
    spec = p.rig.cameras["camera"]
    uv = np.stack(np.meshgrid(np.linspace(0, spec.width - 1, 41), np.linspace(0, spec.height - 1, 31)), axis=-1)
    rays = ray_directions(spec, adjustment.devices["camera"].interior, uv.reshape(-1, 2))
    off = p.camera.see(rays) - uv.reshape(-1, 2)
    turns = [(p.camera.see(rays + 1e-4 * np.cross(axis, rays)) - p.camera.see(rays)).ravel() for axis in np.eye(3)]
    middle = np.repeat(
        np.linalg.norm(uv.reshape(-1, 2) - np.array([spec.width, spec.height]) / 2, axis=1) < 0.3 * spec.height, 2
    )
    A = np.column_stack(turns)
    rest = off.ravel() - A @ np.linalg.lstsq(A[middle], off.ravel()[middle], rcond=None)[0]
    return float(np.linalg.norm(rest.reshape(-1, 2), axis=1).max())


@pytest.mark.parametrize("name", list(RIGS))
@pytest.mark.parametrize("seventh", [-0.04, 0.08])
@pytest.mark.parametrize("seed", range(3))
def test_a_radial_term_that_the_model_lacks_is_told_with_what_it_changes(name: str, seed: int, seventh: float) -> None:
    p = simulate(name, 40 + seed, poses=14, seventh=seventh)
    adjustment = adjusted(p)
    (concern,) = form_concerns(adjustment)
    assert concern.state == "doubtful"
    found = re.match(r"camera: the lens model lacks a radial term .* and by (\S+) elsewhere", concern.text)
    assert found is not None
    assert float(found[1]) == pytest.approx(off_at_rim(p, adjustment), rel=0.2)


@pytest.mark.parametrize("seed", range(8))
def test_lenses_of_the_models_form_are_not_accused(seed: int) -> None:
    p = simulate(("paper", "modern")[seed % 2], 60 + seed, vary=True, honest=1.3)
    assert form_concerns(adjusted(p)) == []


def test_images_without_noise_and_devices_that_were_held_tell_nothing() -> None:
    adjustment = adjusted(simulate("paper", 41))
    camera = adjustment.devices["camera"]
    exact = replace(adjustment, residuals=np.zeros_like(adjustment.residuals))
    assert form_concerns(exact) == []
    assert lacking_terms(adjustment, "camera", replace(camera, sigma=np.zeros_like(camera.sigma))) is None
    lost = adjustment.residuals.copy()
    lost[::5] = lost[::3, 1] = np.nan
    assert form_concerns(replace(adjustment, residuals=lost)) == []
    few = adjustment.network.observation_station != 0
    few[np.flatnonzero(~few)[:2]] = True  # a station of two points
    network = replace(
        adjustment.network,
        **{
            key: getattr(adjustment.network, key)[few]
            for key in vars(adjustment.network)
            if key.startswith("observation_")
        },
    )
    assert form_concerns(replace(adjustment, network=network, residuals=adjustment.residuals[few])) == []
