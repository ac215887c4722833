"""Words in which about half the frames switch at every line.

A frame tells where a pixel lies by the edges near it. In a Gray code one frame has an edge there; here about half of
all have one at every line, each after a run of 1 to 3 lines, so that every frame measures the place as well as naming
it. Which of them switch is chosen so that the blurred words of any two lines are as unlike as they can be made.
"""

from __future__ import annotations

from functools import lru_cache
from math import erf, sqrt
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

LONGEST_RUN = 3  # lines; longer runs have edges too far apart, shorter ones only would leave no choice
FEW = 10  # frames
TRIALS = 24  # words that are tried for every line; thrice as many where frames are few
STARTS = 8  # words before the first line, for the runs to begin evenly


@lru_cache(maxsize=32)
def dense_words(lines: int, frames: int, blur_lines: float = 0.55, seed: int = 0) -> NDArray[np.uint8]:
    """Choose the words, shape (lines, frames), 0 or 1; equal arguments give equal words.

    Two words are compared as they will be seen through a Gaussian blur of this sigma.

    Examples
    --------
    >>> words = dense_words(640, 14)
    >>> switched = (words[1:] != words[:-1]).sum(axis=1)
    >>> bool(switched.min() >= 5 and switched.max() <= 9)
    True
    """
    draw = Random(1000 * seed + frames)  # its sequence is the same in every version of Python
    aside, own = _weights(blur_lines)
    tried = TRIALS * (3 if frames <= FEW else 1)
    word = [int(draw.random() < 0.5) for _ in range(frames)]
    run = [1 + int(draw.random() * LONGEST_RUN) for _ in range(frames)]
    before, words = word, np.empty((lines + STARTS, frames), np.uint8)
    seen = np.empty((2 * (lines + STARTS), frames), np.float32)  # the words as seen at the lines and between them
    power = np.empty(len(seen), np.float32)
    for i in range(lines + STARTS):
        words[i] = word
        follow = np.array([_switch(draw, run, word) for _ in range(tried)], np.float32)
        here, last = (np.array(w, np.float32) for w in (word, before))
        ahead = (own + aside) * follow + aside * here  # nearly what will be seen at the next line
        tries = _seen([own * here + aside * (last + follow), 0.5 * here + 0.5 * follow, ahead])
        known = max(0, 2 * i - 1)  # less than a line away is near by rights
        unlike = power[:known] - 2 * (tries.reshape(-1, frames) @ seen[:known].T)
        nearest = unlike.min(axis=1, initial=frames).reshape(-1, 3) + np.sum(tries**2, axis=2)
        best = int(np.argmax(nearest.min(axis=1)))
        keep = tries[best, :2]
        seen[2 * i : 2 * i + 2], power[2 * i : 2 * i + 2] = keep, np.sum(keep**2, axis=1)
        chosen = [int(value) for value in follow[best]]
        run = [r + 1 if a == b else 1 for r, a, b in zip(run, chosen, word, strict=True)]
        before, word = word, chosen
    return words[STARTS:]


def _seen(values: list[NDArray[Any]]) -> NDArray[np.float32]:
    """Give words (n, places, frames) as a pixel of unknown offset and gain tells them: centred, and of one norm."""
    words = np.stack(values, axis=1)
    words = words - words.mean(axis=2, keepdims=True)
    usual = np.float32(0.35 * sqrt(words.shape[2]))
    norm = np.maximum(np.linalg.norm(words, axis=2, keepdims=True), 1e-3)
    return np.asarray(words * np.minimum(usual / norm, 1.5), np.float32)


def _weights(blur_lines: float) -> tuple[float, float]:
    """Light that reaches the middle of a line from each neighbour, and from the line itself."""
    own = erf(0.5 / (sqrt(2) * max(blur_lines, 1e-3)))
    return (1 - own) / 2, own


def _switch(draw: Random, run: list[int], word: list[int]) -> list[int]:
    """Draw the next word: runs that are long enough end, others by chance, about half of all frames together.

    As many frames stay bright as dark, nearly, for then gain and offset of a pixel take least from the place. Few
    frames have few such words: some more or fewer of them may switch.
    """
    count, loose = len(run), 0 if len(run) > FEW else 1
    due = [r >= LONGEST_RUN for r in run]
    follow = [1 - w if d else w for w, d in zip(word, due, strict=True)]
    free = [j for j in range(count) if not due[j]]
    draw.shuffle(free)
    wanted = (count + int(draw.random() * 2)) // 2 + int(draw.random() * (2 * loose + 1)) - loose
    switched, excess = sum(due), 2 * sum(follow) - count  # bright beyond dark
    for j in free:
        if switched >= wanted:
            break
        change = 2 - 4 * word[j]
        if abs(excess + change) <= max(abs(excess), 2 + 2 * loose):
            follow[j], switched, excess = 1 - word[j], switched + 1, excess + change
    return follow
