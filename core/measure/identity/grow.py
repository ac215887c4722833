"""From a few identified targets to all that can be seen: the lattice grows outwards from what is known.

Every step predicts a target from identified ones near it: the fitted view, plus what that view misses among the
neighbours (lens distortion, bend of the board), carried on linearly. A spot becomes the target only if it is where the
prediction says, alone there, and of the size, shape and contrast of its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from core.measure.board import Board
from core.measure.identity.blobs import Blobs
from core.measure.identity.foretold import WHY, choose, foretell
from core.measure.identity.view import View, fit_both_tilts, fit_view
from core.model import Array, Ints
from core.numerics import inverse_2x2, median_of

ADJACENT = 8  # targets that count as next to one another


@dataclass
class Lattice:
    """Which spot is which target, while it grows."""

    board: Board
    blobs: Blobs
    view: View
    blob: Ints  # (n,) spot of every target, -1 where none yet
    reserved: dict[int, int] = field(default_factory=dict)  # spot -> the only target it may become (picks)
    conflicts: dict[int, int] = field(default_factory=dict)  # picked spot -> another target that was predicted there
    notes: dict[int, str] = field(default_factory=dict)  # target -> why no spot was accepted
    fitted: int = 4  # how many targets the view was fitted to
    foretold: tuple[View, Array, Array] | None = None

    @property
    def known(self) -> NDArray[np.bool_]:
        """(n,) which targets have a spot."""
        return self.blob >= 0

    def uv(self) -> Array:
        """(n, 2) px of the spots, NaN where none."""
        uv = np.full((len(self.blob), 2), np.nan)
        uv[self.known] = self.blobs.uv[self.blob[self.known]]
        return uv

    def expected(self) -> tuple[Array, Array]:
        """Pixels (n, 2) of all targets by the view, and pixels per mm on the board there (n, 2, 2)."""
        if self.foretold is None or self.foretold[0] is not self.view:
            xyz = self.board.xyz_mm
            self.foretold = self.view, self.view.project(xyz), self.view.jacobian(xyz)
        return self.foretold[1:]


def grow(lattice: Lattice) -> None:
    """Identify target after target until no further one can be."""
    adjacent = lattice.board.neighbours[:, :ADJACENT]
    least = 1
    while True:
        _refit(lattice)
        known = lattice.known
        beside, around = known[adjacent].sum(axis=1), known[lattice.board.neighbours].sum(axis=1)
        # next to what is known first; only when that is exhausted across a gap, and then from at least three
        frontier = np.flatnonzero(~known & (beside >= min(least, known.sum())))
        if not (len(frontier) and _extend(lattice, frontier)):
            if least == 2:
                frontier = np.flatnonzero(~known & (beside >= 1))
                if len(frontier) and _extend(lattice, frontier):
                    continue
            frontier = np.flatnonzero(~known & (around >= 3))
            if not (len(frontier) and _extend(lattice, frontier)):
                return
        least = 2


def predict(lattice: Lattice, targets: Ints) -> tuple[Array, Array, Ints]:
    """Predict targets from identified neighbours: px, px per mm on the board there (m, 2, 2), neighbours used.

    The place is NaN where the view cannot see the target.
    """
    board = lattice.board
    base, jacobian = lattice.expected()
    spots, of_board = (lattice.blob, lattice.blobs.uv), (board.xyz_mm, board.spacing_mm)
    uv, support = foretell(targets, board.neighbours, *spots, base, *of_board)
    return uv, jacobian[targets], support


def misfits(lattice: Lattice, targets: Ints) -> tuple[Array, Ints]:
    """How far identified targets lie from what their neighbours predict, in target spacings, and by how many."""
    uv, jacobian, support = predict(lattice, targets)
    return _on_board(lattice, targets, lattice.uv()[targets] - uv, jacobian), support


def prune(lattice: Lattice) -> dict[int, float]:
    """Take back identities that their neighbours do not confirm; say by how many target spacings they lie off."""
    least = min(3, len(lattice.blob) - 1)
    off: dict[int, float] = {}
    while True:
        targets = np.flatnonzero(lattice.known)
        if not len(targets):
            return off
        misfit, support = misfits(lattice, targets)
        lonely = support < least
        worst = int(np.argmax(misfit))
        if np.any(lonely):
            drop, why = targets[lonely], "ambiguous: too few identified targets around it to be sure"
        elif misfit[worst] > np.clip(9.0 * np.median(misfit), 0.10, 0.20):
            drop = targets[worst : worst + 1]
            off[int(drop[0])] = float(misfit[worst])
            why = f"ambiguous: {misfit[worst]:.2f} of a spacing off the place its neighbours predict"
        else:
            return off
        lattice.blob[drop] = -1
        lattice.notes.update(dict.fromkeys(drop.tolist(), why))


def _on_board(lattice: Lattice, targets: Ints, offset_px: Array, jacobian: Array) -> Array:
    """Lengths of pixel offsets (m, ..., 2) on the board, in target spacings."""
    on_board = np.einsum("mij,m...j->m...i", inverse_2x2(jacobian), offset_px)
    spacing = lattice.board.spacing_mm[targets].reshape(-1, *[1] * (on_board.ndim - 2))
    return np.asarray(np.sqrt(np.sum(on_board**2, axis=-1)) / spacing)


def _refit(lattice: Lattice) -> None:
    """Fit the view to everything identified, once that is more than the picks told."""
    known = np.flatnonzero(lattice.known)
    if len(known) < 1.4 * lattice.fitted:
        return
    uv = lattice.blobs.uv[lattice.blob[known]]
    fit = fit_both_tilts if len(known) < 40 else fit_view  # with many targets the tilt has long been decided
    view = fit(lattice.view, lattice.board.xyz_mm[known], uv, radial=len(known) >= 12)
    lattice.fitted = len(known)
    if np.all(np.isfinite(view.project(lattice.board.xyz_mm[known]))):
        lattice.view = view


def _extend(lattice: Lattice, frontier: Ints) -> bool:
    """Try to identify the targets of the frontier; True if at least one was."""
    uv, jacobian, support = predict(lattice, frontier)
    sane = np.all(np.isfinite(uv), axis=1) & np.all(np.isfinite(jacobian), axis=(1, 2))
    frontier, uv, support = frontier[sane], uv[sane], support[sane]
    board, blobs = lattice.board, lattice.blobs
    spot, why = np.empty_like(frontier), np.empty_like(frontier)
    of_targets = lattice.expected()[1], board.radius_mm, board.spacing_mm, board.neighbours, lattice.blob
    of_spots = blobs.uv, blobs.area_px, blobs.cov_px2, blobs.contrast, blobs.on_border
    choose(frontier, uv, support, *of_targets, *of_spots, _usual_size(lattice), spot, why)
    claims: dict[int, list[int]] = {}
    for target, own, reason in zip(frontier.tolist(), spot.tolist(), why.tolist(), strict=True):
        if own < 0:
            lattice.notes[target] = WHY[reason]
        else:
            claims.setdefault(own, []).append(target)
    return _settle(lattice, claims)


def _settle(lattice: Lattice, claims: dict[int, list[int]]) -> bool:
    """Give spots to the targets that claim them, unless two do or a pick says otherwise."""
    taken = {int(b): t for t, b in enumerate(lattice.blob.tolist()) if b >= 0}
    grown = False
    for spot, targets in claims.items():
        if spot in lattice.reserved and lattice.reserved[spot] not in targets:
            lattice.conflicts[spot] = targets[0]
        elif len(targets) > 1 or spot in taken:
            lattice.notes.update(dict.fromkeys(targets, "ambiguous: one dot fits two targets"))
        else:
            lattice.blob[targets[0]] = spot
            lattice.notes.pop(targets[0], None)
            grown = True
    return grown


def _usual_size(lattice: Lattice) -> float:
    """Diameter of the identified spots over the expected one, by area; the median."""
    known = np.flatnonzero(lattice.known)
    a, b, c, d = lattice.expected()[1][known].reshape(-1, 4).T
    area = np.pi * np.abs(a * d - b * c) * lattice.board.radius_mm[known] ** 2
    return median_of(np.sqrt(lattice.blobs.area_px[lattice.blob[known]] / area))
