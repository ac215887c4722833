"""What the projector is to show: presets with their options, and what a sequence is to a projector."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from core.errors import InputError
from core.fields import Fields
from core.lazy import dataclass
from core.patterns import PRESETS, Pattern, SequenceSpec, read_sequence, shows_grey
from core.progress import SILENT, Progress
from stripe_gui.presenters.capture import pattern_text
from stripe_gui.presenters.told import sentence, told, translate

CHOICES = {"axes": ("xy", "x", "y"), "code": ("gray", "binary"), "profile": ("sine", "square")}
USUAL_FRAME_S = 0.1  # as `stripe-core plan-sequence` assumes where nothing was measured

Refusal = Callable[[Pattern], str | None]


@dataclass(frozen=True)
class Option:
    """One option of a preset: its key, what it is called, what it is where nobody says otherwise, and its choices."""

    key: str
    title: str
    usual: Any
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class Shown:
    """A projector as far as it is known: its lines, its own sequence, what it refuses, how long an image takes.

    `frame_s` is 0 where the images are there already.
    """

    lines: tuple[int, int]
    own: tuple[Pattern, ...] = ()
    refusal: Refusal | None = None
    frame_s: float | None = None


@dataclass(frozen=True)
class SequenceView:
    """A sequence looked at; `problem` says why it cannot be used, `refusal` why this projector cannot show it."""

    patterns: tuple[Pattern, ...] = ()
    words: str = ""
    problem: str = ""
    refusal: str = ""


def preset_title(name: str) -> str:
    """Name a preset, with what it is in words."""
    return f"{name}: {told(PRESETS[name].words)}"


def options_of(preset: str) -> tuple[Option, ...]:
    """List the options of a preset, with what they are where nobody says otherwise."""
    titles = {
        "axes": translate("Sequence", "Axes"),
        "plain": translate("Sequence", "White and black frame"),
        "period": translate("Sequence", "Period [lines]"),
        "periods": translate("Sequence", "Periods [lines]"),
        "steps": translate("Sequence", "Phase steps"),
        "cell": translate("Sequence", "Cell of the code [lines]"),
        "code": translate("Sequence", "Code"),
        "profile": translate("Sequence", "Profile"),
        "inverse": translate("Sequence", "Inverse frames"),
        "frames": translate("Sequence", "Frames"),
        "blur": translate("Sequence", "Blur [lines]"),
        "seed": translate("Sequence", "Seed"),
    }
    found = []
    for key, read in PRESETS[preset].options.items():
        usual = read(Fields({}, preset), key)
        usual = "".join(usual) if isinstance(usual, tuple) and key == "axes" else usual
        found.append(Option(key, titles.get(key, key), usual, CHOICES.get(key, ())))
    return tuple(found)


def spec_of(preset: str, options: dict[str, Any]) -> SequenceSpec:
    """Make a sequence of a preset and what was typed for its options; an InputError names the option."""
    return read_sequence({"preset": preset, **options}, translate("Sequence", "sequence"))


def typed(text: str) -> Any:
    """Read an option as it was typed: a number, a list with or without brackets, or a word.

    Examples
    --------
    >>> typed("16"), typed("16, 106.5"), typed("x")
    (16, [16, 106.5], 'x')
    """
    for form in (text, f"[{text}]"):
        try:
            return json.loads(form)
        except ValueError:
            continue
    return text


def look_at(spec: SequenceSpec | None, shown: Shown, progress: Progress = SILENT) -> SequenceView:
    """Say what a sequence is to a projector: images, time, whether it can be shown; None is the projector's own."""
    progress.check()
    if spec is None and not shown.own:
        text = translate(
            "Sequence",
            "Chosen once the projector answers: the sequence it is made for, else sine fringes if it can show grey.",
        )
        return SequenceView(words=text)
    try:
        patterns = shown.own if spec is None else spec.patterns(shown.lines)
    except InputError as error:
        return SequenceView(problem=f"{sentence(error.seen)}: {error.remedy}.")
    progress.check()
    if shown.frame_s == 0:
        return SequenceView(patterns, translate("Sequence", "{n} patterns.").format(n=len(patterns)))
    frame_s = shown.frame_s or USUAL_FRAME_S
    text = translate("Sequence", "{n} images, about {s:.0f} s at {ms:.0f} ms an image.")
    words = [text.format(n=len(patterns), s=max(1.0, len(patterns) * frame_s), ms=1000 * frame_s)]
    if shown.refusal is None and not shows_grey(patterns):
        words.append(translate("Sequence", "Black and white only: any projector of this size can show it."))
    elif shown.refusal is None:
        words.append(translate("Sequence", "It has levels of grey: a projector of black and white cannot show it."))
    refused = [(p, why) for p in patterns if shown.refusal is not None and (why := shown.refusal(p))]
    refusal = ""
    if refused:
        text = translate("Sequence", "This projector cannot show {n} of {of} patterns, such as “{pattern}”: {why}.")
        first, why = refused[0]
        refusal = text.format(n=len(refused), of=len(patterns), pattern=pattern_text(first), why=told(why))
    elif shown.refusal is not None:
        words.append(translate("Sequence", "This projector can show it."))
    return SequenceView(patterns, " ".join(words), refusal=refusal)


def sequence_text(spec: SequenceSpec | None) -> str:
    """Name a sequence in a line."""
    if spec is None:
        return translate("Sequence", "the projector's own")
    if spec.preset is None:
        return translate("Sequence", "a list of {n} patterns").format(n=len(spec.listed))
    more = ", ".join(f"{key} {value}" for key, value in spec.options.items())
    return preset_title(spec.preset) + (f" ({more})" if more else "")
