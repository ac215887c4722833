"""Picking without its window: which target is next, what was picked and excluded, undo and redo; all saved at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from core.lazy import dataclass
from core.model import Array, Capture, Seed, TargetSet, Testfield
from core.pipeline.measure import Side, side_of
from core.project import ENOUGH, keep_picks, kept_picks

Target = tuple[int, int]


@dataclass(frozen=True)
class Picks:
    """What an operator decided about one image."""

    seeds: tuple[Seed, ...] = ()
    excluded: tuple[Target, ...] = ()


@dataclass(frozen=True)
class Measurement:
    """The targets found from certain picks, or why there are none."""

    picks: Picks
    targets: TargetSet | None
    refusal: str = ""


@dataclass(frozen=True)
class _Step:
    """One change: what was decided about an image before and after, and the target it was about."""

    image: int
    target: Target
    before: Picks
    after: Picks


def _unpicked(capture: Capture) -> tuple[object, ...]:
    """Tell one content of a capture from another, whatever was picked in it."""
    field = capture.testfield
    if field is None:
        return (capture.path, capture.frames)
    arrays = field.xyz_mm.tobytes(), field.diameter_mm.tobytes()
    return (capture.path, capture.frames, field.kind, field.estimator, field.polarity, *arrays)


def corner_targets(field: Testfield) -> tuple[Target, ...]:
    """Give the four targets nearest to the corners of the field, round it from the first row and column on."""
    at = np.stack([field.row, field.col], axis=1)
    low, high = at.min(axis=0), at.max(axis=0)
    corners = ((low[0], low[1]), (low[0], high[1]), (high[0], high[1]), (high[0], low[1]))
    nearest = [at[int(np.argmin(np.sum((at - np.array(c)) ** 2, axis=1)))] for c in corners]
    return tuple(dict.fromkeys((int(r), int(c)) for r, c in nearest))


class Picking:
    """The picks of several captures of boards (at least one), of the images of one camera and projector.

    Every change is in the capture's folder before it is in here: what is shown is never ahead of what is saved.
    """

    def __init__(self, captures: Sequence[Capture], pair: tuple[str, str] = ("", "")) -> None:
        self._whole, self._pair = tuple(captures), pair
        self.captures = tuple(c.seen_by(*pair) for c in captures)
        self._picks = [self._kept(i) for i in range(len(captures))]
        self._measured: dict[int, Measurement] = {}
        self._guesses: dict[int, tuple[tuple[Seed, ...], ...]] = {}
        self._dots: dict[int, Array] = {}
        self._done: list[_Step] = []
        self._undone: list[_Step] = []
        self.image = 0
        self.wanted: tuple[Target, ...] = ()
        self.target: Target = (0, 0)
        self.go_to(0)

    def is_about(self, captures: Sequence[Capture], pair: tuple[str, str] = ("", "")) -> bool:
        """Say whether these are the same captures with the same frames and boards, whatever was picked in them."""
        return pair == self._pair and [_unpicked(c) for c in captures] == [_unpicked(c) for c in self._whole]

    # ------------------------------------------------------------------------------------------------ the image at work

    @property
    def capture(self) -> Capture:
        """The capture at work, with its picks as they are now."""
        return replace(self.captures[self.image], seeds=self.picks.seeds, excluded=self.picks.excluded)

    @property
    def field(self) -> Testfield:
        field = self.captures[self.image].testfield
        assert field is not None, "captures without a board have nothing to pick"
        return field

    @property
    def picks(self) -> Picks:
        return self._picks[self.image]

    @property
    def picked(self) -> Mapping[Target, Seed]:
        return {(s.row, s.col): s for s in self.picks.seeds}

    @property
    def complete(self) -> bool:
        """Whether the image at work needs no further pick."""
        return self.settled(self.image)

    def settled(self, image: int) -> bool:
        """Whether an image has its picks, or its targets were recognised without."""
        return len(self._picks[image].seeds) >= ENOUGH or self.recognised(image) is not None

    def recognised(self, image: int) -> TargetSet | None:
        """Give the targets of an image that nobody picked; None where there are picks, or no targets."""
        found = self.measured(image)
        return found.targets if found is not None and not self._picks[image].seeds else None

    def picks_of(self, image: int) -> Picks:
        return self._picks[image]

    def go_to(self, image: int) -> None:
        """Work on another image; the targets asked for are those of its own picks, its guess, or the image before."""
        before, self.image = self.image, image
        self.wanted = self._wanted(before)
        self.target = self.next_target() or self.wanted[0]

    def show(self, name: str) -> None:
        """Work on the capture of a name, if it has a board, unless it is at work already."""
        image = next((i for i, capture in enumerate(self.captures) if capture.name == name), self.image)
        if image != self.image:
            self.go_to(image)

    def _wanted(self, before: int) -> tuple[Target, ...]:
        guess = self.guess or ()
        known = self.picks.seeds if self.complete else (*self.picks.seeds, *guess, *self._picks[before].seeds)
        fields = self.field.index()
        last = dict.fromkeys((s.row, s.col) for s in known if (s.row, s.col) in fields)
        most = max(ENOUGH, len(self.picks.seeds))
        return tuple(dict.fromkeys((*last, *corner_targets(self.field))))[:most]

    def next_image(self, step: int) -> int:
        """Give the image so many further on, or the last one there."""
        return min(max(self.image + step, 0), len(self.captures) - 1)

    def next_due(self) -> int | None:
        """Give the next image, round the end, whose targets nobody and nothing has told yet."""
        ahead = [(self.image + i) % len(self.captures) for i in range(1, len(self.captures))]
        return next((i for i in ahead if not self.settled(i)), None)

    # ------------------------------------------------------------------------------------ the target to be picked

    def next_target(self) -> Target | None:
        """Give the first target asked for that was not picked."""
        return next((t for t in self.wanted if t not in self.picked), None)

    def choose(self, target: Target) -> None:
        """Pick this target next, or look at it; it takes the place of the last one asked for that has no pick."""
        if target not in self.field.index():
            return
        if target not in self.wanted and not self.complete:
            free = [t for t in self.wanted if t not in self.picked]
            out = self.target if self.target in free else free[-1]
            self.wanted = tuple(target if t == out else t for t in self.wanted)
        self.target = target

    def cycle(self, step: int = 1) -> None:
        """Choose the next of the targets asked for."""
        at = self.wanted.index(self.target) if self.target in self.wanted else -1 if step > 0 else 0
        self.target = self.wanted[(at + step) % len(self.wanted)]

    # ----------------------------------------------------------------------------------------------------- guesses

    @property
    def guess(self) -> tuple[Seed, ...] | None:
        """The guess in front: picks that the order of the dots suggests; None where there is none."""
        guesses = self._guesses.get(self.image, ())
        return guesses[0] if guesses and not self.settled(self.image) else None

    @property
    def dots(self) -> Array:
        """Where dots are in the image at work, shape (n, 2) px, as far as is known."""
        return self._dots.get(self.image, np.zeros((0, 2)))

    def next_dot(self, u: float, v: float, direction: tuple[int, int]) -> tuple[float, float] | None:
        """Give the dot that follows in a direction of the image; None where none is known."""
        away = self.dots - (u, v)
        along, across = away @ direction, np.abs(away @ direction[::-1])
        cost = np.where((along > 3) & (across < along), along + 2 * across, np.inf)
        if not np.isfinite(cost).any():
            return None
        u, v = self.dots[int(np.argmin(cost))]
        return float(u), float(v)

    @property
    def guesses(self) -> int:
        return len(self._guesses.get(self.image, ()))

    def has_guesses(self, image: int) -> bool:
        return image in self._guesses

    def find(self, image: int, dots: Array) -> None:
        """Take the places of an image's dots, shape (n, 2) px."""
        self._dots[image] = dots

    def suggest(self, image: int, guesses: Sequence[tuple[Seed, ...]]) -> None:
        """Take guesses for an image, the likeliest first."""
        self._guesses[image] = tuple(guesses)
        if image == self.image and not self.picks.seeds and guesses:
            self.wanted = tuple((s.row, s.col) for s in guesses[0])
            self.target = self.wanted[0]

    def turn_guess(self) -> None:
        guesses = self._guesses.get(self.image, ())
        if len(guesses) > 1:
            self.suggest(self.image, (*guesses[1:], guesses[0]))

    def likely(self) -> tuple[float, float] | None:
        """Where the target at work is likely to be (px): its pick, a guess, or its place in another image."""
        if self.target in self.picked:
            seed = self.picked[self.target]
            return seed.u, seed.v
        others = [*range(self.image - 1, -1, -1), *range(self.image + 1, len(self.captures))]
        for seeds in (self.guess or (), *(self._picks[i].seeds for i in others)):
            for seed in seeds:
                if (seed.row, seed.col) == self.target:
                    return seed.u, seed.v
        return None

    def neighbour(self, image: int) -> tuple[Seed, ...]:
        """Give the picks of the nearest other image of the same board that is picked, earlier ones first."""
        own = self.captures[image].testfield
        for i in sorted(range(len(self.captures)), key=lambda i: (i > image, abs(i - image))):
            field = self.captures[i].testfield
            if i != image and len(self._picks[i].seeds) >= ENOUGH and own and field and field.index() == own.index():
                return self._picks[i].seeds
        return ()

    # ------------------------------------------------------------------------------------------------ changes

    def pick(self, u: float, v: float) -> None:
        """Put the target at work at a position (px) and save; a pick it had is moved."""
        seed = Seed(*self.target, round(float(u), 3), round(float(v), 3))
        if self.target in self.picked:
            seeds = tuple(seed if (s.row, s.col) == self.target else s for s in self.picks.seeds)
        else:
            seeds = (*self.picks.seeds, seed)
        self._change(replace(self.picks, seeds=seeds))

    def take(self, seeds: Sequence[Seed]) -> None:
        """Take picks in one step in place of those the image has."""
        self._change(replace(self.picks, seeds=tuple(seeds)))
        self.wanted = tuple((s.row, s.col) for s in seeds)
        self.target = self.wanted[0]

    def remove(self) -> bool:
        """Take the pick of the target at work away; without one, the last pick made. Say whether there was any."""
        if not self.picks.seeds:
            return False
        if self.target not in self.picked:
            self.target = (self.picks.seeds[-1].row, self.picks.seeds[-1].col)
        self._change(replace(self.picks, seeds=tuple(s for s in self.picks.seeds if (s.row, s.col) != self.target)))
        return True

    def exclude(self, target: Target) -> None:
        """Leave a target out of what is measured in this image, or restore it."""
        excluded = self.picks.excluded
        kept = tuple(t for t in excluded if t != target)
        self._change(replace(self.picks, excluded=kept if target in excluded else (*excluded, target)), target)

    def undo(self) -> bool:
        return self._again(self._done, self._undone, "before")

    def redo(self) -> bool:
        return self._again(self._undone, self._done, "after")

    @property
    def can_undo(self) -> bool:
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        return bool(self._undone)

    def reload(self) -> bool:
        """Take over picks that were changed by others, which ends undoing; say whether any were."""
        now = [self._kept(i) for i in range(len(self.captures))]
        if now == self._picks:
            return False
        self._picks = now
        self._done.clear()
        self._undone.clear()
        self.go_to(self.image)
        return True

    def _change(self, picks: Picks, target: Target | None = None) -> None:
        if picks != self.picks:
            step = _Step(self.image, target or self.target, self.picks, picks)
            self._put(self.image, picks)
            self._done.append(step)
            self._undone.clear()

    def _again(self, source: list[_Step], sink: list[_Step], side: str) -> bool:
        if not source:
            return False
        step = source[-1]
        self._put(step.image, getattr(step, side))
        sink.append(source.pop())
        self.go_to(step.image)
        self.choose(step.target)
        return True

    def _put(self, image: int, picks: Picks) -> None:
        whole, camera = self._whole[image], self.captures[image].camera
        seeds = picks.seeds
        if len({frame.camera for frame in whole.frames}) > 1:  # those in the other cameras' images stay
            others = [s for s in kept_picks(whole.path)[0] if (s.camera or whole.camera) != camera]
            named = (replace(s, camera=s.camera or whole.camera) for s in others)
            seeds = (*named, *(replace(s, camera=camera) for s in seeds))
        keep_picks(whole.path, seeds, picks.excluded)
        self._picks[image] = picks

    def _kept(self, image: int) -> Picks:
        seeds, excluded = kept_picks(self._whole[image].path)
        own = replace(self._whole[image], seeds=seeds).seeds_in(self.captures[image].camera)
        return Picks(tuple(replace(s, camera="") for s in own), excluded)

    # ------------------------------------------------------------------------------------------------ measurements

    def measured(self, image: int) -> Measurement | None:
        """Give what was measured in an image from the picks it has now."""
        found = self._measured.get(image)
        return found if found is not None and found.picks == self._picks[image] else None

    def side(self) -> Side:
        """From which side most of the picked images show their board."""
        picked = [replace(c, seeds=p.seeds) for c, p in zip(self.captures, self._picks, strict=True)]
        return side_of([c for c in picked if len(c.seeds) >= ENOUGH])

    def due(self, image: int) -> bool:
        """Say whether accepted picks wait for measuring again because targets were excluded or restored."""
        found = self._measured.get(image)
        return found is not None and found.picks != self._picks[image] and found.picks.seeds == self._picks[image].seeds

    def keep_measurement(self, image: int, measurement: Measurement | None) -> None:
        """Take what came out of measuring; None forgets it."""
        self._measured.pop(image, None)
        if measurement is not None:
            self._measured[image] = measurement
