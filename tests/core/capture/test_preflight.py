"""Each pre-flight check on scenes with a known fault, and on one without."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from core.capture.fitness import exposure, focus, linearity_of_halves, linearity_of_levels, visibility
from core.capture.preflight import measure_settle, preflight
from core.devices.scene import FlatScene
from core.devices.virtual import Stage, VirtualCamera, VirtualProjector
from core.model import Finding, Subject
from core.patterns import Black, Pattern, Phase, White


def checked(scene: FlatScene) -> dict[str, Finding]:
    stage = Stage(scene)
    return {f.check: f for f in preflight(VirtualProjector(stage), VirtualCamera(stage), rest_s=0.02)}


@dataclass(frozen=True)
class Mapped(FlatScene):
    """A flat board whose projector coordinates are changed."""

    how: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        u, v, albedo = self.maps
        changed = {"mirrored": (63 - u, v), "upside down": (63 - u, 63 - v), "quarter": (v, 63 - u)}[self.how]
        object.__setattr__(self, "maps", (*changed, albedo))


def test_a_rig_without_faults_is_good_in_every_check() -> None:
    findings = checked(FlatScene(lamp=200.0))
    assert set(findings) == {"exposure", "settle", "linearity", "focus", "order", "orientation"}
    assert {f.level for f in findings.values()} == {"good"}


@pytest.mark.parametrize(("how", "level"), [("mirrored", "bad"), ("upside down", "warning"), ("quarter", "warning")])
def test_lines_that_lie_wrongly_are_told(how: str, level: str) -> None:
    finding = checked(Mapped(how=how))["orientation"]
    assert finding.level == level
    assert bool(finding.figures["mirrored"]) == (how == "mirrored")
    if how == "upside down":
        assert abs(finding.figures["turned_deg"]) > 170
    if how == "quarter":
        assert abs(abs(finding.figures["turned_deg"]) - 90) < 10


def test_patterns_in_a_wrong_order_are_told() -> None:
    class Swapped(FlatScene):
        def frame(self, pattern: Pattern, seed: int) -> np.ndarray:
            if isinstance(pattern, Phase) and pattern.axis == "x":
                pattern = replace(pattern, shift_rad=-pattern.shift_rad)
            return FlatScene().frame(pattern, seed)

    assert checked(Swapped())["order"].level == "bad"


@pytest.mark.parametrize("settle_ms", [0, 25])
def test_the_settle_time_is_measured(settle_ms: int) -> None:
    stage = Stage(FlatScene())
    projector = VirtualProjector(stage, settle_s=settle_ms / 1000)
    finding = measure_settle(projector, VirtualCamera(stage), rest_s=0.09)
    # not less than the truth, not more than twice it on a busy machine
    assert settle_ms <= finding.figures["settle_ms"] <= max(2 * settle_ms, 8)
    assert finding.curve[0][1] == pytest.approx(0.0 if settle_ms else 1.0, abs=0.02)


def test_a_settle_time_that_is_too_short_is_advised() -> None:
    stage = Stage(FlatScene())
    projector = VirtualProjector(stage, settle_s=0.03)
    projector.settle_s = 0.005
    finding = measure_settle(projector, VirtualCamera(stage), rest_s=0.09)
    assert finding.level == "warning"
    # not less than the truth, not more than twice it on a busy machine
    advised = float(finding.text.rpartition("settle_ms=")[2])
    assert 30 <= advised <= 60


def test_a_projector_that_gives_no_light_is_told() -> None:
    stage = Stage(FlatScene(lamp=0.0))
    assert "hardly changes" in measure_settle(VirtualProjector(stage), VirtualCamera(stage)).text


@pytest.mark.parametrize("power", [1.0, 2.2, 0.45])
def test_the_exponent_of_a_curved_rig_is_found(power: float) -> None:
    shown = np.linspace(0, 1, 9)
    albedo = np.linspace(0.5, 1, 50)[None, :] * np.ones((40, 1))
    finding = linearity_of_levels(shown, [200 * albedo * level**power + 10 for level in shown])
    assert finding.figures["exponent"] == pytest.approx(power, rel=1e-6)
    assert (finding.level == "good") == (power == 1.0)


@pytest.mark.parametrize("power", [1.0, 0.7])
def test_complementary_stripes_show_a_curve_of_a_black_and_white_rig(power: float) -> None:
    light = 0.5 + 0.4 * np.sin(np.arange(4000) * 0.37).reshape(40, 100)
    white, black, a, b = (200 * x**power for x in (np.ones_like(light), np.full_like(light, 0.02), light, 1.02 - light))
    finding = linearity_of_halves(white, black, a, b)
    # at half light the curve is 0.51^power of white; with black taken off both ends
    wanted = 0.51**power - (1 + 0.02**power) / 2
    assert finding.figures["deviation"] == pytest.approx(wanted / (1 - 0.02**power), abs=0.01)
    assert (finding.level == "good") == (power == 1.0)


@pytest.mark.parametrize(
    ("top", "level", "factor"), [(215, "good", 1.0), (100, "warning", 2.17), (255, "warning", 0.5), (2, "bad", 10.0)]
)
def test_the_exposure_advice_aims_at_85_per_cent(top: float, level: str, factor: float) -> None:
    finding = exposure(np.full((64, 64), float(top)), np.full((64, 64), 1.0), 255)
    assert finding.level == level
    assert finding.figures["factor"] == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize(("blur", "level"), [(0.5, "good"), (3.0, "warning")])
def test_the_focus_is_the_modulation_of_the_finest_stripes(blur: float, level: str) -> None:
    from core.model import Plan

    scene = FlatScene(blur_lines=blur, noise=0.0)
    steps = [Phase("x", 8.0, 4, k, k * np.pi / 2) for k in range(4)]
    plan = Plan(Subject("object", "a"), (White(), Black(), *steps), ())
    finding = focus(plan, [scene.frame(p, 0).astype(float) for p in plan.shots])
    # a cosine of period P blurred by sigma keeps exp(-2 pi² sigma² / P²); whole lines and four steps cost up to a third
    kept = np.exp(-2 * np.pi**2 * blur**2 / 64)
    assert 0.65 * kept < finding.figures["modulation"] <= 1.05 * kept
    assert finding.level == level
    assert finding.picture.shape == (4, 6)


def test_stripes_are_judged_over_the_depth() -> None:
    steps = np.cos(np.arange(4)[:, None, None] * np.pi / 2 + np.arange(64)[None, None, :] * 0.3) * np.ones((4, 64, 1))
    finding = visibility([-50, 0, 50], [100 + 30 * steps, 100 + 40 * steps, 100 + 5 * steps], noise=2.0)
    assert finding.level == "warning"
    assert "from -50 to 0 mm only" in finding.text
    assert [d for d, _ in finding.curve] == [-50, 0, 50]
