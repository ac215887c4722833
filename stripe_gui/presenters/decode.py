"""The maps that decoding gives, with the levels they are shown between, and what is wrong at a pixel."""

from __future__ import annotations

import numpy as np

from core.decode import Flag
from core.model import DeviceSpec, PhaseMap
from core.report import Number, Table
from stripe_gui.presenters.folder import Recent
from stripe_gui.presenters.maps import MapView, percentile, round_up
from stripe_gui.presenters.told import translate

KINDS = ("u", "v", "modulation", "sigma_u", "sigma_v", "image", "flags")


def kind_name(kind: str) -> str:
    """Give a map's name in the operator's language."""
    return {
        "u": translate("Decode", "Projector u (columns)"),
        "v": translate("Decode", "Projector v (rows)"),
        "modulation": translate("Decode", "Modulation"),
        "sigma_u": translate("Decode", "σ of u"),
        "sigma_v": translate("Decode", "σ of v"),
        "image": translate("Decode", "Evenly lit image"),
        "flags": translate("Decode", "Validity"),
    }[kind]


def kinds_of(phase: PhaseMap) -> list[str]:
    """Give the maps that a capture has: an axis without patterns has none."""
    empty = {axis for axis in ("u", "v") if not np.isfinite(getattr(phase, axis)).any()}
    return [kind for kind in KINDS if kind.removeprefix("sigma_") not in empty]


def map_view(phase: PhaseMap, kind: str, projector: DeviceSpec | None) -> MapView:
    """Choose levels that depend on the device, or are round, so that captures can be compared by eye."""
    lines = translate("Decode", "lines")
    grey = translate("Decode", "grey")
    image = getattr(phase, kind)
    if kind in ("u", "v"):
        count = (projector.width if kind == "u" else projector.height) if projector else np.nanmax(image) + 1
        return MapView(image, (0.0, float(count) - 1), "map", lines, 3)
    if kind.startswith("sigma"):
        return MapView(image, (0.0, round_up(percentile(image, 98))), "map", lines, 4)
    if kind == "flags":
        valid = (phase.flags == 0).astype(np.float32)
        return MapView(valid, (0.0, 1.0), "grey", "", 0)
    return MapView(image, (0.0, round_up(percentile(image, 99.5))), "map" if kind == "modulation" else "grey", grey, 1)


def pixel_text(phase: PhaseMap, u: int, v: int) -> str:
    """Say all that is known of a pixel: coordinates with sigma, modulation, or why it is invalid."""
    parts = []
    for name, values, sigma in (("u", phase.u, phase.sigma_u), ("v", phase.v, phase.sigma_v)):
        if np.isfinite(values[v, u]):
            parts.append(f"{name}ₚ {values[v, u]:.3f} ± {sigma[v, u]:.3f}")
    flags = int(phase.flags[v, u])
    if flags:
        parts.append(translate("Decode", "invalid: {why}").format(why=", ".join(flag_words(flags))))
    return "   ".join(parts)


def flag_words(flags: int) -> list[str]:
    """Name the reasons in a pixel's flags."""
    words = {
        Flag.LOW_MODULATION: translate("Decode", "low modulation"),
        Flag.SATURATED: translate("Decode", "saturated"),
        Flag.UNSURE: translate("Decode", "unsure"),
        Flag.DISAGREEMENT: translate("Decode", "disagreement"),
        Flag.OUTSIDE: translate("Decode", "outside"),
        Flag.BESIDE: translate("Decode", "lit from beside"),
        Flag.NO_U: translate("Decode", "no u"),
        Flag.NO_V: translate("Decode", "no v"),
    }
    return [word for flag, word in words.items() if flags & flag.value]


def figures_table(phase: PhaseMap) -> Table:
    """Sum a decoded capture up: valid shares, median sigmas, and the share of pixels for every reason not to be."""
    count = phase.u.size
    rows: list[tuple] = []
    for name, values, sigma in (("u", phase.u, phase.sigma_u), ("v", phase.v, phase.sigma_v)):
        valid = np.isfinite(values)
        if valid.any():
            share, median = 100 * np.count_nonzero(valid) / count, float(np.median(sigma[valid]))
            rows.append((translate("Decode", "{axis} valid [%]").format(axis=name), Number(share, ".2f")))
            rows.append((translate("Decode", "σ of {axis}, median [lines]").format(axis=name), Number(median, ".4f")))
    lit = np.isfinite(phase.u) | np.isfinite(phase.v)
    if lit.any():
        median = float(np.median(phase.modulation[lit]))
        rows.append((translate("Decode", "modulation, median [grey]"), Number(median, ".1f")))
    for flag in Flag:
        share = 100 * np.count_nonzero(phase.flags & flag.value) / count
        if share > 0 and flag not in (Flag.NO_U, Flag.NO_V):
            rows.append((f"{flag_words(flag.value)[0]} [%]", Number(share, ".2f")))
    return Table("", (translate("Decode", "quantity"), translate("Decode", "value")), tuple(rows), phase.notes)


def recent_phases() -> Recent[PhaseMap]:
    """Give room for the maps looked at last, 400 MB of them."""
    return Recent(400e6, _bytes)


def _bytes(phase: PhaseMap) -> int:
    maps = (phase.u, phase.v, phase.sigma_u, phase.sigma_v, phase.modulation, phase.image, phase.flags)
    return sum(m.nbytes for m in maps)
