"""Parameters held at nominal values that are not theirs, on simulated rigs that share no code with the program."""

from __future__ import annotations

import pytest

from core.calibrate import calibrate_photogrammetric
from core.checks import adjustment_concerns
from core.model import verdict_of
from tests.core.checks.rigs import simulate

FIVE = ("x0", "y0", "A1", "A2", "A3")


@pytest.mark.parametrize(("rig", "seed", "device"), [("paper", 3, "camera"), ("modern", 2, "projector")])
def test_residuals_beyond_their_sigmas_that_neighbours_share_contradict_the_model(
    rig: str, seed: int, device: str
) -> None:
    """Twice to three times their sigmas and more than half common to neighbours: each alone is a doubt."""
    p = simulate(rig, seed)
    hold = [f"{device}.{name}" for name in FIVE]
    _, found = calibrate_photogrammetric(p.rig, p.board, p.fields, scale=p.scale, hold=hold)
    verdict = verdict_of(adjustment_concerns(found))
    assert verdict.state == "failed"
    assert verdict.because[0].startswith(f"{device}: residuals are systematic")
