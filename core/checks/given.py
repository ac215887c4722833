"""A network held against what its files give: places and lengths known before, pixels, stations.

A free datum takes any unit, hand or name of the points without a residual: what is approximate is compared, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from core.checks.network import DOUBTFUL_RATIO, FAILED_RATIO, LEVEL, cautious, checked, critical, factors
from core.checks.weights import uneven_sigmas
from core.digits import unit_hint
from core.errors import listed
from core.geometry import similarity, similarity_residual
from core.model import Adjustment, Array, Concern, Network, NetworkScale
from core.numerics import nearest, normal_limit

OTHER_SCALE = 2.0  # nobody's approximate coordinates are so wrong
UNLIKE_SCALE, KEPT = 0.05, 2.0  # where they keep their shape: prints that are fitted to the page shrink by less; times
MIRRORED, CHANCE = 0.6, 3.0  # of the deviations that a mirror image leaves, by chance to 1 - 3 / sqrt(points)
LEAST_POINTS, ROUGH = 8, 5.0  # of which approximate places are compared; times what half of them are off
OUTSIDE = 0.02  # of the image: no target is measured farther from it
FLAT = 0.01  # of its width, the depth of a field whose targets are on one side
ABOVE = 0.1  # sine of the angle at which a station surely stands on one side of it
NEAR = 0.1  # of c: at 10:1 a lens has its object at 0.1 c
FEWEST = 4  # observations that two images have in common to the last digit


def given_concerns(adjustment: Adjustment, anew: Callable[[Network, bool], Adjustment]) -> list[Concern]:
    """Hold observations against devices, and adjusted points against points.csv and the lengths in network.json.

    `anew` adjusts a network, if asked without gross errors.
    """
    network = adjustment.network
    bars = [network.scale, *network.lengths] if network.scale else list(network.lengths)
    told = [*_outside(adjustment), *_twice(adjustment), *_too_near(adjustment), *uneven_sigmas(adjustment, anew)]
    concerns = [Concern("doubtful", text) for text in told] + _known(adjustment) + _exchanged(adjustment)
    weighed = network.point_sigma_mm is not None and np.isin(network.point_sigma_mm, (0, np.inf), invert=True).any()
    concerns += [Concern("doubtful", text) for text in _too_large(adjustment, bool(bars or weighed))]
    sigmas = adjustment.length_sigma_mm or (0.0,) * len(bars)
    lengths = [c for bar, sigma in zip(bars, sigmas, strict=True) for c in _length(adjustment, bar, sigma)]
    return concerns + _mirrored(adjustment) + _from_behind(adjustment) + lengths


def _outside(adjustment: Adjustment) -> Iterator[str]:
    """Find observations that lie beyond the image of their device."""
    network = adjustment.network
    for name, own in network.made_by.items():
        spec, uv = network.devices[name].spec, network.observation_uv[own]
        size = np.array([spec.width, spec.height])
        beyond = np.any((uv < -OUTSIDE * size) | (uv > (1 + OUTSIDE) * size), axis=1)
        if beyond.any():
            ends = zip("uv", np.fmin.reduce(uv), np.fmax.reduce(uv), strict=True)
            spans = ", ".join(f"{axis} {a:.5g} … {b:.5g}" for axis, a, b in ends if a <= b)  # of columns alone no v
            yield (
                f"observations.csv: {np.count_nonzero(beyond)} of {len(uv)} observations by {name} lie outside its "
                f"{spec.width} x {spec.height} px ({spans}): count from the "
                "centre of the top-left pixel, and see which device each station names, and its width and height"
            )


def _twice(adjustment: Adjustment) -> Iterator[str]:
    """Find images that have the same observations, to the last digit: their errors are the same, too."""
    network = adjustment.network
    seen: dict[tuple[str, int, float, float], int] = {}
    alike: dict[tuple[int, int], int] = {}
    stations, points = network.observation_station.tolist(), network.observation_point.tolist()
    for station, point, (u, v) in zip(stations, points, network.observation_uv.tolist(), strict=True):
        first = seen.setdefault((network.station_device[station], point, u, v), station)
        if first != station:
            alike[first, station] = alike.get((first, station), 0) + 1
    for (a, b), count in alike.items():
        if count >= FEWEST and 2 * count > np.count_nonzero(network.observation_station == b):
            names = [network.station_names[k] for k in (a, b)]
            yield f"observations.csv: {count} observations of {names[1]} are those of {names[0]}: remove one of the two"


def _too_near(adjustment: Adjustment) -> Iterator[str]:
    """Find points nearer to a device than any lens has its object: lengths are in another unit than c."""
    network = adjustment.network
    middle = adjustment.points_mm.mean(axis=0)
    away: dict[str, list[float]] = {}
    for device, pose in zip(network.station_device, adjustment.station_from_object, strict=True):
        away.setdefault(device, []).append(float(np.linalg.norm(pose.apply(middle[None]))))
    for name, distances in away.items():
        distance, c = float(np.median(distances)), adjustment.devices[name].interior.c_mm
        if distance < NEAR * c:
            yield (
                f"points.csv: its points are adjusted {distance:.3g} mm away from {name}, whose c is {c:.4g} mm: give "
                "coordinates and lengths in mm, not in m"
            )
            return


def _known(adjustment: Adjustment) -> list[Concern]:
    """H0: known coordinates are off by at most `DOUBTFUL_RATIO` times their sigmas: of an axis, of a point, and all.

    Adjusted points follow what is known of them: what a coordinate is off counts by its redundancy, 1 less the share of
    its variance that the adjustment leaves. Where four points of an object are known, seven of twelve make its datum.
    """
    network, sigma = adjustment.network, adjustment.network.point_sigma_mm
    if sigma is None:
        return []
    weighed = np.isfinite(sigma) & (sigma > 0)
    given = np.where(weighed, sigma, 1.0)
    left = np.sqrt(np.diagonal(adjustment.point_cov_mm2, axis1=1, axis2=2))
    redundancy = checked(np.where(weighed, sigma, 0.0), left, adjustment.sigma0)
    off = np.where(weighed, adjustment.points_mm - network.point_xyz_mm, 0.0)
    ratio, concerns = np.abs(off) / given, []
    normalised = ratio / np.where(redundancy > 0, np.sqrt(redundancy), np.inf)
    by_others = off / np.where(redundancy > 0, redundancy, np.inf)
    for axis, name in enumerate("xyz"):
        count = int(np.count_nonzero(weighed[:, axis]))
        worst = int(np.argmax(normalised[:, axis]))
        point, by = network.point_names[worst], by_others[worst, axis]
        if _beyond(ratio[:, axis], redundancy[:, axis]):
            rms = float(np.sqrt(np.sum(ratio[:, axis] ** 2) / count))
            text = (
                f"points.csv: {name}_mm of {count} points is off by {rms:.3g} times sigma_{name}_mm (chi-square "
                f"test), of point {point} by {by:.3g} mm: correct these coordinates, or their sigmas"
            )
            concerns.append(Concern("failed" if rms > FAILED_RATIO else "doubtful", text))
        elif normalised[worst, axis] > DOUBTFUL_RATIO * normal_limit(LEVEL / 2 / max(count, 1)):
            text = (
                f"points.csv: {name}_mm of point {point} is off by {by:.3g} mm, "
                f"{abs(by) / given[worst, axis]:.3g} times sigma_{name}_mm: correct this coordinate, or its sigma"
            )
            concerns.append(Concern("doubtful", text))
    if not concerns and _beyond(ratio, redundancy):
        worst, axis = divmod(int(np.argmax(normalised)), 3)
        text = (
            f"points.csv: coordinates of {np.count_nonzero(weighed.any(axis=1))} points contradict one another "
            f"(chi-square test), most {'xyz'[axis]}_mm of point {network.point_names[worst]}, off by "
            f"{by_others[worst, axis]:.3g} mm: correct these coordinates, or their sigmas"
        )
        concerns.append(Concern("doubtful", text))
    return concerns


def _beyond(ratio: Array, redundancy: Array) -> bool:
    """Whether what coordinates are off, over their sigmas, is more than their redundancies allow."""
    freedom = float(redundancy.sum())
    return freedom > 1 and float(np.sum(ratio**2)) > freedom * critical(freedom)


def _exchanged(adjustment: Adjustment) -> list[Concern]:
    """Find two points that were adjusted to each other's approximate place; a free datum hides that in no residual."""
    network, found = adjustment.network, adjustment.points_mm
    if len(found) < LEAST_POINTS:
        return []
    near = np.ones(len(found), bool)
    for _ in range(3):
        scale, R, shift = similarity(network.point_xyz_mm[near], found[near])
        places = (found - shift) @ R / scale
        off = np.linalg.norm(places - network.point_xyz_mm, axis=1)
        near = off <= max(ROUGH * float(np.median(off)), 1e-9)
    takes = nearest(network.point_xyz_mm, 1, places)[:, 0]
    names = network.point_names
    return [
        Concern(
            "doubtful",
            f"points.csv: {names[a]} and {names[b]} are adjusted to each other's place: exchange their coordinates, or "
            "their names in observations.csv",
        )
        for a, b in enumerate(takes.tolist())
        if a < b and takes[b] == a and not near[a] and not near[b]
    ]


