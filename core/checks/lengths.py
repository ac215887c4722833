"""Scale bar, boards and plate positions: up to four independent lengths, each held against the others.

The adjustment takes its scale from one of them; the rest can disagree without any residual showing it. The one that is
not like the others is named.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from core.checks.network import LEVEL, checked
from core.checks.plates import Plates
from core.digits import fixed, unit_hint
from core.geometry import similarity
from core.lazy import dataclass
from core.model import Adjustment, Array, Concern, Note, ScaleBar, Testfield
from core.numerics import chi_square_limit, median_of, straight_line

TOLERANCE = 0.002  # boards are made to about 0.1 %
SIGNIFICANT = 3.3  # sigmas of what the calibration leaves uncertain, at the level of the other tests
MOST_RELIEF = 0.03  # of its size: a board that bends by more is none, its heights are in µm
CLOSE, BESIDE = 2e-4, 4.0  # part to which two lengths agree closely; times that a third is off
FAILED = 0.02
OUT_OF_SHAPE = 0.01  # r.m.s. deviation from the nominal board, as a share of its size
OFF_LINES, MOST_OFF_LINES = 2.0, 6.0  # epipolar residuals over their sigmas, which are known to about a half
POOR, TOO_WELL = 0.003, 0.1  # a sigma over its length; sigmas off the board that a bar so poor is in 8 % of the cases
FOREIGN_LINES = 1.0  # epipolar residuals that no calibration of the rig itself leaves
LEAST_OFF = 3e-4  # of the distance: what positions are known to
ASIDE = 0.002  # of the distance, by which a plate may stand beside the axis of the others
BAR, POSITIONS = "the scale bar", "the plate positions"


@dataclass(frozen=True)
class Length:
    """A source of scale: what it is called, and its length over the one that the others would give (1 for true)."""

    name: str
    key: str  # in which file and field it stands
    factor: float
    sigma: float = 0.0  # of the factor, by the calibration that compares it with the others
    about: str = "board"  # or "plates"


def length_concerns(
    adjustment: Adjustment | None, board: Testfield | None, scale: ScaleBar | None, plates: Plates | None, same: bool
) -> list[Concern]:
    """Compare all known lengths with each other.

    Parameters
    ----------
    board : Testfield or None
        The nominal testfield of the adjustment; without one, what plates and scale bar have in common.
    plates : Plates or None
        Seen by the calibration of this adjustment.
    same : bool
        Whether the plate is the testfield itself.
    """
    lengths: list[Length] = []
    concerns: list[Concern] = []
    if adjustment is not None and board is not None:
        nominal = nominal_of(adjustment, board)
        ratio, concerns = _shape(nominal, adjustment.points_mm, "board")
        if scale is not None:
            lengths.append(Length(BAR, 'project.json, "scale"', 1.0))
        if np.isfinite(ratio):
            lengths.append(Length("the testfield", "testfield.csv", 1.0 / ratio))
    elif board is not None and scale is not None and (own := _nominal_length(scale, board)):
        lengths.append(Length(BAR, 'project.json, "scale"', scale.length_mm / own))
    crossing = _epipolar(plates) if plates is not None else {}
    if plates is not None:  # rays that pass each other tell no lengths
        plates = plates.only(
            [name for name in plates.names if name not in crossing or crossing[name].state != "failed"]
        )
    if plates is not None and len(plates.names):
        ratio, more = _plate_board(plates)
        concerns += more if not same else []
        if np.isfinite(ratio) and not same:
            sigma = _by_calibration(plates)
            lengths.append(Length("the plate's board", "its testfield file", 1.0 / ratio, sigma, "plates"))
        if len(plates.names) >= 2:
            slope, sigma, more = _positions(plates)
            concerns += more
            if np.isfinite(slope):
                lengths.append(Length(POSITIONS, "capture.json, z_mm", 1.0 / slope, sigma, "plates"))
    apart = _distances(adjustment, board) if adjustment is not None else []
    return [*apart, *_odd_one(lengths, scale, board), *concerns, *crossing.values()]


def _distances(adjustment: Adjustment, board: Testfield | None) -> list[Concern]:
    """Measured distances that the adjustment, which has them all, gives otherwise; sigmas that are too large.

    No residual is beyond its sigma, and a length that is known to `POOR` alone is hardly ever that of the board.
    """
    network, concerns = adjustment.network, []
    known = [] if network.scale is None else [("scale", network.scale)]
    known += [(f"lengths, entry {i}", bar) for i, bar in enumerate(network.lengths)]
    nominal = adjustment.points_mm * np.nan if board is None else nominal_of(adjustment, board)
    for key, bar in known:
        off = abs(float(np.linalg.norm(nominal[bar.stop] - nominal[bar.start])) - bar.length_mm)
        if bar.sigma_mm > POOR * bar.length_mm and off < TOO_WELL * bar.sigma_mm:
            text = (
                f"project.json, {key}: sigma_mm is {bar.sigma_mm:g}, {bar.sigma_mm / bar.length_mm:.1%} of length_mm, "
                f"which the nominal testfield has to {off:.2g} mm: is sigma_mm in µm instead of mm?"
            )
            concerns.append(Concern("doubtful", text, "board"))
    lefts = adjustment.length_sigma_mm or (0.0,) * len(known)
    for (key, bar), left in zip(known, lefts, strict=True) if len(known) > 1 else ():
        a, b = (adjustment.points_mm[k] for k in (bar.start, bar.stop))
        found = float(np.linalg.norm(b - a))
        off, share = found - bar.length_mm, float(checked(np.array(bar.sigma_mm), np.array(left), adjustment.sigma0))
        if share and abs(off) > SIGNIFICANT * bar.sigma_mm * share**0.5 + 1e-6 * found:
            others = bar.length_mm + off / share
            text = (
                f"project.json, {key}: is {bar.length_mm:.4g} mm ± {bar.sigma_mm:.2g}, {others:.4g} mm by all else: "
                "two known lengths disagree; measure them again"
            )
            text += unit_hint(bar.length_mm / others)
            gross = abs(others - bar.length_mm) > FAILED * others
            concerns.append(Concern("failed" if gross else "doubtful", text, "board"))
    return concerns


def _epipolar(plates: Plates) -> dict[str, Concern]:
    """By plate. H0: the fourth observation leaves at most `OFF_LINES` times what sigmas and calibration allow."""
    concerns = {}
    for name, (rms, factor, n) in plates.epipolar.items():
        if factor > OFF_LINES**2 * chi_square_limit(n, LEVEL) / n:
            text = (
                f"{name}: camera and projector see its targets {rms:.2g} lines r.m.s. off each other's rays, "
                f"{factor**0.5:.2g} times what the sigmas allow (chi-square test of the epipolar residuals): camera or "
                "projector moved since the testfield was captured, or the frames are of another capture"
            )
            concerns[name] = Concern("failed" if factor > MOST_OFF_LINES**2 else "doubtful", text, "plates")
    return concerns


def foreign_concerns(seen: Plates) -> list[Concern]:
    """See whether a calibration from elsewhere is of this rig: boards that it measured, placed by that calibration.

    Another rig's is off by many lines and per cent; limits are wide, for other programs' calibrations tell no sigmas.
    """
    off = median_of([rms for rms, _, _ in seen.epipolar.values()]) if seen.epipolar else 0.0
    ratio = _plate_board(seen)[0]
    told, remedy = [], "does it belong to another rig, or has the rig been changed since?"
    if off > FOREIGN_LINES:
        text = f"with the imported calibration, camera and projector see targets {off:.2g} lines off each other's rays"
        told.append(Concern("failed", f"{text}: {remedy}"))
    if np.isfinite(ratio) and abs(ratio - 1) > FAILED:
        text = f"with the imported calibration, the board measures {ratio:.3f} times what its file says"
        told.append(Concern("failed", f"{text}: {remedy}"))
    return told


def nominal_of(adjustment: Adjustment, board: Testfield) -> Array:
    """Nominal places of the adjusted points, (n, 3); NaN where a name is not of this board."""
    index = {f"{r}/{c}": i for i, (r, c) in enumerate(board.keys)}
    rows = [index.get(name, -1) for name in adjustment.network.point_names]
    return np.where(np.array(rows)[:, None] >= 0, board.xyz_mm[rows], np.nan)


def _shape(nominal: Array, found: Array, about: str) -> tuple[float, list[Concern]]:
    """Scale of the found points over the nominal ones, and whether the nominal ones have the right shape."""
    fitted = _fitted(nominal, found)
    if fitted is None:
        return float("nan"), []
    file = "testfield.csv" if about == "board" else "the plate's testfield file"
    nominal, found, scale, R, shift = fitted
    rest = found - scale * nominal @ R.T - shift
    size = float(np.linalg.norm(np.ptp(found, axis=0)))
    off = float(np.sqrt(np.mean(np.sum(rest**2, axis=1))))
    stretch, shear, affine_off = _affinity(nominal, found)
    if abs(stretch - 1) > TOLERANCE and affine_off < 0.5 * off:
        text = (
            f"{file}: x is stretched against y by {1 / stretch:.4f}, seen by the camera: correct x_mm or y_mm, or "
            "print the board at the same scale both ways"
        )
        return scale, [Concern("failed" if abs(stretch - 1) > FAILED else "doubtful", text, about)]
    if abs(shear) > TOLERANCE and affine_off < 0.5 * off:
        text = (
            f"{file}: x and y are {90 - np.rad2deg(shear):.2f}° apart, seen by the camera: correct x_mm and y_mm, or "
            "print the board without shear"
        )
        return scale, [Concern("failed" if abs(shear) > FAILED else "doubtful", text, about)]
    low = nominal * (1, 1, 1e-3)
    scale_low, R, shift = similarity(low, found)
    rest = found - scale_low * low @ R.T - shift
    if off > max(TOLERANCE * size, 5 * float(np.sqrt(np.mean(np.sum(rest**2, axis=1))))):
        unit = "; is it in µm instead of mm?" if np.ptp(nominal[:, 2]) > MOST_RELIEF * size else ""
        text = f"{file}: the board is seen {off:.3g} mm r.m.s. flatter than that: correct z_mm{unit}"
        return scale_low, [Concern("failed", text, about)]
    if off > OUT_OF_SHAPE * size:
        text = (
            f"{file}: the board seen differs from it by {off:.3g} mm r.m.s.: another board, or its targets are "
            "numbered differently"
        )
        return scale, [Concern("failed", text, about)]
    return scale, []


def _fitted(nominal: Array, found: Array) -> tuple[Array, Array, float, Array, Array] | None:
    """Points known in both, and the similarity that leads from one to the other; None of too few."""
    use = np.isfinite(nominal + found).all(axis=1)
    return (nominal[use], found[use], *similarity(nominal[use], found[use])) if use.sum() >= 4 else None


def _affinity(nominal: Array, found: Array) -> tuple[float, float, float]:
    """By how much x is longer than y in what was found, over nominal; what its angle lacks of 90°, rad; r.m.s. left."""
    a, b = nominal - nominal.mean(axis=0), found - found.mean(axis=0)
    flat = np.ptp(a[:, 2]) < 1e-3 * np.ptp(a[:, 0])
    columns = a[:, :2] if flat else a
    M, *_ = np.linalg.lstsq(columns, b, rcond=None)
    lengths = np.linalg.norm(M, axis=1)
    left = float(np.sqrt(np.mean(np.sum((b - columns @ M) ** 2, axis=1))))
    return float(lengths[0] / lengths[1]), float(M[0] @ M[1] / (lengths[0] * lengths[1])), left


def _by_calibration(plates: Plates) -> float:
    """Relative sigma of the plate's size, from the calibration's uncertainty."""
    own = scale_of(plates, plates.xyz_mm)
    other = np.array([scale_of(plates, xyz) for xyz in plates.uncertain_mm])
    return float(np.sqrt(np.nansum((other / own - 1) ** 2)))


def scale_of(plates: Plates, xyz_mm: Array) -> float:
    """Median scale of the found points of all plates, (plates, targets, 3), over the nominal ones."""
    return median_of([fitted[2] for xyz in xyz_mm if (fitted := _fitted(plates.nominal_mm, xyz))])


def _plate_board(plates: Plates) -> tuple[float, list[Concern]]:
    found = [_shape(plates.nominal_mm, xyz, "plates") for xyz in plates.xyz_mm]
    scales = [scale for scale, _ in found if np.isfinite(scale)]
    told = [concern for _, concerns in found for concern in concerns]
    often = told if len(told) > len(found) / 2 else []
    return median_of(scales), often[:1]


def _positions(plates: Plates) -> tuple[float, float, list[Concern]]:
    """Movement of the plate per mm of z_mm with its relative sigma, and plates that are not where z_mm says."""
    z = plates.z_mm
    if not np.ptp(z):
        return float("nan"), 0.0, []
    along, across, distance = _movement(plates)
    changes = np.array([_movement(replace(plates, xyz_mm=xyz))[0] - along for xyz in plates.uncertain_mm])
    line = np.polyfit(z, changes.reshape(-1, len(z)).T, 1)
    bent = np.linalg.norm(changes.reshape(-1, len(z)).T - np.outer(z, line[0]) - line[1], axis=1)
    limit = np.hypot(LEAST_OFF * distance, SIGNIFICANT * bent)
    slope, rest = _line(z, along, limit)
    noise = np.linalg.norm(rest) / (len(z) * np.std(z))
    sigma = float(np.hypot(np.linalg.norm(line[0]), noise)) / slope
    off = np.flatnonzero(np.abs(rest) > limit * max(slope, 1))
    concerns = []
    if len(z) - len(off) > max(2, len(z) // 2):
        for k in off:
            text = (
                f"{plates.names[k]}: the plate stood at {fixed(z[k] + rest[k] / slope, 2)} mm, by its targets, z_mm "
                f"says {z[k]:g} mm ({fixed(rest[k] / slope, 2, '+')} mm): correct z_mm or capture it again"
            )
            concerns.append(Concern("failed" if abs(rest[k]) > 3 * limit[k] else "doubtful", text, "plates"))
    elif len(off):
        places = ", ".join(f"{name} {fixed(at, 2)}" for name, at in zip(plates.names, z + rest / slope, strict=True))
        text = (
            f"by their targets, the plates stand at about {places} mm, not where z_mm says: correct z_mm, check "
            "that no frames were exchanged, and move the plate without play"
        )
        concerns.append(Concern("failed" if (np.abs(rest) > 3 * limit).any() else "doubtful", text, "plates"))
    for k in np.flatnonzero(across > max(ASIDE * distance, 6 * median_of(across))):
        text = f"{plates.names[k]}: the plate stood {fixed(across[k], 1)} mm beside its axis: did it move sideways?"
        concerns.append(Concern("doubtful", text, "plates"))
    return slope, sigma, concerns


def _line(z: Array, along: Array, tolerance: Array) -> tuple[float, Array]:
    """Fit a line that rises to the plates that agree with two of them, as many as do; give its slope, and all rests."""
    ordered = [(i, k) for i, k in combinations(np.argsort(z), 2) if z[i] < z[k]]
    pairs = np.array([(i, k) for i, k in ordered if along[i] < along[k]] or ordered)
    slope, start = np.diff(along[pairs]) / np.diff(z[pairs]), pairs[:, :1]
    off = np.abs(along - along[start] - slope * (z - z[start])) / tolerance / np.maximum(slope, 1)
    agreeing = off[np.argmin(np.minimum(off, 1).sum(axis=1))] <= 1
    line = np.polyfit(z[agreeing], along[agreeing], 1)
    return float(line[0]), along - np.polyval(line, z)


def _movement(plates: Plates) -> tuple[Array, Array, float]:
    """Position of each plate along the axis of all, and its distance from that axis, in mm; distance of the plates."""
    xyz = plates.xyz_mm
    common = np.isfinite(xyz).all(axis=(0, 2))
    if common.sum() >= 4:
        centres = xyz[:, common].mean(axis=1)
    else:  # no target is in all: the board's place from those that each plate has
        centres = np.array([_centre_of(plates.nominal_mm, p) for p in xyz])
    middle, axis = straight_line(centres)
    z = plates.z_mm - median_of(plates.z_mm)
    moved = centres - middle
    if np.sum((moved @ axis) * z) < 0:
        axis = -axis
    along = moved @ axis
    across = np.linalg.norm(moved - np.outer(along, axis), axis=1)
    return along, across, float(np.linalg.norm(middle))


def _centre_of(nominal: Array, found: Array) -> Array:
    use = np.isfinite(found).all(axis=1)
    _, R, shift = similarity(nominal[use], found[use], scaled=False)
    return np.asarray(R @ nominal.mean(axis=0) + shift)


def _odd_one(lengths: list[Length], scale: ScaleBar | None, board: Testfield | None) -> list[Concern]:
    """Name the length that is not like the others; with two, name both."""
    if len(lengths) < 2:
        return []
    factors = np.array([entry.factor for entry in lengths])
    sigma = np.array([entry.sigma for entry in lengths])
    agreeing = [
        np.abs(factors / f - 1) <= np.hypot(TOLERANCE, SIGNIFICANT * np.hypot(sigma, s))
        for f, s in zip(factors, sigma, strict=True)
    ]
    # what is known poorly itself may agree with two that differ: it decides only where the others do not
    certain, everyone = np.flatnonzero(SIGNIFICANT * sigma <= TOLERANCE), np.arange(len(lengths))
    rounds = (certain, everyone) if len(certain) >= 2 else (everyone,)
    for voters in rounds:
        votes = np.array([agreeing[k][voters].sum() for k in voters])
        most = voters[votes == votes.max()]
        like = agreeing[most[0]]
        clear = votes.max() >= 2 and all((agreeing[k] == like)[voters].all() for k in most)
        if all(like) and (votes.min() == len(voters) or (clear and voters is rounds[0])):
            return _bar_alone(lengths, scale, board)
        if clear and not all(like):
            true = median_of(factors[[k for k in voters if like[k]]])
            others = " and ".join(lengths[k].name for k in np.flatnonzero(like))
            return [_told(lengths[k], factors[k] / true, others, scale, board) for k in np.flatnonzero(~like)]
    worst = float(factors.max() / factors.min())
    told = "; ".join(f"{entry.name} ({entry.key}) says {entry.factor / factors[0]:.4f}" for entry in lengths)
    hint = unit_hint(worst, 1 / worst)
    if len(lengths) == 2 and lengths[1].key == "testfield.csv" and worst <= 1 + FAILED:  # as printers stretch a board
        hint = f", or, if the bar is right, multiply the coordinates in testfield.csv by {1 / lengths[1].factor:.4f}"
    text = f"known lengths disagree, relative to {lengths[0].name}: {told}; measure them again{hint}"
    hint = _bar_hint(scale, board, worst) if scale is not None else ""
    return [Concern("failed" if worst > 1 + FAILED else "doubtful", text + hint)]


def _bar_alone(lengths: list[Length], scale: ScaleBar | None, board: Testfield | None) -> list[Concern]:
    """Name a scale bar beside which a board and the plate positions, made by different means, agree closely."""
    known = {entry.name: entry for entry in lengths}
    if BAR not in known or POSITIONS not in known:
        return []
    bar, moved = known.pop(BAR), known.pop(POSITIONS)
    for entry in known.values():
        true, sigma = moved.factor, float(np.hypot(moved.sigma, entry.sigma))
        close = abs(entry.factor / true - 1) + SIGNIFICANT * sigma <= CLOSE
        if close and abs(bar.factor / true - 1) > BESIDE * CLOSE:
            return [_told(bar, bar.factor / true, f"{entry.name} and {moved.name}", scale, board)]
    return []


def _told(entry: Length, factor: float, others: str, scale: ScaleBar | None, board: Testfield | None) -> Concern:
    text = f"{entry.name} ({entry.key}): its lengths are {factor:.4f} times what {others} give"
    text += unit_hint(factor) or "; correct it, or measure it again"
    if entry.name == BAR:
        text += _bar_hint(scale, board, factor)
    off = max(factor, 1 / factor) - 1
    return Concern("failed" if off > FAILED else "doubtful", text, entry.about)


def bar_notes(scale: ScaleBar | None, board: Testfield) -> tuple[Note, ...]:
    """Say how far a scale bar is off the nominal board: where nothing can be adjusted, that may be why."""
    own = _nominal_length(scale, board)
    if scale is None or own is None or abs(scale.length_mm / own - 1) <= FAILED:
        return ()
    hint = unit_hint(scale.length_mm / own) or unit_hint(own / scale.length_mm)
    text = f"the scale bar has length_mm {scale.length_mm:g}, the nominal testfield {own:g} mm there{hint}"
    return (Note(text, "value"),)


def _nominal_length(scale: ScaleBar | None, board: Testfield) -> float | None:
    index = board.index()
    if scale is None or scale.start not in index or scale.stop not in index:
        return None
    return float(np.linalg.norm(board.xyz_mm[index[scale.start]] - board.xyz_mm[index[scale.stop]]))


def _bar_hint(scale: ScaleBar | None, board: Testfield | None, factor: float) -> str:
    """Name other targets that are this far from each other, if the length itself could be right."""
    own = None if board is None else _nominal_length(scale, board)
    if scale is None or board is None or own is None or abs(scale.length_mm / own - 1) <= TOLERANCE:
        return ""
    index = board.index()
    for end, name in ((index[scale.start], scale.start), (index[scale.stop], scale.stop)):
        far = np.linalg.norm(board.xyz_mm - board.xyz_mm[end], axis=1)
        for k in np.flatnonzero(np.abs(far / scale.length_mm - 1) < TOLERANCE):
            return (
                f" (the nominal testfield has {scale.length_mm:g} mm from {name[0]},{name[1]} to {board.row[k]},"
                f"{board.col[k]}: is the bar on other targets?)"
            )
    return ""
