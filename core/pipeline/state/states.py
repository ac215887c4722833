"""The words for where stages stand, how the states of captures are put together, and what has changed in sentences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal

from core.lazy import dataclass
from core.pipeline.state.inputs import Record

Word = Literal["absent", "current", "outdated", "failed"]
STAGES = ("decode", "measure", "calibrate", "reconstruct", "evaluate", "report")
_WORST: tuple[Word, ...] = ("failed", "outdated", "absent", "current")
_MOST_NAMED = 3
MOST = 6  # sentences about one result
_WORDS = {"picks": "picks.json", "patterns": "the patterns in capture.json"}


def differences(then: Mapping[str, Any], now: Mapping[str, Any]) -> tuple[str, ...]:
    """Say what has changed since a result was made; nothing where both records are equal.

    Examples
    --------
    >>> differences({"rig": {"scale.length_mm": 258.6}}, {"rig": {"scale.length_mm": 261.186}})
    ('project.json: scale.length_mm was 258.6, is 261.186',)
    """
    if then == now:
        return ()
    found = [*_sentences(then, now)]
    if not found:
        found = ["it was made from something else"]
    if len(found) > MOST:
        found = [*found[: MOST - 1], f"and {len(found) - MOST + 1} more changes"]
    return tuple(found)


def _sentences(then: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    for name, (a, b) in _pairs(then, now, "methods"):
        yield f"the program's method to {name} changed (version {a} then, {b} now)"
    for name, (a, b) in _pairs(then, now, "rig"):
        yield f"project.json: {_was(name, a, b)}"
    for name, (a, b) in _pairs(then, now, "options"):
        yield f"option {_was(name, a, b)}"
    for name, (a, b) in _pairs(then, now, "captures"):
        if a is None:
            yield f"{name} was added"
        elif b is None:
            yield f"{name} has no part any more"
        else:
            yield from _capture(name, a, b)
    for name, (a, b) in _pairs(then, now, "results"):
        gone, new = f"the {name} is not there any more", f"the {name} is new"
        yield new if a is None else gone if b is None else f"the {name} is another one now"


def _capture(name: str, then: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    for file, (a, b) in _pairs(then, now, "frames"):
        yield f"{name}/{file} {'is new' if a is None else 'is gone' if b is None else 'changed'}"
    for key in dict.fromkeys((*then, *now)):
        a, b = then.get(key), now.get(key)
        if key == "frames" or a == b:
            continue
        if key == "picks":
            yield f"{name}/picks.json {'is new' if a is None else 'is gone' if b is None else 'changed'}"
        elif key == "board":
            yield f"the board of {name} changed (its table of targets)"
        elif key in _WORDS:
            yield f"{name}: {_WORDS[key]} changed"
        else:
            yield f"{name}: {_was(key, a, b)}"


def _pairs(then: Mapping[str, Any], now: Mapping[str, Any], part: str) -> Iterator[tuple[str, tuple[Any, Any]]]:
    a, b = then.get(part) or {}, now.get(part) or {}
    for name in dict.fromkeys((*a, *b)):
        if a.get(name) != b.get(name):
            yield name, (a.get(name), b.get(name))


def _was(name: str, then: Any, now: Any) -> str:
    if then is None:
        return f"{name} is {_short(now)} now, there was none"
    if now is None:
        return f"{name} was {_short(then)}, is not there any more"
    return f"{name} was {_short(then)}, is {_short(now)}"


def _short(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(map(_short, value)) + "]" if len(value) < 7 else f"a list of {len(value)}"
    return f"{value:.10g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class State:
    """Where a stage stands, for one capture or all, and the sentences that say because of what."""

    state: Word
    because: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Give it as `status --json` writes it."""
        return {"state": self.state, "because": list(self.because)}


CURRENT = State("current")


@dataclass(frozen=True)
class ProjectStates:
    """The state of every stage, of the project and of every capture that the stage is for."""

    stages: Mapping[str, State]
    captures: Mapping[str, Mapping[str, State]]

    def as_dict(self) -> dict[str, Any]:
        """Give it as `status --json` writes it."""
        return {
            "stages": {stage: state.as_dict() for stage, state in self.stages.items()},
            "captures": {
                name: {stage: state.as_dict() for stage, state in states.items()}
                for name, states in self.captures.items()
            },
        }

    def outdated(self, *stages: str) -> tuple[str, ...]:
        """Say which of some stages have results that do not follow from what is there, a sentence each."""
        found = {stage: self.stages[stage] for stage in stages}
        return tuple(
            f"{stage} is {state.state}: {'; '.join(state.because)}"
            for stage, state in found.items()
            if state.state in ("outdated", "failed")
        )


def part_of(then: Record, now: Record, name: str) -> State:
    """State of one capture in the result of many; what was chosen for all is not the capture's."""
    if name not in then.get("captures", {}):
        return State("absent", ("has no part in it yet",))

    def own(record: Record) -> Record:
        return {
            **{key: record.get(key) for key in ("results", "methods", "rig")},
            "captures": {name: record.get("captures", {}).get(name)},
        }

    changed = differences(own(then), own(now))
    return State("outdated", changed) if changed else CURRENT


def together(each: Mapping[str, State], nothing: str) -> State:
    """Put the states of captures together: the worst, and because of which captures."""
    if not each:
        return State("absent", (nothing,))
    word = next(w for w in _WORST if any(s.state == w for s in each.values()))
    if word == "current":
        return CURRENT
    named = [(name, state) for name, state in each.items() if state.state == word]
    if word == "absent":
        why: dict[str, list[str]] = {}
        for name, state in named:
            why.setdefault("; ".join(state.because), []).append(name)
        return State(word, tuple(f"{len(n)} of {len(each)} captures: {text} ({_few(n)})" for text, n in why.items()))
    because = list(dict.fromkeys(text for _, state in named for text in state.because))
    if len(because) > 2 * _MOST_NAMED:
        because = [*because[: 2 * _MOST_NAMED], f"and {len(because) - 2 * _MOST_NAMED} more changes"]
    return State(word, tuple(because))


def _few(names: list[str]) -> str:
    return ", ".join(names[:_MOST_NAMED]) + (" …" if len(names) > _MOST_NAMED else "")


def worst(states: Iterable[State]) -> State:
    """Give the worst of some states, with all that it is because of: a cause that is handed on is told once.

    Examples
    --------
    >>> worst([State("outdated", ("a",)), State("outdated", ("measure is outdated: a", "b"))]).because
    ('a', 'b')
    """
    found = list(states) or [CURRENT]
    word = next(w for w in _WORST if any(s.state == w for s in found))
    because = dict.fromkeys(text for s in found if s.state == word for text in s.because)
    handed_on = tuple(": " + text for text in because)
    return State(word, tuple(text for text in because if not text.endswith(handed_on)))


def upstream_words(stage: str, state: State) -> tuple[str, ...]:
    """Say of a stage that a result was made by that it is not current itself."""
    return tuple(f"{stage} is {state.state}: {text}" for text in state.because) or (f"{stage} is {state.state}",)