def _mirrored(adjustment: Adjustment) -> list[Concern]:
    """Find points that are adjusted to the mirror image of the approximate ones: no residual shows that."""
    given, found = adjustment.network.point_xyz_mm, adjustment.points_mm
    most = min(MIRRORED, 1 - CHANCE / np.sqrt(len(found)))
    off, mirrored = (similarity_residual(found * (1, 1, hand), given) for hand in (1, -1))
    if mirrored >= most * off:
        return []
    text = (
        f"points.csv: points are adjusted to the mirror image of their coordinates, which fits to {mirrored:.2g} mm, "
        f"not to {off:.2g} mm: give v downwards in observations.csv, and right-handed coordinates"
    )
    return [Concern("failed", text)]


def _from_behind(adjustment: Adjustment) -> list[Concern]:
    """Find stations on the other side of a flat field than most: mirrored images of it fit from there as well."""
    middle = adjustment.points_mm.mean(axis=0)
    _, extent, axes = np.linalg.svd(adjustment.points_mm - middle, full_matrices=False)
    if extent[2] > FLAT * extent[1]:
        return []
    centres = np.array([pose.inverse().translation_mm for pose in adjustment.station_from_object]) - middle
    height = centres @ axes[2] / np.linalg.norm(centres, axis=1)
    sides = [np.flatnonzero(sign * height > ABOVE) for sign in (1, -1)]
    fewer = min(sides, key=len)
    if not len(fewer):
        return []
    names = [adjustment.network.station_names[k] for k in fewer]
    text = (
        f"observations.csv: {listed(names)} see the flat field from the other side than all other stations: count v "
        "downwards and u to the right there, or exchange u and v if they were exchanged"
    )
    return [Concern("doubtful", text)]


