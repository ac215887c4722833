"""The bundle adjustment judged by what was known before it: the sigmas given, independence, nominal values.

σ0 after variance components is 1 whatever the model; so residuals are tested against the sigmas of the observations as
they came.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from core.checks.forms import form_concerns
from core.geometry.lens import lens_of
from core.model import AdjustedDevice, Adjustment, Array, Concern, DeviceSpec
from core.numerics import chi_square_limit, distinct, median_of, nearest, normal_limit, sigma_by_median

LEVEL = 0.001  # chance that a test, on its own, calls a sound result doubtful
DOUBTFUL_RATIO = 1.6  # residuals over their sigmas; centroids' sigmas are known to about a half on uneven light
FAILED_RATIO = 3.0
FINE = 0.02  # px, r.m.s.: the size of such residuals fails nothing, whatever the sigmas; few dots are measured better
UNEVEN = 0.006  # px that uneven pixels, print or coarse rendering add to a coordinate beside the noise sigmas are of
ANOTHER_UNIT = 0.01  # residuals over sigmas that no carefulness explains
TAILS = 2.5  # root mean square of residuals over their sigma by the median; images that are off as a whole make it 1.9
AGREEING = 0.5  # correlation of neighbours' residuals: half their variance is common to them
LOST = 0.05  # share of the observations that may be gross errors
MOST_LOST = 0.25
C_DOUBTFUL, C_FAILED = 1.2, 1.6  # focusing at the distances of such rigs makes c longer than f by less than a fifth
AFFINITY = 0.02  # A3, half the stretch: pixels of frame grabbers are up to 3 % out of square, which is A3 = 0.015
AFFINITY_DECLARED = 0.005  # where the pitches given differ, somebody knew their ratio
AFFINITY_FAILED = 0.08
UNCHECKED, TINY = 1e-6, 1e-150  # redundancy of a known value that nothing else tells, beside rounding; sigma0
OFF_CENTRE = 0.2  # a camera's principal point, as a share of half its image


def adjustment_concerns(adjustment: Adjustment, rejected: Mapping[str, tuple[int, int]] | None = None) -> list[Concern]:
    """Test the residuals of a bundle adjustment, beside what put it in doubt while it was adjusted.

    Parameters
    ----------
    rejected : mapping, optional
        By station, how many of how many observations were left out as gross errors.
    """
    devices = adjustment.devices.items()
    known = [c for name, device in devices for c in _known_before(name, device, adjustment.sigma0)]
    # twice, and told once: causes first
    known = [*(c for c in adjustment.doubts if c.about in ("held", "captures", "rigid")), *known]
    squares = _chi_square(adjustment)
    normalised = adjustment.residuals / adjustment.network.observation_sigma
    if np.nanmean(normalised**2) > TAILS**2 * sigma_by_median(normalised) ** 2:  # gross errors are the cause: first
        failed = any(c.state == "failed" for c in squares)
        gross = [replace(c, state="failed") if failed and c.about == "blunders" else c for c in adjustment.doubts]
        return [*known, *gross, *squares, *_systematic(adjustment), *_rejected(rejected or {})]
    systematic = [*_systematic(adjustment), *form_concerns(adjustment)]
    return [*known, *squares, *systematic, *_rejected(rejected or {}), *adjustment.doubts]


def sound_words(adjustment: Adjustment) -> tuple[str, ...]:
    """What to say of an adjustment that nothing speaks against."""
    found = factors(adjustment)
    told = ", ".join(f"{name} {factor**0.5:.2f}" for name, (factor, _) in found.items())
    words = [f"residuals over the sigmas given: {told}; nothing systematic"] if told else []
    for name, (factor, redundancy) in found.items():
        if factor > critical(redundancy):
            words.append(f"{name}: the images err by {_rms(adjustment, name):.2g} px, more than by their noise alone")
    if names := ", ".join(cautious(adjustment)):
        words.append(f"{names}: the sigmas given are larger than the residuals show; those of the results follow these")
    return tuple(words)


def cautious(adjustment: Adjustment) -> dict[str, float]:
    """By device, residuals over sigmas where these are too large: chi-square test, H0: by `DOUBTFUL_RATIO` at most."""
    return {
        name: factor**0.5
        for name, (factor, redundancy) in factors(adjustment).items()
        if factor * redundancy * DOUBTFUL_RATIO**2 < chi_square_limit(redundancy, 1 - LEVEL)
    }


def factors(adjustment: Adjustment) -> dict[str, tuple[float, float]]:
    """By device, the variance factor of its observations against the sigmas given, and its redundancy.

    It is the one estimated, which knows what observations have in common, where one was.
    """
    network = adjustment.network
    squares = (adjustment.residuals / network.observation_sigma) ** 2
    estimated = any(factor != 1 for factor in adjustment.variance_factors.values())
    result = {}
    for name, own in network.made_by.items():
        redundancy = float(np.nansum(adjustment.redundancy_numbers[own]))
        if redundancy > 1:
            by_residuals = float(np.nansum(squares[own])) / redundancy
            result[name] = adjustment.variance_factors[name] if estimated else by_residuals, redundancy
    return result


def critical(redundancy: float) -> float:
    """Variance factor beyond which the sigmas given, times `DOUBTFUL_RATIO`, do not explain the residuals."""
    return DOUBTFUL_RATIO**2 * chi_square_limit(redundancy, LEVEL) / redundancy


def _rms(adjustment: Adjustment, device: str) -> float:
    """Residuals of a device's coordinates, r.m.s. px."""
    return float(np.sqrt(np.nanmean(adjustment.residuals[adjustment.network.made_by[device]] ** 2)))


