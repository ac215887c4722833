"""The search for the projector's response in the frames of a capture, and for the camera's where that leaves much.

Of every pixel of a sample the ambient light, the gain and the phases are unknown; of all of them together the curve's
parameters, the blur of each axis and how the light of whole fields compares with that of fringes. Least squares over
all frames: harmonics show in more than three steps, in the light of whole fields, bits and other periods against that
of the steps, and in the gain that several periods share. What pixels of equal phase contradict alike does not average
out, and counts once. What all that leaves open - four steps see no difference of the third and fifth harmonic - shows
in the crowding of the phases over the scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.decode.chosen import spread
from core.decode.frames import Image
from core.decode.tables import Singles
from core.decode.waves.camera import SPREAD as CAMERAS
from core.decode.waves.camera import TERMS, bend, rises
from core.decode.waves.crowding import TILES, Crowd, crowded, explained
from core.decode.waves.curves import PARAMETERS, SPREAD, dimming, light_at, waves
from core.decode.waves.response import HARMONICS, LARGEST, STEP, Array, Response, Terms, Wave
from core.numerics import quantile_of
from core.patterns import Pattern, level_of, use_of

PIXELS = 900  # of the sample that tell the curve
FIRST = 250  # that tell if it is worth looking for
FEWEST = 100  # pixels, fewer tell nothing
FILLED = 0.5  # of the pixels wanted, below which they are looked for in the whole sample
ROUNDS = 30
DAMPED = 16.0  # times what is known beforehand, so much a round is held back
CELLS = 24  # of a period, in which residuals are held against each other
MISFIT = 0.005  # part of a pixel's light by which fringes may differ from the model without noise
FIELD = 0.03  # the same for whole fields and bits, whose scattered light is another
UNUSUAL = 2.0  # standard deviations of the blur from which the search does not begin at what is usual
COARSE = 2.0  # times the finest period, one whose amplitude tells the finest's blur
BLUR = -0.8, 0.7  # logarithm of the blur's variance (lines²): what is usual, and how much rigs differ
OUTLIER = 9.0  # mean square of a pixel's residuals from which it counts less
ANOTHER = 5.0  # times `FIELD`, from which fields' light is not that of the levels shown, and tells no camera's curve
CLEAR = 0.3  # part of the pixels that must see all bits clearly off or on, without which no level is told
HALFWAY, FARTHEST = 0.05, 0.15  # part of a bit's light beyond which it is at an edge; most of that by `NOISY`
NOISY = 4.0  # grey values more
DIM = 0.1  # part of the brightest pixels' modulation that one must have
LEAST = 1.0  # grey value, modulation
SIGNIFICANT = 30.0  # twice the logarithm of the likelihood by which a curve must explain more than a straight line
WORTH = 12.0  # the same at the first look; without a curve it is 5 in the mean
BENT = 600.0  # the same of a camera's curve
LEFT = 0.5  # part of the median squares, of fringes and of fields, that it may leave
UNEVEN = 1.3  # times the dark pixels' light that bright ones have, or a projector's response explains as much
DEARER = 1.5  # times as much variance of phases is worth a sigma that is true
UNTOLD = 1e-6  # of full scale squared: squares of what is solved for anyway
SETTLED, UNSETTLED = 0.05, 1.0  # standard deviations squared of the last change: enough, and too many for a curve
CROWD = 40000  # pixels whose phases' density is looked at


class _Model:
    """The sample's pixels with their unknowns, and what the frames would show."""

    def __init__(
        self, all_waves: tuple[Wave, ...], patterns: Sequence[Pattern], sample: Singles, top: float, pixels: int
    ) -> None:
        self.waves = all_waves
        fringes = [n for wave in all_waves for n in wave.frames.frames]
        fields = [n for n, p in enumerate(patterns) if use_of(p) == "level"]
        shown = sample[fringes].astype(float)
        codes = [] if fields else [n for n, p in enumerate(patterns) if use_of(p) == "code"]
        self.levels = np.array([level_of(patterns[n]) for n in fields], float)
        if codes:
            bits = np.sort(sample[codes].astype(float), axis=0)
            off, on = bits[0], bits[-1]
            part = (bits - off) / np.maximum(on - off, LEAST)
            near = np.minimum(HALFWAY + NOISY / np.maximum(on - off, LEAST), FARTHEST)
            clear = np.all((part < near) | (part > 1 - near), axis=0)
            lit = part > 0.5
            on = (bits * lit).sum(axis=0) / np.maximum(lit.sum(axis=0), 1)
            off = (bits * ~lit).sum(axis=0) / np.maximum((~lit).sum(axis=0), 1)
            seen = np.vstack([shown, on, off])
            self.levels = np.array([1.0, 0.0])
        else:
            seen = np.vstack([shown, sample[fields]])
        group = [j for j, wave in enumerate(all_waves) for _ in wave.frames.frames]
        self.member = np.zeros((len(seen), len(all_waves)))
        self.member[np.arange(len(group)), group] = 1
        self.fringes = len(group)
        # start: as if the projector were linear
        quadratures = np.array([wave.seen(sample) for wave in all_waves])
        amplitude = np.abs(quadratures)
        dimmest = amplitude.min(axis=0)
        good = (seen.max(axis=0) < top) & (dimmest > _least(dimmest))
        if codes and (good & clear).sum() < CLEAR * good.sum():  # blur leaves bits no levels
            seen, self.levels, self.member = seen[:-2], self.levels[:0], self.member[:-2]
        where = np.flatnonzero(good)
        where = where[:: max(1, len(where) // pixels)]
        self.size = len(where)
        self.seen = seen[:, where].T  # (n, F)
        self.told = np.ones(self.seen.shape, bool)
        if codes:
            self.told[:, self.fringes :] = clear[where, None]
        self.phase = np.angle(quadratures[:, where]).T  # (n, J)
        self.gain, self.ground = np.ones(self.size), np.zeros(self.size)
        self.amplitude = amplitude[:, where]  # (J, n)
        self.solved = self.left = np.zeros(0)
        self.top, self.camera = top, np.zeros(0)  # the camera's curve, empty where it is straight
        self.light = self.seen  # without the camera's curve
        self.noise, self.squares = 0.1, np.zeros(2)  # medians of what is left of fringes and of fields

    def terms(self, r: Response) -> Terms:
        """Terms of every frame over the phase, shape (F, HARMONICS + 1); of whole fields only the first."""
        return _terms(self.waves, self.levels, r)

    def slopes(self, r: Response) -> tuple[Terms, Terms]:
        """The terms, and their changes by every value of the response, shape (values, F, HARMONICS + 1)."""
        if r.values.tobytes() == _START:  # every look begins with the same
            return _first_slopes(self.waves, tuple(self.levels))
        return _slopes(self.waves, self.levels, r)


def _model(
    all_waves: tuple[Wave, ...], patterns: Sequence[Pattern], sample: Singles, top: float, pixels: int
) -> _Model:
    """Model so many pixels of a sample; of a part of it, unless what is lit is small in the image."""
    thin = max(1, sample.shape[1] // (4 * pixels))
    found = _Model(all_waves, patterns, sample[:, ::thin], top, pixels)
    if thin > 1 and found.size < FILLED * pixels:
        return _Model(all_waves, patterns, sample, top, pixels)
    return found


_START = np.concatenate([np.zeros(PARAMETERS), [BLUR[0], BLUR[0], 0.0, 0.0]]).tobytes()
_SPREADS = np.concatenate([SPREAD, [BLUR[1], BLUR[1], FIELD, FIELD]])


def _terms(all_waves: tuple[Wave, ...], levels: Array, r: Response) -> Terms:
    found = np.zeros((sum(len(w.frames.frames) for w in all_waves) + len(levels), HARMONICS + 1), complex)
    at = 0
    for wave in all_waves:
        each = waves(wave.frames.patterns, wave.frames.period, r.table)
        each = each * dimming(wave.frames.period, r.blur[wave.axis])
        found[at : at + len(each)] = each[:, : HARMONICS + 1]
        at += len(each)
    light, (dark, more) = light_at(r.table, levels), r.values[-2:]
    found[at:, 0] = dark * (1 - light) + (1 + more) * light
    return found


def _slopes(all_waves: tuple[Wave, ...], levels: Array, r: Response) -> tuple[Terms, Terms]:
    terms = _terms(all_waves, levels, r)
    moved = [_terms(all_waves, levels, r.moved(k)) for k in range(len(r.values))]
    return terms, (np.array(moved) - terms) / STEP


@lru_cache(maxsize=16)
def _first_slopes(all_waves: tuple[Wave, ...], levels: tuple[float, ...]) -> tuple[Terms, Terms]:
    return _slopes(all_waves, np.array(levels), Response(np.frombuffer(_START), np.zeros((0, 0))))


def estimate_response(
    all_waves: tuple[Wave, ...],
    patterns: Sequence[Pattern],
    sample: Singles,
    saturation: float,
    images: Sequence[Image],
    camera: bool,
) -> tuple[Response | None, Array | None]:
    """Find the projector's response in a sample (frames, n) of the grey values, below `saturation`; and, if wanted, the
    `camera`'s curve, where that explains what no response does (see `core.decode.waves.camera`).

    None where there are no sine fringes or too few pixels see them. The images give more pixels, where the crowding of
    the phases must tell.
    """
    if not all_waves:
        return None, None
    parts = (len(range(*each.indices(n))) for each, n in zip(spread(images[0].shape), images[0].shape, strict=True))
    turns, tile = _turns(all_waves, sample, saturation, _tiles(*parts))
    first = _model(all_waves, patterns, sample, saturation, FIRST)
    if first.size < FEWEST:
        return None, None
    crowds = [Crowd(wave, each, tile) for wave, each in zip(all_waves, turns, strict=True)]
    looked = _search(first, crowds)
    if looked is None or _significance(*explained(crowds, looked)) < WORTH:
        return None, None
    model = _model(all_waves, patterns, sample, saturation, PIXELS)
    found = _search(model)
    assert found is not None
    curve = _search_camera(model, found) if camera else None
    turns, tile = _phases(images, all_waves, saturation)
    values, normal = explained([Crowd(wave, each, tile) for wave, each in zip(all_waves, turns, strict=True)], found)
    return (Response(values, normal) if _significance(values, normal) > SIGNIFICANT else None), curve


def _blurs(model: _Model) -> Array:
    """Logarithms of both axes' blur to begin with: what dims fine fringes beside coarse ones, where it is unusual."""
    blur, usual = np.full(2, BLUR[0]), np.median(model.amplitude, axis=1)
    for axis in (0, 1):
        mine = [(w.frames.period, a) for w, a in zip(model.waves, usual, strict=True) if w.axis == axis]
        if mine and max(mine)[0] > COARSE * min(mine)[0]:
            (fine, faint), (coarse, bright) = min(mine), max(mine)
            told = np.log(bright / faint) / (2 * np.pi**2 * (fine**-2.0 - coarse**-2.0))
            if told > np.exp(BLUR[0] + UNUSUAL * BLUR[1]):
                blur[axis] = np.log(told)
    return blur


def _search(model: _Model, crowds: Sequence[Crowd] = ()) -> Response | None:
    """Least squares over all frames; with `crowds`, None where neither they nor the first round show a curve."""
    start = np.frombuffer(_START)
    prior = np.diag(_SPREADS**-2.0)
    found = Response(np.concatenate([start[:PARAMETERS], _blurs(model), start[-2:]]), prior)
    for k in range(ROUNDS):
        normal, right = _reduced(model, found, prior, first=k == 0)
        change = np.asarray(np.linalg.solve(normal, right), float)
        nothing = k == 0 and crowds and _significance(change, normal) < WORTH
        found, last = _moved(model, found, normal, _damped(normal, right, prior, k))
        if nothing and not crowded(crowds, found.straight):
            return None
        if last < SETTLED:
            break
    return Response(found.values, (found.normal - prior) / _alike(model) + prior)


def _search_camera(model: _Model, found: Response) -> Array | None:
    """The camera's curve, found beside the projector's; None if that does not leave much that the camera explains."""
    prior = np.diag(np.concatenate([_SPREADS, np.full(TERMS, CAMERAS)]) ** -2.0)
    if np.abs(found.values[-2:]).max() > ANOTHER * FIELD:
        return None  # as of a lamp that follows the picture: fields tell of that, and fringes alone too little
    model.camera, before, phase, untold = np.zeros(TERMS), np.zeros(2), model.phase, UNTOLD * model.top**2
    for k in range(ROUNDS):
        normal, right = _reduced(model, found, prior)
        if k == 0:
            before, (dark, bright) = model.squares, np.quantile(model.ground + model.gain, (0.1, 0.9))
            if before[0] < untold or bright < UNEVEN * dark or right @ np.linalg.solve(normal, right) < BENT:
                return None
        found, last = _moved(model, found, normal, _damped(normal, right, prior, k))
        if last < SETTLED:
            break
    if last > UNSETTLED:
        return None  # as of frames that are exchanged, or a camera that saturates below its full scale
    _reduced(model, found, prior)
    if (model.squares > np.maximum(LEFT * before, untold)).any():
        return None  # as of light that scatters, which fields alone show
    if not rises(model.camera):
        return None  # as of noise, where frames are few: four steps of one axis show but one harmonic
    return model.camera if _worth_it(model, phase) else None


def _worth_it(model: _Model, phase: Array) -> bool:
    """Whether even steps of light tell phases about as well as the grey values, whose noise is even, but which bend
    them: `phase` (n, J) is as found without the camera's curve.
    """
    both = model.waves[0].both
    light = model.light[:, : len(both)]
    grey, slope, _ = bend(light, model.camera, model.top)

    def variance(shown: Array, noise: Array) -> Array:
        z = shown @ both
        return np.asarray((np.square((z[:, None].conj() * both).imag) * noise).sum(axis=1) / np.abs(z) ** 4)

    plain = variance(grey, np.full(grey.shape, model.noise))
    bent = float(np.median(np.square(model.phase[:, 0] - phase[:, 0]))) / 0.455
    return float(np.median(variance(light, model.noise / slope**2))) < DEARER * (float(np.median(plain)) + bent)


def _damped(normal: Array, right: Array, prior: Array, k: int) -> Array:
    """The change of round `k`; what the frames tell least is held back most."""
    damped = DAMPED if k > 0 else 0.0
    change = np.linalg.solve(normal + damped * prior, right)
    while np.abs(change).max() > LARGEST:
        damped = 4 * damped or 1.0
        change = np.linalg.solve(normal + damped * prior, right)
    return np.asarray(change)


def _alike(model: _Model) -> float:
    """How much more pixels of equal phase contradict the model alike than by chance: so much less they tell."""
    beyond = 0.0
    for frame in range(model.fringes):
        phase = model.phase[:, int(model.member[frame].argmax())] / (2 * np.pi)
        cell = ((phase - np.floor(phase)) * CELLS).astype(np.intp) % CELLS
        count = np.bincount(cell, minlength=CELLS)
        beyond += float(np.sum(np.bincount(cell, model.left[:, frame], CELLS) ** 2 / np.maximum(count, 1)))
    usual = float(np.mean(np.square(model.left[:, : model.fringes])))
    return max(beyond / (CELLS * model.fringes * max(usual, 1e-9)), 1.0)


def _significance(values: Array, normal: Array) -> float:
    """By how much a curve explains more than the straight line, which has parameters of 0; as chi squared."""
    curve = slice(0, PARAMETERS)
    return float(values[curve] @ np.linalg.solve(np.linalg.inv(normal)[curve, curve], values[curve]))


def _phases(images: Sequence[Image], all_waves: Sequence[Wave], saturation: float) -> tuple[Array, NDArray[np.intp]]:
    """Phases (turns) of all periods in many pixels, as if the projector were linear, shape (J, n), and their tiles.

    One pixel of every few, anywhere among them: at even distances they would soon be in step with the fringes.
    """
    height, width = images[0].shape
    step = max(1, int(np.sqrt(height * width / CROWD)))
    rows, columns = height // step, width // step
    aside = np.random.default_rng(0).integers(0, step, (2, rows, columns))
    at = (np.arange(rows)[:, None] * step + aside[0]) * width + np.arange(columns) * step + aside[1]
    some = {n: images[n].ravel()[at.ravel()] for wave in all_waves for n in wave.frames.frames}
    return _turns(all_waves, some, saturation, _tiles(rows, columns))


def _least(amplitude: Array) -> float:
    """The modulation that a pixel must have, by the brightest tenth; by a hundredth where no tenth is lit."""
    usual, brightest = quantile_of(amplitude, 0.9), quantile_of(amplitude, 0.99)
    return max(DIM * (usual if usual > DIM * brightest else brightest), LEAST)


def _tiles(rows: int, columns: int) -> NDArray[np.intp]:
    """Of pixels spread evenly over the image, the tile that each is in."""
    down, across = (np.arange(n) * TILES // n for n in (rows, columns))
    return np.asarray(np.add.outer(TILES * down, across).ravel())


def _turns(
    all_waves: Sequence[Wave], shown: Mapping[int, NDArray] | Singles, saturation: float, tile: NDArray[np.intp]
) -> tuple[Array, NDArray[np.intp]]:
    """Phases (turns) of all periods in those pixels, given by frame, that see all of them well; and their tiles."""
    found, good = [], np.array(True)
    for wave in all_waves:
        grey = np.stack([shown[n] for n in wave.frames.frames]).astype(np.float32)
        z = np.einsum("f,fn->n", wave.both.astype(np.complex64), grey)
        amplitude = np.abs(z)
        good = good & (grey.max(axis=0) < saturation) & (amplitude > _least(amplitude))
        found.append(z)
    return np.asarray(np.angle(np.array(found)[:, good]) / (2 * np.pi), float), tile[good]


def _reduced(model: _Model, r: Response, prior: Array, first: bool = False) -> tuple[Array, Array]:
    """Normal equations of the common unknowns, `prior` what is known beforehand, those of the pixels eliminated;
    remembers how these follow."""
    double = np.full(HARMONICS + 1, 2.0)
    double[0] = 1.0
    powers = np.exp(1j * model.phase.T[:, :, None] * np.arange(HARMONICS + 1))  # (J, n, M + 1)
    rows = [np.flatnonzero(column) for column in model.member.T]

    def shown(t: Terms) -> Array:
        light = np.tile(t[:, 0].real, (model.size, 1))
        for mine, power in zip(rows, powers, strict=True):
            light[:, mine] = (power @ (t[mine] * double).T).real
        return light

    terms, changes = model.slopes(r)
    light = shown(terms)
    if first:
        mean, grey = light.mean(axis=1, keepdims=True), model.seen.mean(axis=1, keepdims=True)
        away = light - mean
        gain = (away * (model.seen - grey)).sum(axis=1) / (away * away).sum(axis=1)
        model.gain = np.maximum(gain, LEAST)
        model.ground = grey[:, 0] - model.gain * mean[:, 0]
    gain = model.gain[:, None]
    level = model.ground[:, None] + gain * light
    slope = gain * shown(terms * 1j * np.arange(HARMONICS + 1))
    common = np.stack([gain * shown(change) for change in changes], axis=2)
    pixel = np.concatenate([np.ones((*light.shape, 1)), light[..., None], slope[..., None] * model.member], axis=2)
    if len(model.camera):
        model.light = level
        level, steep, bends = bend(level, model.camera, model.top)
        common = np.concatenate([steep[..., None] * common, bends], axis=2)
        pixel = steep[..., None] * pixel
    residual = model.seen - level
    fringe = np.arange(light.shape[1]) < model.fringes
    freedom = max(light.shape[1] - pixel.shape[2], 1) / light.shape[1]
    kinds = (residual[:, mine][model.told[:, mine]] for mine in (fringe, ~fringe))
    model.squares = np.array([np.median(np.square(part)) if part.size else 0.0 for part in kinds])
    model.noise = noise = max(float(model.squares[0]) / 0.455 / freedom, 0.1)
    weight = 1 / (noise + np.square(np.where(fringe, MISFIT, FIELD) * gain))
    weight = weight * model.told
    model.left = np.sqrt(weight) * residual
    misfit = np.mean(np.square(model.left), axis=1)
    weight *= (1 / np.maximum(1.0, misfit / OUTLIER))[:, None]
    weighted = (weight[..., None] * pixel).transpose(0, 2, 1)
    inner, outer = weighted @ pixel, weighted @ common
    inner += 1e-9 * np.einsum("nii->ni", inner).max(axis=1)[:, None, None] * np.eye(inner.shape[1])
    right = weighted @ residual[..., None]
    model.solved = np.linalg.solve(inner, np.concatenate([outer, right], axis=2))
    count = common.shape[2]
    flat = (weight[..., None] * common).reshape(-1, count)
    full, free = flat.T @ common.reshape(-1, count), flat.T @ residual.ravel()
    beside = outer.reshape(-1, count).T @ model.solved.reshape(-1, count + 1)
    away = np.concatenate([r.values - np.frombuffer(_START), model.camera])
    return full - beside[:, :-1] + prior, free - beside[:, -1] - prior @ away


def _moved(model: _Model, r: Response, normal: Array, change: Array) -> tuple[Response, float]:
    """Change the common unknowns, and those of the pixels as these follow; also gives the square of the change."""
    own = model.solved[..., -1] - model.solved[..., :-1] @ change
    model.ground = model.ground + own[:, 0]
    model.gain = np.maximum(model.gain + own[:, 1], LEAST)
    model.phase = model.phase + np.clip(own[:, 2:], -0.5, 0.5)
    model.camera = model.camera + change[len(r.values) :]
    return Response(r.values + change[: len(r.values)], normal), float(change @ normal @ change)
