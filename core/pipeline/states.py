"""The words for where stages stand, and how the states of captures are put together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from core.pipeline.differences import differences
from core.pipeline.inputs import Record

Word = Literal["absent", "current", "outdated", "failed"]
STAGES = ("decode", "measure", "calibrate", "reconstruct", "evaluate", "report")
_WORST: tuple[Word, ...] = ("failed", "outdated", "absent", "current")
_MOST_NAMED = 3


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


def part_of(then: Record, now: Record, name: str, *shared: str) -> State:
    """State of one capture in the result of many."""
    if name not in then.get("captures", {}):
        return State("absent", ("has no part in it yet",))

    def own(record: Record) -> Record:
        return {
            **{key: record.get(key) for key in shared},
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
    """Give the worst of some states, with all that it is because of."""
    found = list(states) or [CURRENT]
    word = next(w for w in _WORST if any(s.state == w for s in found))
    return State(word, tuple(dict.fromkeys(text for s in found if s.state == word for text in s.because)))


def upstream_words(stage: str, state: State) -> tuple[str, ...]:
    """Say of a stage that a result was made by that it is not current itself."""
    return tuple(f"{stage} is {state.state}: {text}" for text in state.because) or (f"{stage} is {state.state}",)
