"""Sigmas of the observations of a network held against each other: those of its images, and of both axes.

One variance of unit weight says nothing of them: where some are too small, others too large, they make up for each
other, and what is overweighed bends the points to itself and leaves little.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from core.errors import StripeError
from core.lazy import dataclass
from core.model import Adjustment, Array, Concern, Ints, Network
from core.numerics import chi_square_limit, erf, fisher_limit, median_of, sigma_by_median

LEVEL = 0.001  # chance that sound images, or axes, of a device are told to be uneven
UNEVEN_IMAGES = 1.6  # times that sigmas of images may be off against each other, beside chance; a fifth each makes 1.3
UNEVEN_AXES, HELD = 1.6, 1.6  # the same of both axes; residuals over the sigmas given of those that do hold
LEAST_REDUNDANCY = 0.05  # an observation checked less than this says nothing
CUT_OFF = 3.0  # sigmas beyond which a residual does not count
EFFICIENCY = 0.8  # of a variance without those beyond, as a share of the redundancy that one by squares has
ITERATIONS, SETTLED = 4, 0.03  # adjustments with the sigmas found; their change, as a share
LEVELLED = 1.1  # times that the images' sigmas differ, from which all are first made equal
LIKELY, LIKELY_AXES = 1.1, 1.25  # times the limit, and times, from which it is worth to adjust anew
FEW = 0.4  # of the images: these are told apart from the others
NAMED = 6  # stations that are named


@dataclass(frozen=True)
class _Spread:
    """What residuals show of the sigmas given, times: of every image and of both axes of every device.

    `freedom` and `freedom_of_axes` are the sums of redundancy numbers behind them.
    """

    images: Array  # (stations,) beside those of the axes
    freedom: Array
    axes: Array  # (devices, 2)
    level: Array  # (stations,) of both axes of its device
    freedom_of_axes: Array


@dataclass(frozen=True)
class _Apart:
    """The images of a device, numbered, in two parts, and how many times the sigmas of `upper` are too small."""

    lower: Ints
    upper: Ints
    ratio: float
    limit: float  # of that ratio by chance

    @property
    def most(self) -> float:
        """Ratio that is let pass: chance and sigmas that are a little off add up as independent errors do."""
        return float(np.exp(np.hypot(np.log(self.limit), np.log(UNEVEN_IMAGES))))


def uneven_sigmas(adjustment: Adjustment, anew: Callable[[Network, bool], Adjustment]) -> Iterator[str]:
    """H0: the sigmas of a device's images, and of its axes, hold one like the other.

    Variance components of images and axes come from residuals over their redundancies, beginning with equal sigmas
    for all images and repeated with those found (Förstner, *Ein Verfahren zur Schätzung von Varianz- und
    Kovarianzkomponenten*, 1979). Then the images are parted where the likelihood of two variances is largest, and
    the two compared by an F test. `anew` adjusts a network, if asked without gross errors.
    """
    try:
        network, spread = _components(adjustment, anew)
    except StripeError:
        return
    of = np.array(network.station_device)
    for name in network.devices:
        own = np.flatnonzero((of == name) & (spread.freedom > 1))
        apart = _parted(spread, own)
        if apart is not None and apart.ratio > apart.most and _holds(spread, apart.lower):
            yield _of_images(network, spread, apart, name)
    yield from _of_axes(network, spread)


def uneven_axes(adjustment: Adjustment) -> list[Concern]:
    """H0: the sigmas of both axes of a device hold alike, by residuals as they are."""
    network = adjustment.network
    return [Concern("doubtful", text) for text in _of_axes(network, _spread(adjustment, network))]


def _of_axes(network: Network, spread: _Spread) -> Iterator[str]:
    for name, axes, freedom in zip(network.devices, spread.axes, spread.freedom_of_axes, strict=True):
        small, large = np.argsort(axes)
        ratio, holds = axes[large] / axes[small], axes[small] ** 2 < _critical(freedom[small])
        if freedom.min() > 1 and holds and ratio > UNEVEN_AXES * _limit(freedom[large], freedom[small], 1):
            u, v = "uv"[large], "uv"[small]
            yield (
                f"{name}: residuals over sigmas are {ratio:.2g} times as large in {u} as in {v} (F test): the sigmas "
                f"of {u} are too small, or those of {v} too large; look for motion, compression or wrong patterns in "
                "one axis, or correct the sigmas"
            )


def _of_images(network: Network, spread: _Spread, apart: _Apart, device: str) -> str:
    """Name the images of which there are fewer, or of about as many those whose sigmas are off by more."""
    count, (upper, lower) = len(apart.lower) + len(apart.upper), (apart.upper, apart.lower)
    small = len(upper) < FEW * count
    if not small and len(lower) >= FEW * count:
        small = abs(np.log(_pooled(spread, upper))) >= abs(np.log(_pooled(spread, lower)))
    told, rest = (upper, lower) if small else (lower, upper)
    sigma = _given(network)
    names = [network.station_names[k] for k in told]
    stations = ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")
    claimed, usual = median_of(sigma[told]), median_of(sigma[rest])
    if small:
        return (
            f"observations.csv: sigma_px of station {stations} is {claimed:.2g}, of the other images by {device} "
            f"{usual:.2g}, but by the residuals it is {apart.ratio:.2g} times too small beside theirs (F test of "
            f"{len(told)} and {len(rest)} images): correct it, or what makes these images differ"
        )
    return (
        f"observations.csv: sigma_px of station {stations} is {claimed:.2g}, of the other images by {device} "
        f"{usual:.2g}, but by the residuals it is {apart.ratio:.2g} times too large beside theirs (F test of "
        f"{len(told)} and {len(rest)} images): correct it, or what makes these images differ"
    )


def _components(adjustment: Adjustment, anew: Callable[[Network, bool], Adjustment]) -> tuple[Network, _Spread]:
    """Variance components, and the network that they are of: without gross errors where there are such."""
    network = adjustment.network
    of_station, sigma = np.array(network.station_device), _given(network)
    usual = sigma.copy()
    for name in network.devices:
        usual[of_station == name] = median_of(sigma[of_station == name])
    level = usual / sigma
    current, even = adjustment, np.ones((len(network.devices), 2))
    if any(concern.about == "blunders" for concern in adjustment.doubts):
        current = anew(_times(network, level, even), True)
        kept = [network.station_names.index(name) for name in current.network.station_names]
        level = level[kept]
        network = _times(current.network, 1 / level, even)
    elif max(level.max(), 1 / level.min()) > LEVELLED:
        current = anew(_times(network, level, even), False)
    spread = _spread(current, network)
    for _ in range(ITERATIONS if _likely(network, spread) else 0):
        current = anew(_times(network, spread.images, spread.axes), False)
        before, spread = spread, _spread(current, network)
        if np.allclose(spread.images, before.images, SETTLED) and np.allclose(spread.axes, before.axes, SETTLED):
            break
    return network, spread


def _given(network: Network) -> Array:
    """The sigma that is given to each image: the median of its observations'."""
    groups = _by_station(network)
    return np.array([median_of(network.observation_sigma[own]) if len(own) else 1.0 for own in groups])


