"""Parameters held at nominal values that are not theirs, on simulated rigs that share no code with the program."""

from __future__ import annotations

import pytest

from core.calibrate import calibrate_photogrammetric
from core.checks import adjustment_concerns
from core.model import Verdict, verdict_of
from tests.core.checks.rigs import simulate

FIVE = ("x0", "y0", "A1", "A2", "A3")
ZERO = (*(f"camera.A{i}" for i in range(2, 7)), *(f"projector.A{i}" for i in range(1, 7)))  # in all simulated rigs


def judged(rig: str, seed: int, *hold: str, honest: float = 1.0) -> Verdict:
    p = simulate(rig, seed, vary=honest != 1.0, honest=honest)
    _, found = calibrate_photogrammetric(p.rig, p.board, p.fields, scale=p.scale, hold=hold)
    return verdict_of(adjustment_concerns(found))


@pytest.mark.parametrize(("rig", "seed", "device"), [("paper", 3, "camera"), ("modern", 2, "projector")])
def test_residuals_beyond_their_sigmas_that_neighbours_share_contradict_the_model(
    rig: str, seed: int, device: str
) -> None:
    """Twice to three times their sigmas and more than half common to neighbours: each alone is a doubt."""
    verdict = judged(rig, seed, *(f"{device}.{name}" for name in FIVE))
    assert verdict.state == "failed"
    assert verdict.because[0].startswith(f"{device}.x0 is held at 0")  # the cause first
    assert any(text.startswith(f"{device}: residuals are systematic") for text in verdict.because)


@pytest.mark.parametrize(
    ("rig", "seed", "hold"),
    [
        ("paper", 1, ("camera.A1",)),
        ("paper", 1, ("camera.x0", "camera.y0")),
        ("paper", 2, ("camera.c",)),
        ("modern", 1, ("projector.x0",)),
        ("modern", 2, ("camera.c",)),
        ("modern", 2, ("projector.c",)),
    ],
)
def test_a_wrong_value_is_named_though_the_residuals_stay_within_their_sigmas(
    rig: str, seed: int, hold: tuple[str, ...]
) -> None:
    """All passed by their residuals, which are below 1.6 sigma; the values are 8 to 25 sigma off."""
    verdict = judged(rig, seed, *hold, *ZERO)
    assert verdict.state != "passed"
    named = [text.split(" is held")[0] for text in verdict.because if " is held" in text]
    assert sorted(named) == sorted(hold)


@pytest.mark.parametrize("honest", [0.6, 1.5])
def test_parameters_held_rightly_are_not_accused(honest: float) -> None:
    """Of 120 such rigs the largest shift of 11 parameters each was 3.1 sigma, and 6.4 is the limit."""
    assert [judged(rig, 40, *ZERO, honest=honest).state for rig in ("paper", "modern")] == ["passed"] * 2


def test_a_wrong_value_is_not_laid_on_the_captures() -> None:
    """Few captures fit a wrong c, all together do not: the first six and the other three seemed to be of two rigs."""
    verdict = judged("modern", 1, "projector.c")
    assert verdict.because[0].startswith("projector.c is held at 28, by the observations it is 28.77")
    assert not any("by themselves" in text for text in verdict.because)