def _chi_square(adjustment: Adjustment) -> list[Concern]:
    """H0: residuals are at most `DOUBTFUL_RATIO` times what the sigmas given and uneven pixels allow."""
    concerns = []
    network = adjustment.network
    for name, (factor, redundancy) in factors(adjustment).items():
        uneven = UNEVEN**2 * float(np.nanmean(network.observation_sigma[network.made_by[name]] ** -2.0))
        limit, ratio = (1 + uneven) * critical(redundancy), float(np.sqrt(factor))
        if ratio < ANOTHER_UNIT and redundancy > 10:
            text = f"{name}: residuals are {ratio:.2g} times what the sigmas of its observations allow: another unit?"
            concerns.append(Concern("doubtful", text))
        if factor <= limit:
            continue
        text = (
            f"{name}: residuals are {ratio:.3g} times what the sigmas of its observations allow (chi-square "
            f"test, variance factor {factor:.3g}; up to {limit:.3g} is what sigmas known to a half and uneven pixels "
            "explain): "
        )
        worst = _worst_station(adjustment, name)
        text += f"{worst}; " if worst else ""
        rms = _rms(adjustment, name)
        if fine := rms < FINE:
            added = f"they are {rms:.2g} px, what uneven pixels, print or coarse rendering add to noise"
            text += f"{added}; "
        if np.isfinite(adjustment.devices[name].spec.interior_sigma).any():
            text += "the interior orientation known before may belong to another lens or focus; "
        text += (
            "look for wrong identities or a turned board, a moved device, a board that bends, wrong patterns, frames "
            "that were compressed, denoised or rescaled, or sigmas set too small"
        )
        concerns.append(Concern("failed" if ratio > FAILED_RATIO and not fine else "doubtful", text))
    return concerns