def _by_station(network: Network) -> list[Ints]:
    order = np.argsort(network.observation_station, kind="stable")
    ends = np.searchsorted(network.observation_station[order], np.arange(1, len(network.station_names)))
    return np.split(order, ends)


def _device_numbers(network: Network) -> Ints:
    names = list(network.devices)
    return np.array([names.index(name) for name in network.station_device])


def _times(network: Network, images: Array, axes: Array) -> Network:
    """Multiply the sigmas of images and axes."""
    station = network.observation_station
    factor = images[station][:, None] * axes[_device_numbers(network)[station]]
    return replace(network, observation_sigma=network.observation_sigma * factor)


def _spread(adjusted: Adjustment, network: Network) -> _Spread:
    """Compare residuals with the sigmas of a network that was adjusted with others: images and axes in turn."""
    numbers, station = adjusted.redundancy_numbers, network.observation_station
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(adjusted.residuals) / network.observation_sigma / np.sqrt(numbers)
    weight = np.where(np.isfinite(size) & (numbers > LEAST_REDUNDANCY), numbers, 0.0)
    device = _device_numbers(network)
    images, axes = np.ones(len(device)), np.ones((len(network.devices), 2))
    groups = _by_station(network)
    for _ in range(2):
        for d in range(len(axes)):
            own = np.flatnonzero(device[station] == d)
            for k in (0, 1):
                axes[d, k] = _scale(size[own, k] / images[station[own]], weight[own, k])
        for s, own in enumerate(groups):
            images[s] = _scale(size[own] / axes[device[s]], weight[own])
    freedom = np.array([weight[own].sum() for own in groups])
    of_axes = np.array([weight[device[station] == d].sum(axis=0) for d in range(len(axes))])
    level = np.sqrt(np.mean(axes**2, axis=1))[device]
    return _Spread(images, freedom, axes, level, of_axes)