def _too_large(adjustment: Adjustment, weighed: bool) -> Iterator[str]:
    """Find devices whose sigmas are too large beside those of others, or of what else is `weighed`, lengths or points.

    One sigma0 is of all: the others' observations then count too little, and their sigmas come out too small.
    """
    ratios = {name: factor**0.5 for name, (factor, _) in factors(adjustment).items()}
    most = max(ratios, key=lambda name: ratios[name], default="")
    for name, ratio in cautious(adjustment).items():
        if weighed:
            yield (
                f"{name}: residuals are {ratio:.2g} times what sigma_px allows: sigmas of lengths and points given "
                f"count as if they were smaller by as much; multiply sigma_px by {ratio:.2g}"
            )
        elif ratio * DOUBTFUL_RATIO < ratios[most]:
            yield (
                f"{name}: residuals are {ratio:.2g} times what sigma_px allows, those of {most} {ratios[most]:.2g} "
                f"times: it counts too little, and sigmas of results are between both; multiply sigma_px of {name} "
                f"by {ratio:.2g}"
            )


def _length(adjustment: Adjustment, bar: NetworkScale, left_mm: float) -> list[Concern]:
    """Hold a measured distance, adjusted with a sigma of `left_mm`, against all else, and against points.csv."""
    network, points = adjustment.network, (adjustment.points_mm, adjustment.network.point_xyz_mm)
    found = float(np.linalg.norm(points[0][bar.start] - points[0][bar.stop]))
    size, roughly = (float(np.linalg.norm(xyz - xyz.mean(axis=0))) for xyz in points)
    start, stop = (network.point_names[k] for k in (bar.start, bar.stop))
    share = float(checked(np.array(bar.sigma_mm), np.array(left_mm), adjustment.sigma0))
    if abs(found - bar.length_mm) > DOUBTFUL_RATIO * normal_limit(LEVEL / 2) * bar.sigma_mm * share**0.5 > 0:
        by_others, sure = bar.length_mm + (found - bar.length_mm) / share, left_mm / share**0.5
        text = (
            f"network.json: the length from {start} to {stop} is {bar.length_mm:.6g} mm ± {bar.sigma_mm:.2g}, by all "
            f"else {by_others:.6g} mm ± {sure:.2g}: measure it again"
        )
        return [Concern("doubtful", text)]
    ratio = size / max(roughly, 1e-9)
    if max(ratio, 1 / ratio) > OTHER_SCALE:
        text = (
            f"network.json: the length from {start} to {stop} is {bar.length_mm:.6g} mm, at the scale of points.csv "
            f"{found * roughly / size:.4g} mm{unit_hint(ratio, 1 / ratio)}: correct the length or the coordinates"
        )
        return [Concern("doubtful", text)]
    shape = similarity_residual(points[1] * ratio, points[0]) * np.sqrt(len(points[0]))
    if abs(ratio - 1) > UNLIKE_SCALE and abs(size - roughly) > KEPT * shape:
        text = (
            f"network.json: the length from {start} to {stop} is {bar.length_mm:.6g} mm, at the scale of points.csv "
            f"{found * roughly / size:.4g} mm, whose points keep their shape: correct the length, the points it is "
            "between, or the coordinates"
        )
        return [Concern("doubtful", text)]
    return []
