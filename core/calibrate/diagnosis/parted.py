"""Captures that fit each other up to one of them, and again from there on: something changed between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from core.calibrate.selection import selected
from core.errors import listed
from core.model import Network

LEAST = 3  # captures of a part: fewer are told one by one


def parted(network: Network, fits: Callable[[Network], bool]) -> str:
    """Say into which parts, in their order, the captures of a network fall that do not fit as a whole.

    Its poses are numbered in the order of the captures; `fits` says whether the images of a network explain each other.
    The text is empty where there are no such parts.

    A rig that was moved once fits before and after, and each part bears the same unknowns as the whole. Parts are the
    longest that fit, the first one first, each found by halving.
    """
    network = replace(network, scale=None, lengths=())  # whose ends may be in one part alone
    pose = np.array(network.station_pose)
    order = np.unique(pose)

    def fit(start: int, stop: int) -> bool:
        stations = np.flatnonzero(np.isin(pose, order[start:stop]))
        return fits(selected(network, np.isin(network.observation_station, stations)))

    parts, start, count = [], 0, len(order)
    while start < count:
        if count - start < LEAST or not fit(start, start + LEAST):
            return ""
        good, bad = start + LEAST, count
        if start and fit(start, count):
            good = bad
        while bad - good > 1:
            middle = (good + bad) // 2
            good, bad = (middle, bad) if fit(start, middle) else (good, middle)
        parts.append(range(start, good))
        start = good
    if len(parts) < 2:
        return ""
    captures = [s.capture for s in network.station_ids] or [s.rpartition("/")[0] for s in network.station_names]
    names = dict(zip(pose.tolist(), captures, strict=True))
    told = [f"{names[int(order[part[0]])]} to {names[int(order[part[-1]])]}" for part in parts]
    return f"{listed(told)} fit by themselves, but not together"
