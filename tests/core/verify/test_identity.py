"""Wrong frames among right ones, on scenes of the virtual bench: each must be seen, and none where there is none."""

import itertools
import random
from dataclasses import dataclass, replace

import numpy as np
import pytest

from core.capture.plan import guards_for
from core.devices import open_camera, open_projector
from core.devices.scene import FlatScene
from core.model import Plan, Subject
from core.patterns import Code, Phase, axis_of, brightness, describe, parse_sequence, reference_sequence
from core.verify.identity import identity
from core.verify.lookup import LeftOut, leave_one_out, weigh_lines
from core.verify.quality import Sampled, sample_grid, summarise

SCENES = ["testfield-03", "object-step"]


@dataclass
class Stack:
    """All shots of a capture at the sampled pixels, and the check of them."""

    plan: Plan
    grey: np.ndarray
    at: np.ndarray
    shape: tuple[int, int]
    lines: tuple[int, int]

    def sampled(self, grey: np.ndarray) -> Sampled:
        return summarise(self.plan, grey, self.at, self.shape, 255)

    def wrong(self, grey: np.ndarray) -> set[int]:
        findings = identity(self.plan, self.sampled(grey), self.lines)
        return {shot for f in findings if f.level == "bad" for shot in f.shots}

    def harm(self, grey: np.ndarray, shot: int) -> float:
        """Share of the lit pixels that see something else than they should, by a fifth of full light and noise."""
        sampled = self.sampled(self.grey)
        contrast = (sampled.white - sampled.black)[sampled.lit]
        off = np.abs(grey[shot] - self.grey[shot])[sampled.lit] / contrast
        return float(np.mean(off > 0.2 + 4 * sampled.noise / contrast))


def take(scene: str) -> Stack:
    url = f"virtual:quick?shot={scene}"
    projector, camera = open_projector(url), open_camera(url)
    chosen = tuple(reference_sequence(*projector.size))
    plan = Plan(Subject("object", "a"), chosen, guards_for(chosen, projector.size))
    images = []
    for pattern in plan.shots:
        projector.show(pattern)
        images.append(camera.grab().pixels)
    at = sample_grid(images[0].shape)[:, ::5]  # fewer than in earnest: what is found here is found there
    return Stack(plan, np.array([i[at[0], at[1]] for i in images], float), at, images[0].shape, projector.size)


@pytest.fixture(scope="module", params=SCENES)
def stack(request: pytest.FixtureRequest) -> Stack:
    return take(request.param)


def square_on(size: tuple[int, int], lines: int) -> Stack:
    """A camera without blur, its rows along the projector's: each pixel has the mean light of its area."""
    chosen = tuple(reference_sequence(lines, lines))
    plan, rng = Plan(Subject("object", "a"), chosen, guards_for(chosen, (lines, lines))), np.random.default_rng(0)
    grey = []
    for pattern in plan.shots:
        light = brightness(pattern, np.arange(lines))
        across, down = (np.repeat(light, n).reshape(n, lines).mean(axis=1) for n in size)
        image = np.broadcast_to(down[:, None] if axis_of(pattern) == "y" else across, size[::-1])
        grey.append(np.rint(20 + 170 * image + rng.normal(0, 1, image.shape)))
    at = sample_grid(size[::-1])
    return Stack(plan, np.array([g[at[0], at[1]] for g in grey]), at, size[::-1], (lines, lines))


def test_frames_sharper_than_any_that_are_looked_up_are_right_and_wrong_ones_wrong() -> None:
    """A projector of 64 lines fills 96 x 72 px: step 0 was said to contradict the others, in 0.0 % of the pixels."""
    stack = square_on((96, 72), 64)
    assert stack.wrong(stack.grey) == set()
    for shot in stack.plan.own[2::7]:
        for other in (o for o in stack.plan.own[::4] if stack.plan.shots[o] != stack.plan.shots[shot]):
            grey = stack.grey.copy()
            grey[shot] = stack.grey[other]
            assert shot in stack.wrong(grey), (describe(stack.plan.shots[shot]), describe(stack.plan.shots[other]))


def test_right_frames_raise_no_alarm(stack: Stack) -> None:
    assert stack.wrong(stack.grey) == set()


def test_a_frame_that_shows_another_pattern_is_among_those_taken_again(stack: Stack) -> None:
    rng = random.Random(1)
    for shot in stack.plan.own[::4]:
        other = rng.choice([i for i, p in enumerate(stack.plan.shots) if p != stack.plan.shots[shot]])
        grey = stack.grey.copy()
        grey[shot] = stack.grey[other]
        if stack.harm(grey, shot) > 0.02:
            assert shot in stack.wrong(grey), (shot, other)


def test_a_frame_that_shows_the_pattern_before_is_seen(stack: Stack) -> None:
    for shot in stack.plan.own[::4]:
        grey = stack.grey.copy()
        grey[shot] = stack.grey[shot - 1]
        if stack.harm(grey, shot) > 0.02:
            assert shot in stack.wrong(grey), shot