def checked(sigma: Array, left: Array, sigma0: float) -> Array:
    """Share of values known with sigmas that all else tells, their redundancy; 0 where it tells nothing.

    `left` are their sigmas after the adjustment, whose `sigma0` these contain. The adjusted value follows the known
    one: by all else it is off by this share's inverse more, with a sigma of ``left / sqrt(share)``.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1.0 - (left / max(sigma0, TINY)) ** 2 / sigma**2
    return np.where((sigma > 0) & np.isfinite(sigma) & (share > UNCHECKED), share, 0.0)


def _known_before(name: str, device: AdjustedDevice, sigma0: float) -> list[Concern]:
    """Hold an adjusted interior orientation against the one known before, an observation with sigmas, too."""
    known, sigma = device.spec.interior, np.array(device.spec.interior_sigma)
    if known is None or not len(sigma):
        return []
    left = device.sigma[: len(sigma)]
    share = np.where(left > 0, checked(sigma, left, sigma0), 0.0)
    off = (device.interior.vector - known.vector)[: len(sigma)]
    ratio = np.abs(off) / np.where(share > 0, sigma, np.inf) / np.sqrt(np.where(share > 0, share, 1.0))
    worst, limit = int(np.argmax(ratio)), normal_limit(LEVEL / 2)
    if ratio[worst] <= DOUBTFUL_RATIO * limit:
        return []
    by_images, sure = known.vector[worst] + off[worst] / share[worst], left[worst] / np.sqrt(share[worst])
    text = (
        f"{name}: {lens_of(known).keys[worst]} is {by_images:.6g} ± {sure:.2g} by the images, known before as "
        f"{known.vector[worst]:.6g} ± {sigma[worst]:.2g}: it belongs to another lens or focus, or its "
        "sigma is too small"
    )
    return [Concern("failed" if ratio[worst] > FAILED_RATIO * limit else "doubtful", text)]


def _worst_station(adjustment: Adjustment, device: str) -> str:
    """Name the station that holds most of a device's squares, where one does."""
    network = adjustment.network
    squares = np.nansum((adjustment.residuals / network.observation_sigma) ** 2, axis=1)
    of_station = np.bincount(network.observation_station, squares, len(network.station_names))
    own = np.array([d == device for d in network.station_device])
    total = float(of_station[own].sum())
    worst = int(np.argmax(np.where(own, of_station, -1.0)))
    share = of_station[worst] / total if total else 0.0
    return f"{share:.0%} of it comes from station {network.station_names[worst]}" if share > 0.5 else ""


def _systematic(adjustment: Adjustment) -> list[Concern]:
    """H0: residuals of neighbouring points are independent; the low-pass test of the residuals.

    Where the chi-square test rejects them, too, the model is contradicted: no sigma of the results holds.
    """
    network, concerns = adjustment.network, []
    beyond = {name for name, (factor, redundancy) in factors(adjustment).items() if factor > critical(redundancy)}
    w = adjustment.residuals / network.observation_sigma
    for name, made in network.made_by.items():
        products: list[Array] = []
        squares: list[Array] = []
        for station in distinct(network.observation_station[made]):
            own = np.flatnonzero(network.observation_station == station)
            own = own[np.isfinite(w[own]).all(axis=1)]
            if len(own) < 8:
                continue
            near = nearest(network.observation_uv[own], 2)[:, 1]
            products.append(w[own] * w[own][near])
            squares.append(w[own] ** 2)
        if not products:
            continue
        product, square = np.concatenate(products).ravel(), np.concatenate(squares).ravel()
        # a few gross errors are told elsewhere; they must not decide here
        limit = 25 * median_of(square) + 1e-12
        use = square < limit
        common = float(np.sum(np.clip(product[use], -limit, limit)))
        agreement = min(common / max(float(np.sum(square[use])), 1e-12), 1.0)
        significant = agreement * np.sqrt(np.count_nonzero(use) / 2) > 3.1  # mutual neighbours count twice
        if agreement > AGREEING and significant:
            rms = float(np.sqrt(agreement * np.nanmean(adjustment.residuals[made] ** 2)))
            text = (
                f"{name}: residuals are systematic, {agreement:.0%} of their variance is common to neighbouring points "
                f"(about {rms:.2g} px or lines): a wrong lens model, a moved device, a board that bends or wrong "
                "projector coordinates; look at the residual vectors"
            )
            ratio = np.sqrt(agreement * float(np.nanmean(square)))
            concerns.append(Concern("failed" if name in beyond or ratio > FAILED_RATIO else "doubtful", text))
    return concerns


def _rejected(rejected: Mapping[str, tuple[int, int]]) -> list[Concern]:
    total = sum(of for _, of in rejected.values())
    lost = sum(n for n, _ in rejected.values())
    concerns, single = [], lost
    by_capture: dict[str, list[tuple[str, int, int]]] = {}
    for station, (n, of) in rejected.items():
        if n > 0.5 * of and of >= 4:
            capture, _, device = station.rpartition("/")
            by_capture.setdefault(capture or device, []).append((device, n, of))
            single -= n
    for capture, images in by_capture.items():
        devices = " and ".join(device for device, _, _ in images if device != capture)
        n, of = max((n, of) for _, n, of in images)
        where = f"{capture}, image of {devices}" if devices else capture
        text = (
            f"{where}: {n} of {of} points do not fit the others and were left out: camera or projector moved in "
            "this capture, its picks are wrong, or its frames are of another capture; capture it again"
        )
        concerns.append(Concern("doubtful", text))
    if total and (single > LOST * total or lost > MOST_LOST * total):
        text = f"{lost} of {total} observations ({lost / total:.0%}) were left out as gross errors"
        remedy = "; check picks, exposure and what moved" if not concerns else ""
        concerns.append(Concern("failed" if lost > MOST_LOST * total else "doubtful", text + remedy))
    return concerns