def _scale(size: Array, weight: Array) -> float:
    """Standard deviation of normal deviates from sizes, without those of gross errors; 1 where there are none."""
    size, weight = size[weight > 0], weight[weight > 0]
    if not len(size):
        return 1.0
    within = float(erf(CUT_OFF / np.sqrt(2)))
    expected = 1 - CUT_OFF * np.exp(-(CUT_OFF**2) / 2) * np.sqrt(2 / np.pi) / within
    scale = max(sigma_by_median(size), 1e-9)
    for _ in range(10):
        before, used = scale, size <= CUT_OFF * scale
        scale = max(float(np.sqrt(np.average(size[used] ** 2, weights=weight[used]) / expected)), 1e-9)
        if scale == before:
            break
    return scale


def _likely(network: Network, spread: _Spread) -> bool:
    """Whether images or axes look uneven at the first sight."""
    device = _device_numbers(network)
    parts = [_parted(spread, np.flatnonzero((device == d) & (spread.freedom > 1))) for d in range(len(spread.axes))]
    images = any(apart is not None and apart.ratio > LIKELY * apart.limit for apart in parts)
    return images or bool(np.any(spread.axes.max(axis=1) > LIKELY_AXES * spread.axes.min(axis=1)))


def _parted(spread: _Spread, own: Ints) -> _Apart | None:
    """Part images in two, by size of their components, where the likelihood of two variances is largest."""
    if len(own) < 2:
        return None
    order = own[np.argsort(spread.images[own])]
    freedom = np.cumsum(spread.freedom[order])
    squares = np.cumsum(spread.freedom[order] * spread.images[order] ** 2)
    below, above = freedom[:-1], freedom[-1] - freedom[:-1]
    low, high = squares[:-1] / below, (squares[-1] - squares[:-1]) / above
    k = int(np.argmin(below * np.log(low) + above * np.log(high)))
    limit = _limit(float(above[k]), float(below[k]), len(order) - 1)
    return _Apart(order[: k + 1], order[k + 1 :], float(np.sqrt(high[k] / low[k])), limit)


def _pooled(spread: _Spread, own: Ints) -> float:
    return float(np.sqrt(np.average((spread.level * spread.images)[own] ** 2, weights=spread.freedom[own])))


def _holds(spread: _Spread, own: Ints) -> bool:
    """Whether images hold their sigmas: where none does, what is wrong has another cause."""
    return _pooled(spread, own) ** 2 < _critical(float(spread.freedom[own].sum()))


def _critical(freedom: float) -> float:
    freedom = max(EFFICIENCY * freedom, 1.0)
    return HELD**2 * chi_square_limit(freedom, LEVEL) / freedom


def _limit(above: float, below: float, tests: int) -> float:
    """Ratio of two equal sigmas that is exceeded by chance at `LEVEL`, in one of so many tests."""
    return float(np.sqrt(fisher_limit(max(EFFICIENCY * above, 1.0), max(EFFICIENCY * below, 1.0), LEVEL / tests)))