def test_any_two_exchanged_bits_are_seen(stack: Stack) -> None:
    """Parity cannot tell these; only the places of the edges can."""
    codes = [i for i in stack.plan.own if isinstance(stack.plan.shots[i], Code)]
    pairs = [p for p in itertools.combinations(codes, 2) if len({stack.plan.shots[i].axis for i in p}) == 1]
    for a, b in pairs[::8]:
        grey = stack.grey.copy()
        grey[[a, b]] = grey[[b, a]]
        if stack.harm(grey, a) > 0.02:
            assert stack.wrong(grey), (a, b)


@pytest.mark.parametrize("late", [1, -1, 3])
def test_a_sequence_that_is_late_or_early_as_a_whole_is_seen(stack: Stack, late: int) -> None:
    assert stack.wrong(np.roll(stack.grey, late, axis=0))


def test_frames_torn_at_half_their_lit_height_are_seen(stack: Stack) -> None:
    lit = stack.sampled(stack.grey).lit
    lower = stack.at[0] > np.median(stack.at[0][lit])
    for shot in stack.plan.own[::4]:
        grey = stack.grey.copy()
        grey[shot][lower] = stack.grey[shot - 1][lower]
        if stack.harm(grey, shot) > 0.05:
            assert stack.wrong(grey), shot


def test_the_finding_names_what_is_shown_instead() -> None:
    stack = take("plane%2B15")
    grey = stack.grey.copy()
    first = stack.plan.own.start
    grey[first + 10] = stack.grey[first + 9]
    texts = [f.text for f in identity(stack.plan, stack.sampled(grey), stack.lines) if f.level == "bad"]
    step = "square step {} of 4, period 4 across columns"
    assert texts == [f"frame 10 claims {step.format(3)} and shows {step.format(2)}"]


@pytest.mark.parametrize("far", [0.1, 100.0])
def test_lines_are_weighed_as_in_plain_arrays(far: float) -> None:
    rng = np.random.default_rng(1)
    shapes = ((50, 300), (6, 50), (6, 300), (6,), (50,))
    whole, values, possible, weight, near = (rng.random(shape, np.float32) for shape in shapes)
    whole *= 5
    told, best = np.empty((6, 4, 50), np.float32), np.empty((6, 50), np.intp)
    weigh_lines(whole, values, possible, weight, near, far, told, best)
    for seen, lines, own, said, first in zip(values, possible, weight, told, best, strict=True):
        distance = whole - own * (seen[:, None] - lines) ** 2
        fit = distance <= (distance.min(axis=1) + near)[:, None]
        ends = np.where(fit, lines, np.inf).min(axis=1), np.where(fit, lines, -np.inf).max(axis=1)
        parts = np.array([distance[:, part].min(axis=1) for part in (lines > 0.5, lines <= 0.5)])
        within = parts <= distance.min(axis=1) + far
        np.testing.assert_array_equal(said[:2][within], parts[within])
        assert (said[:2] >= parts).all()
        np.testing.assert_array_equal(said[2:], ends)
        np.testing.assert_array_equal(first, distance.argmin(axis=1))


def test_what_nothing_repeats_is_listed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Guards show a step before and after, too; where they are faint none of the three is judged."""

    def unjudged(*given: object) -> LeftOut:
        left = leave_one_out(*given)  # type: ignore[arg-type]
        return replace(left, judged=[False] * len(left.judged))

    monkeypatch.setattr("core.verify.identity.leave_one_out", unjudged)
    stack = take("plane%2B15")
    shown = [describe(p) for p in stack.plan.shots]
    texts = [f.text for f in identity(stack.plan, stack.sampled(stack.grey), stack.lines) if "repeats" in f.text]
    assert len(shown) > len({*shown})
    assert len(texts) == 2
    assert max(text.count(name) for text in texts for name in shown) == 1


@pytest.mark.parametrize(
    ("sequence", "gamma"), [("gray-inverse", 1.0), ("multi-frequency", 1.0), ("multi-frequency", 2.2)]
)
def test_a_step_that_shows_its_neighbour_is_no_response(sequence: str, gamma: float) -> None:
    """Of few periods a curve of grey values may bring even these together."""
    scene = FlatScene()
    chosen = tuple(parse_sequence(sequence).patterns(scene.projector_size))
    plan = Plan(Subject("object", "a"), chosen, guards_for(chosen, scene.projector_size))
    images = [180 * (scene.frame(p, k) / 180.0) ** gamma for k, p in enumerate(plan.shots)]
    at = sample_grid(images[0].shape)
    stack = Stack(plan, np.array([i[at[0], at[1]] for i in images]), at, images[0].shape, scene.projector_size)
    assert stack.wrong(stack.grey) == set()
    steps = [i for i in plan.own if isinstance(plan.shots[i], Phase) and plan.shots[i].period < 20]
    for shot, other in itertools.permutations(steps, 2):
        if abs(shot - other) == 1 and plan.shots[shot].axis == plan.shots[other].axis:
            grey = stack.grey.copy()
            grey[shot] = stack.grey[other]
            assert stack.wrong(grey), (shot, other)