def nominal_concerns(devices: Mapping[str, AdjustedDevice], cameras: Collection[str] = ("camera",)) -> list[Concern]:
    """Hold adjusted interior orientations against what project.json says of the devices; `cameras` are their names."""
    concerns = []
    for name, device in devices.items():
        of_focus = focal_concerns(name, device.spec, device.interior.c_mm, float(device.sigma[0]))
        concerns += [*of_focus, *_square(name, device)]
        if name in cameras and not _foretold(device):  # projectors are often shifted on purpose
            concerns += _centre(name, device)
    return concerns


def focal_concerns(
    name: str,
    spec: DeviceSpec,
    c_mm: float,
    sigma_mm: float,
    remedy: str = "correct nominal_c_mm or pitch_mm; c grows with the pitch",
) -> list[Concern]:
    """Hold a principal distance that was adjusted against the nominal one; nothing where it was held (sigma 0)."""
    nominal = spec.nominal_c_mm
    ratio = max(c_mm / nominal, nominal / c_mm)
    if sigma_mm <= 0 or ratio <= C_DOUBTFUL or abs(c_mm - nominal) < 3.3 * sigma_mm:
        return []
    text = f"{name}: c is {c_mm:.4g} mm, nominal_c_mm {nominal:.4g} mm ({c_mm / nominal:.3g} times): {remedy}"
    return [Concern("failed" if ratio > C_FAILED else "doubtful", text)]


def _square(name: str, device: AdjustedDevice) -> list[Concern]:
    names = lens_of(device.interior).names
    key = next((k for k in ("A3", "b1") if k in names), None)
    if key is None:
        return []
    share = 1.0 if key == "A3" else 0.5  # of the stretch between the axes
    a3 = share * float(device.interior.vector[names.index(key)])
    sigma = share * float(device.sigma[names.index(key)])
    px, py = device.spec.pitch_mm
    limit = AFFINITY if abs(px / py - 1) < 1e-3 else AFFINITY_DECLARED
    if sigma <= 0 or abs(a3) - 3.3 * sigma <= limit:
        return []
    found = py / px * (1 + a3) / (1 - a3)
    text = (
        f"{name}: pixels are {found:.4f} times as high as wide ({key} = {a3 / share:.3g}), by pitch_mm {py / px:.4f}: "
        "correct pitch_mm of one axis; it was absorbed by c and A3"
    )
    return [Concern("failed" if abs(a3) > AFFINITY_FAILED else "doubtful", text)]


def _foretold(device: AdjustedDevice) -> bool:
    """Whether the principal point is given before, with sigmas; `_known_before` holds what was adjusted against it."""
    sigma = np.array(device.spec.interior_sigma or (np.inf,) * 3)[1:3]
    return device.spec.interior is not None and bool(np.all(np.isfinite(sigma)))


def _centre(name: str, device: AdjustedDevice) -> list[Concern]:
    if not np.all(device.sigma[1:3] > 0):
        return []
    half = np.array([device.spec.width * device.spec.pitch_mm[0], device.spec.height * device.spec.pitch_mm[1]]) / 2
    offset = np.abs(device.interior.vector[1:3]) - 3.3 * device.sigma[1:3]
    if np.all(offset <= OFF_CENTRE * half):
        return []
    x0, y0 = device.interior.vector[1:3]
    text = (
        f"{name}: the principal point is at ({x0:.3g}, {y0:.3g}) mm, far from the image's centre: were the images "
        "cropped or mirrored, or is width or height in project.json wrong? Of a region off the sensor's middle, give "
        'x0_mm and y0_mm as "interior", with their sigmas'
    )
    return [Concern("doubtful", text)]
