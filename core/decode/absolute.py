"""Decoding: from the frames of a capture to projector coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import or_
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.algebra import on_own_threads
from core.decode.chosen import spread
from core.decode.codes import codes_alone, refine_codes
from core.decode.compressed import COMPRESSED, roughness
from core.decode.edges import sigma_of_edges
from core.decode.estimate import Planes, estimable, refine
from core.decode.exposures import DEEPEST, fuse_exposures
from core.decode.filtered import filtered
from core.decode.frames import Image, check_images
from core.decode.kernels.kernel import decode_pixels, scratch_for
from core.decode.known import AXES, Prepared, Seen, measure, prepare
from core.decode.late import late_frames
from core.decode.noise import Noise
from core.decode.notes import MUCH, note_on_extent, note_on_second_light, notes_on
from core.decode.options import DecodeOptions, Flag
from core.decode.overexposed import relight
from core.decode.sections import decode_sections, section_scratch
from core.decode.surface.agreement import contradiction, refuse_open_orders, widen
from core.decode.surface.detours import bent_by, second_light
from core.decode.surface.footprint import draw_back
from core.decode.surface.islands import drop_islands, farthest
from core.decode.surface.mixed import doubt_mixtures, drop_rim, drop_vague
from core.decode.surface.neighbours import ask_neighbours
from core.decode.surface.repeated import drop_repeated
from core.decode.tables import CODE, NOTHING, PHASES, SWEEP, Limits, Singles
from core.decode.waves.camera import TONE, unbend
from core.decode.waves.curves import LEVELS
from core.decode.waves.evenness import level_out
from core.decode.waves.folded import take_waves_out
from core.decode.waves.mosaic import take_kinds_out
from core.decode.waves.ripple import take_ripple_out
from core.decode.words.book import book_of
from core.decode.words.coded import as_coded
from core.decode.words.likelihood import decode_words, has_words
from core.errors import InputError
from core.lazy import dataclass
from core.model import PhaseMap
from core.numerics import compressed_in_blocks
from core.parallel import run_in_bands
from core.patterns import Pattern, axis_of, refuse_beyond
from core.progress import SILENT, Progress

DEFAULT = DecodeOptions()
CURVE = 4  # of the levels at which a response is tabulated, so manieth is told
MISSING = Flag.NO_U, Flag.NO_V  # by axis
MOST = 0.5  # part of the coordinates lost to contradictions, from which it is orders that a second way leaves open
BLOCK = 1 << 28  # grey values decoded between two looks at `progress`


@on_own_threads()
def decode(
    patterns: Sequence[Pattern],
    images: Sequence[Image],
    *,
    lines: tuple[int, int] | None = None,
    options: DecodeOptions = DEFAULT,
    exposures_ms: Sequence[float | None] | None = None,
    noise: Noise | None = None,
    where: str = "capture",
    progress: Progress = SILENT,
) -> PhaseMap:
    """Projector coordinates of every camera pixel, from whatever frames there are.

    Parameters
    ----------
    patterns : sequence of Pattern
        What the projector was meant to show, one for each image.
    images : sequence of uint8 or uint16 arrays (H, W)
        Grey values, in any order.
    lines : (int, int), optional
        Projector width and height in lines; unknown, the extent that the frames themselves tell apart.
    exposures_ms : sequence of float or None, optional
        Exposure of every image. Several exposures of a pattern are made one image, in which a sample is saturated only
        where all are; modulation and image are then in grey values of the longest.
    noise : Noise, optional
        Of the grey values, where it is known better than the frames tell it.
    where : str
        What messages call the capture.

    Returns
    -------
    phase_map : PhaseMap
        Coordinates in lines, the centre of the first line being 0; NaN where invalid, all NaN for an axis without
        patterns. The modulation is the amplitude of the finest period's first harmonic, or half the contrast of a code
        or light section; of two axes the smaller.

    Raises
    ------
    InputError
        When the frames do not fit together, or no absolute coordinate follows from them; names capture and axis.

    Notes
    -----
    Phases are fitted by least squares over the steps. Where code and phase are combined, the cell's number gives the
    order of the fringe; a pixel whose bits do not fit its coordinate is decided by the likelihood of all bits. With
    several periods the coordinate is the mean of all, weighted by their variances.

    Examples
    --------
    >>> from core.patterns import gray_and_phase, pattern_image
    >>> patterns = gray_and_phase("x", 16, cell=4, periods=[8])
    >>> images = [np.uint8(50 + 100 * pattern_image(p, 16, 2)) for p in patterns]
    >>> decode(patterns, images, lines=(16, 2)).u[0, 3:7].round(1)
    array([3., 4., 5., 6.], dtype=float32)
    """
    arrays = check_images(patterns, images, where)
    if lines is not None:
        for i, pattern in enumerate(patterns):
            refuse_beyond(pattern, lines, f"{where}: pattern {i}")
    fused = None if exposures_ms is None else fuse_exposures(patterns, arrays, exposures_ms, options, where)
    if fused is not None:
        depth = options.in_steps(fused.steps, float(DEEPEST))
        phase = decode(
            fused.patterns, fused.images, lines=lines, options=depth, noise=fused.noise, where=where, progress=progress
        )
        fused.widen(phase.sigma_u, "x")
        fused.widen(phase.sigma_v, "y")
        return replace(_in_grey_values(phase, fused.steps), notes=(*fused.notes, *phase.notes))
    if (coded := as_coded(tuple(patterns), lines)) is not None:
        shown = coded.patterns
        phase = decode(
            shown, arrays, lines=coded.lines, options=options, noise=noise, where=where, progress=progress.part(0, 0.5)
        )
        alone = codes_alone(_prepared(shown, coded.lines, where).tables)
        if alone and not options.estimate:  # words of single lines tell parts of these
            phase = refine_codes(phase, shown, arrays, alone, options, where, progress.part(0.5, 1))
        return coded.moved(phase)
    if has_words(patterns, "x") or has_words(patterns, "y"):

        def others(some: list[int]) -> PhaseMap:
            shown, seen = [patterns[i] for i in some], [arrays[i] for i in some]
            return decode(shown, seen, lines=lines, options=options, where=where, progress=progress.quiet())

        return decode_words(patterns, arrays, lines, options, where, progress, others)
    progress(0.0, "reading the noise")
    sequence = _prepared(patterns, lines, where)
    seen = measure(sequence, patterns, arrays, options, where, noise)
    if seen.camera is not None:
        full = float(seen.limits.saturation)
        straight, steps = unbend(arrays, seen.camera, full)
        finer = replace(options.in_steps(steps, steps * full), camera=False)
        phase = decode(patterns, straight, lines=lines, options=finer, where=where, progress=progress)
        return replace(_in_grey_values(phase, steps), notes=(*phase.notes, TONE))
    found = _Found.of_nothing(arrays[0].shape)
    at_rim = _decode_pixels(found, sequence, arrays, seen, progress)
    *place, amplitude, even_image = found.over_image(*found.place, found.modulation, found.image)
    if seen.response is not None:
        level_out(even_image, place, amplitude, sequence.image_rows, sequence.waves, seen.response)
    clipped = relight(even_image, arrays, sequence.frames, sequence.image_rows, float(seen.limits.saturation))
    telling = seen.limits
    if noise is not None:
        telling = telling._replace(saturation=np.minimum(telling.saturation, np.float32(noise.upto)))
    doubts = [_mend(found, k, sequence, arrays, seen, telling, bool(at_rim >> k & 1)) for k in range(len(AXES))]
    altered = _altered(sequence, arrays, float(seen.limits.saturation))
    for k in (k for k, table in enumerate(seen.tables) if COMPRESSED in altered and len(table.period)):
        u, sigma = found.over_image(found.place[k], found.sigma[k])
        widen(sigma, roughness(u, sigma))
    misfit = None
    if options.estimate and estimable(sequence.frames):
        refined, (limits, tables, response, light, *_) = Planes(found.place, found.sigma, found.shape[1]), seen
        misfit = refine(sequence.frames, patterns, arrays, tables, limits, response, light, refined, progress)
        misfit = misfit.reshape(found.shape)
    x_even, y_even = (t.start == SWEEP or len(t.period) > 0 for t in seen.tables)
    _draw(found, sequence, seen, (x_even, y_even))
    for k, even in enumerate((x_even, y_even)):
        _level_and_doubt(found, k, sequence, seen, even)
    phase = replace(_phase_map(found, misfit, doubts, patterns, arrays, seen, options.steps), clipped=clipped)
    if options.estimate and (alone := codes_alone(seen.tables)):
        phase = refine_codes(phase, patterns, arrays, alone, options, where, progress)
    further = (*altered, *(() if lines else note_on_extent(seen.tables)))
    return replace(phase, notes=(*phase.notes, *further)) if further else phase


def refuse_patterns(patterns: Sequence[Pattern], lines: tuple[int, int] | None, where: str = "capture") -> None:
    """Raise the InputError of `decode` for patterns from which no absolute coordinate follows, whatever is seen."""
    if (coded := as_coded(tuple(patterns), lines)) is not None:
        patterns, lines = coded.patterns, coded.lines
    words = [axis for axis in AXES if has_words(patterns, axis)]
    for axis in words:
        book_of(tuple(patterns), axis, lines[axis == "y"] if lines else None, where)
    others = [pattern for pattern in patterns if axis_of(pattern) not in words]
    if not words or any(axis_of(pattern) for pattern in others):
        _prepared(others, lines, where)


def _prepared(patterns: Sequence[Pattern], lines: tuple[int, int] | None, where: str) -> Prepared:
    try:
        return prepare(tuple(patterns), lines)
    except InputError as error:
        raise InputError(f"{where}{error.where}", error.seen, error.remedy) from None


def _altered(sequence: Prepared, images: Sequence[Image], saturation: float) -> tuple[str, ...]:
    """Say what was done to the frames after they were exposed."""
    even = [*sequence.frames.white[:1], *sequence.frames.black[:1]]
    if compressed_in_blocks([images[n] for n in {*even, 0, len(images) - 1}]):
        return (COMPRESSED,)
    fringes = (*sequence.waves, *sequence.sharp)
    note = filtered(images, sequence.contrasts, fringes, saturation)
    return () if note is None else (note,)


def _in_grey_values(phase: PhaseMap, steps: float) -> PhaseMap:
    """Give modulation and image in grey values, of images in so many steps of one."""
    step = np.float32(1 / steps)
    return replace(phase, modulation=phase.modulation * step, image=phase.image * step)


class _Doubt(NamedTuple):
    """What mending an axis tells of the capture."""

    second: tuple[str, ...]  # sentences on a second light
    detour: bool  # light by a second way leaves orders open


@dataclass(frozen=True)
class _Found:
    """Of every pixel, flat: coordinates and sigmas (2, pixels) in lines, modulation, evenly lit image, flags."""

    place: Singles
    sigma: Singles
    modulation: Singles
    image: Singles
    flags: NDArray[np.uint8]
    shape: tuple[int, int]

    @classmethod
    def of_nothing(cls, shape: tuple[int, int]) -> _Found:
        """Give memory that is not set yet, in one block large enough for large pages."""
        planes = np.empty((6, shape[0] * shape[1]), np.float32)
        return cls(planes[:2], planes[2:4], planes[4], planes[5], np.empty(planes.shape[1], np.uint8), shape)

    def over_image(self, *planes: Singles) -> list[Singles]:
        """Give planes their rows and columns."""
        return [plane.reshape(self.shape) for plane in planes]


def _decode_pixels(found: _Found, sequence: Prepared, images: Sequence[Image], seen: Seen, progress: Progress) -> int:
    """Decode pixel by pixel, in bands of rows; the bits of the answer say which axes' rim is in the image."""
    height, width = found.shape
    swept = {n for table in seen.tables for n in table.line_frames}
    plain = np.array([n for n in range(len(images)) if n not in swept], np.int32)
    addresses = np.array([image.ctypes.data for image in images], np.uint64)
    out = (found.place, found.sigma, found.modulation, found.image, found.flags)
    at_rim: list[int] = []
    block = max(16, BLOCK // (width * len(images)))
    for top in progress.over(range(0, height, block), "decoding from row {}"):

        def band(first: int, last: int, top: int = top) -> None:
            common = ((top + first) * width, (top + last) * width, addresses, images[0].itemsize, seen.limits)
            met = decode_pixels(*common, sequence.image_rows, plain, seen.tables, scratch_for(seen.tables), out)
            at_rim.append(met)
            for axis, table in enumerate(seen.tables):
                if table.start == SWEEP:
                    decode_sections(*common, table, section_scratch(table), axis, out)

        run_in_bands(band, min(block, height - top))
    return reduce(or_, at_rim, 0)


def _mend(
    found: _Found, axis: int, sequence: Prepared, images: Sequence[Image], seen: Seen, telling: Limits, at_rim: bool
) -> _Doubt:
    """Drop or widen, in place, what a pixel alone could not know of an axis's coordinates."""
    table, missing, limits = seen.tables[axis], MISSING[axis], seen.limits
    u, sigma, contrast, even = found.over_image(found.place[axis], found.sigma[axis], found.modulation, found.image)
    flags = found.flags.reshape(found.shape)
    if at_rim:
        drop_rim(u, sigma, flags, float(table.lines), float(table.rim), missing)
    drop_repeated(images, u, sigma, flags, missing)
    drop_islands(u, sigma, flags, missing, farthest(table))
    used = sum(int(flag) for flag, each in zip(MISSING, seen.tables, strict=True) if each.start != NOTHING)
    ask_neighbours(images, table, telling, sequence.image_rows, (u, sigma, flags, missing), used)
    if sequence.periods(axis):
        take_ripple_out(u, sigma)
    if table.start == CODE and table.gray and not len(table.period):
        sigma_of_edges(u, sigma, float(table.cell), contrast, even, limits)
        widen(sigma, np.min([roughness(u, sigma, apart, bounded=True) for apart in (1, 2, 3)], axis=0))
    plain = sequence.frames.white, sequence.frames.black
    apart = contradiction(images, table, telling, sequence.image_rows, plain, u)
    shown = [part for part in (second_light(images, table, limits, u), apart and apart.part) if part is not None]
    part = reduce(np.maximum, shown) if shown else None
    more = None if apart is None else apart.lines
    if part is not None:
        bent = bent_by(part, table, limits, u)
        more = bent if more is None else np.maximum(more, bent)
    if more is None:
        return _Doubt((), False)
    taken = spread(found.shape)
    alone = sigma[taken].copy()
    widen(sigma, more)
    detour = part is not None and table.start == PHASES
    if apart is not None:
        mine = u, sigma, flags, missing
        refused = refuse_open_orders(images, table, telling, sequence.image_rows, apart.turns, mine)
        contrary = int(Flag.DISAGREEMENT | missing)
        detour |= refused > MOST * int(np.count_nonzero(flags & np.uint8(contrary) == contrary))
    known = np.isfinite(sigma[taken])
    told = () if part is None else note_on_second_light(part, sigma[taken][known] > MUCH * alone[known])
    return _Doubt(told, detour)


def _draw(found: _Found, sequence: Prepared, seen: Seen, even: tuple[bool, bool]) -> None:
    """Take out, in place, what texture does to coordinates, before dots at even distances pass for waves of them."""
    cofactor = max((float(t.covariance[0, 0]) for t in seen.tables if len(t.covariance)), default=1.0)
    flags = found.flags.reshape(found.shape)
    lit = found.image, found.modulation
    draw_back((found.place, found.sigma), lit, flags, sequence.image_rows, seen.limits, cofactor, even)


def _level_and_doubt(found: _Found, axis: int, sequence: Prepared, seen: Seen, even: bool) -> None:
    """Take out, in place, what all phases err alike, and doubt coordinates of two surfaces."""
    u, sigma = found.over_image(found.place[axis], found.sigma[axis])
    if periods := sequence.periods(axis):
        left = take_waves_out(u, periods)
        left += take_kinds_out(u, periods) if seen.response is not None else 0.0
        widen(sigma, np.full((1, 1), left, np.float32))
    if even:
        doubt_mixtures(u, sigma)
    if len(seen.tables[axis].period):
        shortest = float(seen.tables[axis].period.min())
        drop_vague(u, sigma, found.flags.reshape(found.shape), shortest, MISSING[axis])


def _phase_map(
    found: _Found,
    misfit: Singles | None,
    doubts: Sequence[_Doubt],
    patterns: Sequence[Pattern],
    images: Sequence[Image],
    seen: Seen,
    steps: float,
) -> PhaseMap:
    """Put a phase map together, with what is to be said of the capture."""
    u, v, sigma_u, sigma_v, modulation, image = found.over_image(
        *found.place, *found.sigma, found.modulation, found.image
    )
    flags, taken = found.flags.reshape(found.shape), spread(found.shape)
    rows = range(*taken[0].indices(found.shape[0]))
    late = late_frames(patterns, seen.sample, rows, (u[taken].ravel(), v[taken].ravel()), seen.limits)
    detour = any(doubt.detour for doubt in doubts)
    notes = notes_on(images, seen.sample, flags[taken].ravel(), seen.limits, seen.tables, detour, steps)
    second = next((doubt.second for doubt in doubts if doubt.second), ())
    response = seen.response
    curve = None if response is None else np.column_stack([LEVELS, response.table])[::CURVE]
    planes = (u, v, sigma_u, sigma_v, modulation, image)
    return PhaseMap(*planes, flags, curve, misfit, (*late, *notes, *second))
