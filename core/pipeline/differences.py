"""Two records of what a result was made from, set side by side in sentences that name the file or the value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

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
