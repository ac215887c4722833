"""Points and captures that had no part in a calibration, and why."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from core.model import Adjustment, LeftOut, StationId, TargetSet

NUMBER = re.compile(r"\d+(?:\.\d+)?")


def left_out_of(
    targets: Sequence[TargetSet],
    rejected: Mapping[str, tuple[int, int]] | None = None,
    captures: Iterable[tuple[str, str]] = (),
    *,
    why: str = "do not fit the others: gross errors",
) -> tuple[LeftOut, ...]:
    """List what was left out, capture by capture.

    Of the captures that took part the missing targets are told by reason and, of several devices, by pair. `rejected`
    says by station ("capture/device") how many of how many observations the adjustment left out, and `why`; `captures`
    are those that took no part, each with the reason.
    """
    found = []
    of: dict[str, int] = {}
    pairs = {(t.camera, t.projector) for t in targets}
    for t in targets:
        of[t.capture] = len(t.row) + len(t.missing)
        pair = f"{t.camera} with {t.projector}: " if len(pairs) > 1 else ""
        for reasons in _alike(m.reason for m in t.missing):
            found.append(LeftOut(t.capture, len(reasons), of[t.capture], pair + _merged(reasons)))
    for station, (n, whole) in (rejected or {}).items():
        if n:
            capture, _, device = station.rpartition("/")
            found.append(LeftOut(capture or station, n, whole, f"in the {device}'s image, {why}"))
    found += [LeftOut(name, of.get(name, 0), of.get(name, 0), reason) for name, reason in captures]
    return tuple(found)


def _alike(reasons: Iterable[str]) -> list[list[str]]:
    """Put reasons together that differ in their figures only, the most frequent first."""
    groups: dict[str, list[str]] = {}
    for reason in reasons:
        groups.setdefault(NUMBER.sub("", reason), []).append(reason)
    return sorted(groups.values(), key=lambda group: -len(group))


def _merged(reasons: list[str]) -> str:
    """Give the reason with the greatest figure, as the others are up to that."""
    if len(set(reasons)) == 1:
        return reasons[0]
    most = max(reasons, key=lambda reason: [float(n) for n in NUMBER.findall(reason)])
    return NUMBER.sub(lambda figure: f"up to {figure.group()}", most, count=1)


def rejected_of(
    adjustment: Adjustment, targets: Sequence[TargetSet]
) -> tuple[dict[str, tuple[int, int]], dict[str, tuple[int, int]]]:
    """By station, observations left out of how many: gross errors, and points that nothing else sees."""
    network = adjustment.network
    points = set(network.point_names)
    count = np.bincount(network.observation_station, minlength=len(network.station_names))
    left = dict(zip(network.station_names, count.tolist(), strict=True))
    gross, lonely = {}, {}
    for t in targets:
        names = [f"{r}/{c}" for r, c in t.keys]
        camera = np.asarray(np.isfinite(t.camera_uv).all(axis=1))
        projected = np.asarray(np.isfinite(t.projector_uv).any(axis=1))
        for device, other, seen in ((t.camera, t.projector, camera), (t.projector, t.camera, camera & projected)):
            if device not in network.devices:  # a projector that only labels places
                continue
            station, of = str(StationId(t.capture, device)), int(seen.sum())
            if station not in left and (by := str(StationId(t.capture, device, other))) in left:
                station = by
            alone = sum(1 for name, s in zip(names, seen.tolist(), strict=True) if s and name not in points)
            lost = of - left.get(station, 0) - alone
            gross[station] = max(lost, 0), of
            lonely[station] = alone, of
    return gross, lonely
