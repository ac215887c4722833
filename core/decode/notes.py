"""What is wrong with a capture that decodes nowhere, or far less than its light promises: the cause and the remedy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.chosen import spread
from core.decode.frames import Image
from core.decode.noise import MEDIAN_OF_SQUARE, spatial_residual
from core.decode.options import Flag
from core.decode.tables import NOTHING, PHASES, WORDS, Array, AxisTable, Limits, Singles
from core.model import Names, Note

LIT = 12.0  # standard deviations of a grey value that the frames of a lit pixel differ by: noise alone reaches 6
NOWHERE = 0.005  # part of the image: less light is none
PROMISED = 0.5  # part of the lit pixels that should decode
FEWEST = 400  # pixels of a frame that tell its noise
CLIPPED = 3.0  # standard deviations above black from where noise shows whole
APART = 3.0  # times the noise of one frame that what should agree must differ by to be no noise
MIXED = (
    "A frame may be missing, in the wrong place or of another scene, capture.json may not list the patterns that were "
    "shown, or the object moved. Take the capture again."
)
DETOUR = (
    "the periods contradict each other too much to count fringes: frames are not those listed, light reaches the "
    "surface by a second way, by gloss or from a facing wall, or the camera has a gamma of its own. Compare the frames "
    "with capture.json, dull the surface, switch gamma off, show more steps and periods, or add a code."
)
SWEPT = "the coordinate is beyond the first or last line of the sweep."
LARGER = "Compare its width and height in project.json with those that the patterns were made for."
COMPARE = (
    "Stripes may be blurred or too dark, or other patterns than those listed. Focus, expose longer, show wider "
    "stripes, or compare the frames with the patterns in capture.json."
)
ORDER = int(Flag.DISAGREEMENT | Flag.UNSURE)
HALF = 0.5
BLOCK = 5  # pixels of the sample, a side, whose mean shows light below the noise of one
TELLING = 0.05  # of the straight light, by a second way: that all around, of scattering rooms, shows up to 0.045
MUCH = 1.4  # times the sigma by noise: as much variance comes from something else
MANY = 0.1  # part of the lit pixels that a cause must have to be told
SECOND_OF_FRINGES = (
    "In {} of the pixels about {} of the light comes by a second way, by gloss or from a facing wall, or a lamp "
    "flickers from row to row, or something moved between code and steps: sigma holds most of that, but little of "
    "light from within a few lines. Dull the surface, fasten all, show shorter periods, or expose for whole cycles of "
    "the lamp."
)
SECOND_OF_WORDS = (
    "In {} of the pixels about {} of the light comes by a second way, by gloss or from a facing wall: sigma holds "
    "most of that, but little of light from within a few lines. Dull the surface, or turn it away from what faces it."
)
COARSE_WORDS = (
    "In {} of the pixels the frames differ from their words by about {} of the light, as a pixel sees several lines: "
    "sigma holds most of that. Let the camera come nearer, or show wider lines."
)
ODD_WORDS = (
    "In {} of the pixels the frames differ from their words by about {} of the light, of which sigma holds most: "
    "something moved, light changed or spreads within the surface, frames are not those listed, or were sharpened or "
    "compressed with losses (JPEG). Save frames as they are, and take the capture again."
)


def notes_on(
    images: Sequence[Image],
    sample: Singles,
    flags: NDArray[np.uint8],
    limits: Limits,
    tables: tuple[AxisTable, AxisTable],
    detour: bool = False,
    steps: float = 1,
) -> tuple[Note, ...]:
    """Say in sentences why far fewer pixels of a capture decode than are lit; nothing where all is well.

    `sample` has the frames' grey values (frames, n) in pixels all over the image, `flags` is of the same pixels.
    `detour` says that light by a second way leaves the order of fringes open; `steps` of the images are a grey value.
    """
    wanted = [flag for flag, table in zip((Flag.NO_U, Flag.NO_V), tables, strict=True) if table.start != NOTHING]
    missing = flags & np.uint8(sum(int(flag) for flag in wanted)) != 0
    if missing.mean() <= MANY:
        return ()
    full = float(limits.saturation) / steps
    contrast = sample.max(axis=0) - sample.min(axis=0)
    noise = np.sqrt(limits.variance(sample.mean(axis=0)))  # of other light than the projector's, too
    lit = contrast > LIT * noise
    if lit.mean() > NOWHERE and missing[lit].mean() <= 1 - PROMISED:
        return ()
    excess = _excess(images, limits)  # what was taken for noise may be none
    lit = contrast > LIT * noise / excess
    if lit.mean() < NOWHERE:
        lit = _lit_by_means(images, sample, noise / excess)
    if lit.mean() < NOWHERE and np.median(sample) >= limits.saturation:
        return (Note(f"The frames are at full scale ({full:.0f}) all over. Expose shorter or stop the lens down."),)
    if lit.mean() < NOWHERE:
        level = f"their frames differ by {np.median(contrast) / steps:.0f} grey values in the median"
        remedy = "See that the projector reaches the object, that its frames are those shown, and expose longer"
        return (Note(f"The projector lights no pixel visibly: {level}. {remedy}."),)
    seen, lost = flags[lit], missing[lit]
    if lost.mean() <= 1 - PROMISED:
        return ()
    telling = {n for table in tables for n in table.phase_frames.tolist()}  # a code is told at full scale, too
    shown = sample if any(table.start == WORDS for table in tables) else sample[sorted(telling)]
    clipped = (shown.max(axis=0, initial=0)[lit] >= limits.saturation) & (seen & np.uint8(ORDER) != 0)
    seen = np.where(clipped, np.uint8(Flag.SATURATED), seen)
    head = f"Only {1 - lost.mean():.0%} of the pixels that the projector lights decode"
    usual = float(np.median(noise[lit])) / steps
    causes = _causes(seen[lost], len(seen), full, (usual, usual / excess), tables, detour)
    if not causes:
        return (Note(f"{head}."),)
    first, *others = (text for text, _ in causes)
    told = [f"{head}: {first}", *(f"{text[0].upper()}{text[1:]}" for text in others)]
    named = [names for _, names in causes]
    if set(named) != {"light"}:  # which excuses what is missing only where nothing else does
        named = ["capture" if names == "light" else names for names in named]
    return tuple(map(Note, told, named))


def _lit_by_means(images: Sequence[Image], sample: Singles, noise: Array) -> NDArray[np.bool_]:
    """Pixels of the sample that their neighbours' means show to be lit, where noise hides it in every single one."""
    rows, columns = spread(images[0].shape)
    grid = sample.reshape(len(sample), len(images[0][rows]), len(images[0][0, columns]))
    edge = (BLOCK // 2, BLOCK // 2)
    blocks = np.lib.stride_tricks.sliding_window_view(
        np.pad(grid, ((0, 0), edge, edge), "edge"), (BLOCK, BLOCK), (1, 2)
    )
    means = blocks.mean(axis=(3, 4)).reshape(sample.shape)
    means -= means.mean(axis=1, keepdims=True)  # ambient light may flicker
    return np.asarray(np.ptp(means, axis=0) > LIT * noise / BLOCK)


def _excess(images: Sequence[Image], limits: Limits) -> float:
    """How many times as large as in the smoothest frame the noise was taken to be: standard deviations, 1 or more."""
    rows = slice(len(images[0]) // 32, None, max(1, len(images[0]) // 16))
    least = 1.0
    for image in images:
        residual, level = spatial_residual(image[rows].astype(np.float32))
        expected = limits.variance(level.astype(np.float32))
        tells = (image[rows, 1:-1] < limits.saturation) & (level > CLIPPED * np.sqrt(expected))
        if np.count_nonzero(tells) > FEWEST:
            seen = np.maximum(np.square(residual[tells]), limits.floor * MEDIAN_OF_SQUARE)
            least = min(least, float(np.median(seen / expected[tells])) / MEDIAN_OF_SQUARE)
    return float(1 / np.sqrt(least))


def _causes(
    lost: NDArray[np.uint8],
    lit: int,
    full: float,
    noises: tuple[float, float],
    tables: tuple[AxisTable, AxisTable],
    detour: bool,
) -> list[tuple[str, Names]]:
    """The causes, the most frequent first, and what each names.

    Given flags of the pixels that are lost, how many are lit, and full scale.

    `noises` are that of their grey values as it was taken, and as the smoothest frame shows it.
    """
    worded = any(table.start == WORDS for table in tables)
    told = worded or any(len(table.period) > 1 or len(table.sign) for table in tables)
    noise, grain = noises
    grainy = noise <= APART * grain
    remedy = "Focus, expose longer or use longer periods."
    weak = f"the fringes are too weak for the noise of {noise:.1f} grey values. {remedy}"
    if not any(len(table.period) for table in tables):
        weak = f"the stripes are too weak for the noise of {noise:.1f} grey values. Focus or expose longer."
    if worded:
        weak = f"light and words differ by {noise:.1f} grey values, too much for the stripes' contrast. {COMPARE}"
    elif not grainy:
        agree = f"frames that should agree differ by {noise:.1f} grey values, where their noise is {grain:.1f}."
        weak = f"{agree} {MIXED}"
    contrary = f"the frames contradict each other. {MIXED}" if told else "the phase is too noisy. Expose longer."
    unsure = np.count_nonzero(lost & int(Flag.UNSURE)) > HALF * np.count_nonzero(lost & ORDER)
    open_order = unsure and grainy and not detour and all(table.start in (NOTHING, PHASES) for table in tables)
    if open_order:
        more = "Expose longer, show more steps, or add a code or a longer period."
        contrary = f"the noise of {noise:.1f} grey values leaves the order of the fringe open. {more}"
    contrary = DETOUR if detour else f"words of several lines fit alike. {COMPARE}" if unsure and worded else contrary
    swept = any(table.line_open.any() for table in tables)
    kinds = {
        int(Flag.SATURATED): f"too many steps are at full scale ({full:.0f}). Expose shorter or stop the lens down.",
        int(Flag.LOW_MODULATION): weak,
        ORDER: contrary,
        int(Flag.OUTSIDE): SWEPT if swept else f"the coordinate is beyond the projector's lines. {LARGER}",
    }
    parts = {text: float(np.count_nonzero(lost & bits)) / lit for bits, text in kinds.items()}
    ordered = sorted(parts.items(), key=lambda part: -part[1])
    names: dict[str, Names] = {} if swept else {kinds[int(Flag.OUTSIDE)]: "projector"}
    names |= {text: "light" for text, dim in ((weak, grainy), (contrary, open_order)) if dim}
    return [(f"in {part:.0%} of them {text}", names.get(text, "capture")) for text, part in ordered if part > MANY]


def note_on_extent(tables: Sequence[AxisTable]) -> tuple[str, ...]:
    """Say within how many lines phases alone tell places apart, where nobody knows how many the projector has."""
    axes = zip(("u", "v"), tables, strict=True)
    told = [f"{name} within {table.lines:.0f} lines" for name, table in axes if table.start == PHASES]
    return (f"No code, and no project.json above, tell how many lines there are: {', '.join(told)}.",) if told else ()


def note_on_second_light(part: Singles, bent: NDArray[np.bool_], told: str = SECOND_OF_FRINGES) -> tuple[str, ...]:
    """Say that light comes by a second way, where it bends the coordinates of many pixels beyond their noise.

    `part` is of the light that comes straight, in tiles or pixels; `bent`, of valid pixels, where it counts for more
    than noise; the sentence `told` has places for the parts of pixels and of light.
    """
    if bent.size == 0 or bent.mean() < MANY or not np.any(part > TELLING):
        return ()
    return (told.format(f"{bent.mean():.0%}", f"{float(np.median(part[part > TELLING])):.0%}"),)
