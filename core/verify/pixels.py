"""How frames were stored, told from their grey values alone: bytes, missing values, blocks, mosaics, size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from core.model import Capture
from core.model.finding import Finding
from core.numerics import compressed_in_blocks, median_of, quantile_of, scattered, spaced
from core.patterns import Pattern, level_of

GRID = 12_000  # pixels sampled
LEAST_LIT = 150  # sampled pixels without which nothing is told
STEADY = 0.1  # share by which the light may change from one square of 2 px to the next where mosaics are looked for
BESIDE = 4  # grey values to either side that tell how often one is expected
FILLED = 40  # times
LEAST_VALUES = 16
GAPS = 0.1  # of the grey values; brighter by a tenth leaves out a tenth
UNEVEN = 1.2  # of four neighbours, each with its own all over: taps of one sensor differ by a few hundredths
SOME = 5  # frames that are looked at
FLAT = 0.1  # of the brightest frame's range: a column that varies less may be unlit
EVEN = 0.5  # of the others: a camera's image is not so even where it is lit
REPEATED = 0.15  # of the columns and of the rows; of noise none, and half of them where two pixels were made of one
HALF = 0.4, 0.6  # of the rows, where every second one is a copy
FRAMES, UNLIKE, LIKE = 8, 0.25, 0.1  # that are looked at; of the range of grey values
WHITE, ELSEWHERE = 0.98, 0.2  # of the pixels: at the greatest grey value in one frame at least, in others at most
COMBED = 0.15, 0.03  # of the rows in the median, at least, and of the columns; sound frames of two rigs have none
ROUGHER = 2.0  # sound frames of 8 to 12 bits have at most 1; exchanged ones 3.2 to 50, on three captures of one rig


def bytes_exchanged(images: Sequence[NDArray]) -> list[Finding]:
    """Neighbours differ far less, for what the image varies in all, once the bytes of each value are exchanged."""
    if images[0].dtype != np.uint16 or images[0].shape[1] < 2:
        return []
    image = max((i[::4] for i in images), key=lambda i: float(i.std()))
    own, other = (
        float(np.abs(np.diff(i.astype(np.float32), axis=1)).mean() / max(i.std(), 1e-9))
        for i in (image, image.byteswap())
    )
    if not own > ROUGHER * other:
        return []
    text = "the two bytes of each grey value are exchanged: write 16-bit frames in the byte order of their format"
    return [Finding("bytes", "bad", text, {"ratio": own / other}, names="mistake")]


def gaps_among(images: Sequence[NDArray]) -> float:
    """Share of grey values that no frame takes, of those that have well-filled values just below and above.

    A camera's own values fill up: one that is expected `FILLED` times is never empty by chance. Frames that were
    brightened, given another gamma or cut to fewer bits after the camera leave values out.
    """
    height, width = images[0].shape
    stride = max(1, round((height * width / GRID) ** 0.5))
    grey = np.concatenate([image[stride // 2 :: stride, stride // 2 :: stride].ravel() for image in images])
    count = np.pad(np.bincount(grey), BESIDE)
    beside = range(1, BESIDE + 1)
    own = len(count) - 2 * BESIDE
    below, above = (np.max([count[BESIDE + sign * k :][:own] for k in beside], axis=0) for sign in (-1, 1))
    told = np.minimum(below, above) >= FILLED
    return float(np.mean(count[BESIDE : BESIDE + own][told] == 0)) if np.count_nonzero(told) >= LEAST_VALUES else 0.0


def edited(found: Sequence[Finding], images: Sequence[NDArray]) -> list[Finding]:
    """Say of contradictions without another cause that grey values are left out, where they are."""
    if all(f.names != "capture" for f in found):
        return [*found]
    some = [images[k] for k in spaced(len(images), FRAMES)]  # each may have been changed in its own way
    if (gaps := max(gaps_among(images), median_of([gaps_among([image]) for image in some]))) < GAPS:
        return [*found]
    why = (
        f"{gaps:.0%} of the grey values are left out: frames were equalised, stretched or given a gamma after the "
        "camera; record them as they come"
    )
    return [replace(f, text=f"{f.text.partition(': ')[0]}: {why}") if f.names == "capture" else f for f in found]


def compressed(capture: Capture, images: Sequence[NDArray]) -> list[Finding]:
    """Frames, best those lit evenly, show the edges of blocks."""
    even = [i for f, i in zip(capture.frames, images, strict=True) if level_of(f.pattern) is not None]
    if not compressed_in_blocks([*even[:3], images[0]]):
        return []
    text = "frames were compressed with losses, in blocks of 8 px as JPEG makes them: record without compression"
    return [Finding("compression", "warning", text)]


def blank(patterns: Sequence[Pattern], images: Sequence[NDArray]) -> list[Finding]:
    """Frames of stripes that have the greatest grey value all over, which no other frame has so much of."""
    thin = [image[::8, ::8] for image in images]
    most = max(int(image.max()) for image in thin)
    share = np.array([float(np.mean(image == most)) for image in thin])
    white = np.flatnonzero((share > WHITE) & [level_of(p) != 1 for p in patterns])
    if len(white) != 1 or np.delete(share, white).max(initial=0.0) > ELSEWHERE:
        return []
    k = int(white[0])
    text = f"frame {k} has grey value {most} all over, as no other frame has: the camera failed there; record it again"
    return [Finding("identity", "bad", text, shots=(k,), names="value")]


def enlarged(images: Sequence[NDArray]) -> list[Finding]:
    """Whole columns and rows of the lit image repeat their neighbours, in all frames: noise never does.

    A rendered plane without noise repeats what one line of the projector lights, but its other pixels are alike, too.
    """
    some = [images[k] for k in spaced(len(images), SOME)]
    lit = max(some, key=lambda i: float(i[::8, ::8].mean()))
    shares, size, others = [], [], lit
    ways = [some, [i.T for i in some]]
    if not any(np.all([np.all(i[::16, 1:] == i[::16, :-1], axis=0) for i in way], axis=0).any() for way in ways):
        return []  # no column or row does where a few pixels are looked at
    for axis in (1, 0):
        alike = np.all([np.all(np.diff(i, axis=axis) == 0, axis=1 - axis) for i in some], axis=0)
        shown = np.ptp(np.delete(lit, 0, axis=axis), axis=1 - axis) > FLAT * float(np.ptp(lit[::8, ::8]))
        count = int(np.count_nonzero(shown))
        shares.append(float(np.mean(alike[shown])) if count >= LEAST_VALUES else 0.0)
        size.append(lit.shape[axis] - int(np.count_nonzero(alike)))
        others = np.delete(others, np.flatnonzero(alike), axis=axis)
    if _even(others):
        return []
    if shares[0] < REPEATED < HALF[0] < shares[1] < HALF[1]:
        text = "every second row repeats the one beside it: one field of a video, its rows doubled; record whole frames"
        return [Finding("enlarged", "bad", text, {"repeated": shares[1]}, names="mistake")]
    if min(shares) < REPEATED:
        return []
    text = (
        f"{shares[0]:.0%} of its columns and {shares[1]:.0%} of its rows repeat their neighbours, as where frames of "
        f"about {size[0]} x {size[1]} px were enlarged: record it with the camera's settings of the others, unbinned"
    )
    return [Finding("enlarged", "bad", text, {"repeated": min(shares)}, names="mistake")]


def combed(images: Sequence[NDArray]) -> list[Finding]:
    """Rows are unlike the two beside them, and these like each other, in most frames; columns are not."""
    shares = []
    for image in (images[k] for k in spaced(len(images), FRAMES)):
        full = float(np.ptp(image[::8, ::8]))
        shares.append([_unlike_both(np.asarray(way, np.float32), full) for way in (image[:, ::32], image[::32].T)])
    rows, columns = (median_of(way) for way in zip(*shares, strict=True))
    if rows < COMBED[0] or columns > COMBED[1]:
        return []
    text = (
        f"every second row shows other patterns than those between them, in {rows:.0%} of what is lit: fields of a "
        "video exposed under two patterns; show each for two whole frames, or have the camera record progressively"
    )
    return [Finding("fields", "bad", text, {"combed": rows}, names="mistake")]


def _unlike_both(image: NDArray[np.float32], full: float) -> float:
    """Share of the lit pixels that differ from the ones above and below, which are alike."""
    step = np.abs(np.diff(image, axis=0))
    lit = np.maximum(image[1:-1], image[2:]) > UNLIKE * full
    there = (np.minimum(step[:-1], step[1:]) > UNLIKE * full) & (np.abs(image[2:] - image[:-2]) < LIKE * full)
    return int(np.count_nonzero(there & lit)) / max(int(np.count_nonzero(lit)), 1)


def _even(image: NDArray) -> bool:
    """Whether most lit pixels are like the one above, or the one before: an image without noise."""
    own, above, before = image[1:, 1:], image[:-1, 1:], image[1:, :-1]
    lit = own > image.min() + FLAT * float(np.ptp(image))
    return not lit.any() or max(float(np.mean(own[lit] == other[lit])) for other in (above, before)) > EVEN


def mosaic(capture: Capture, images: Sequence[NDArray]) -> list[Finding]:
    """Four neighbours differ alike wherever there is light; seen where that goes on evenly to the next four."""
    even = [i for f, i in zip(capture.frames, images, strict=True) if level_of(f.pattern)] or images
    share = min(GRID / even[0].size, 0.25) ** 0.5
    # as if at random: a board's dots may be evenly spaced
    v, u = (2 + 2 * scattered(max(n // 2 - 2, 0), max(int(share * n) - 2, 0)) for n in even[0].shape)

    def four(down: int, right: int) -> NDArray[np.float64]:
        at = [np.ix_(v + down + y, u + right + x) for y, x in product((0, 1), repeat=2)]
        return np.array([sum(i[k].astype(float) for i in even) for k in at], np.float64).reshape(4, -1)

    seen = four(0, 0)
    if seen.shape[1] < LEAST_LIT:
        return []
    mean = seen.mean(axis=0)
    even_there = seen.max(axis=0) > 0.5 * quantile_of(seen.max(axis=0), 0.97)
    for step in ((0, 2), (2, 0), (0, -2), (-2, 0)):
        even_there &= np.abs(four(*step).mean(axis=0) - mean) < STEADY * mean
    seen = seen[:, even_there]
    if seen.shape[1] < LEAST_LIT:
        return []
    shares = [median_of(own) for own in seen / seen.mean(axis=0)]
    ratio = max(shares) / max(min(shares), 0.01)
    if ratio < UNEVEN:
        return []
    text = (
        f"neighbouring pixels differ by {ratio - 1:.0%} in squares of 2 px, as in raw frames of a colour camera: have "
        "its colours interpolated, or record grey values"
    )
    return [Finding("mosaic", "bad", text, {"ratio": ratio}, names="mistake")]
