"""`python -m tests.benchmarks.faults`: what each fault of the virtual bench does to decoded coordinates, as a table.

A plane of the reference experiment, against the truth: the lit pixels that decode, those off by more than a line in a
million, the r.m.s. error of the others beside that without any fault, and that error by its predicted sigma.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.bench import experiment, truth_maps
from core.decode import DecodeOptions, decode
from core.patterns import parse_sequence

FAULTS = (
    "",
    "response",
    "lamp-flicker",
    "room-flicker",
    "lamp-drift",
    "ambient-drift",
    "saturated",
    "blurred",
    "reflections",
    "facing-wall",
    "gloss-lobe",
    "subsurface",
    "moved",
)
SEQUENCES = {"paper": (False, True), "gray-sine": (False, True), "dense": (False,)}  # without and with --estimate
GROSS = 1.0  # lines


def rows(sequence: str, estimate: bool) -> Iterator[tuple[str, float, float, float, float]]:
    """Fault, part of the lit pixels that decode, wrong in a million, r.m.s. in lines, observed over predicted."""
    e = experiment("paper", 0, parse_sequence(sequence))
    shot = e.shot("plane+00")
    truth = truth_maps(e.rig, shot.scene)
    for name in FAULTS:
        patterns, images = zip(*e.take(shot, [name] if name else []), strict=True)
        phase = decode(patterns, images, lines=(640, 640), options=DecodeOptions(estimate=estimate))
        error = np.stack([phase.u - truth.u, phase.v - truth.v])[:, truth.lit]
        sigma = np.stack([phase.sigma_u, phase.sigma_v])[:, truth.lit]
        valid = np.isfinite(error).all(axis=0)
        if not valid.any():
            yield name, 0.0, np.nan, np.nan, np.nan
            continue
        error, sigma = error[:, valid], sigma[:, valid]
        fine = np.abs(error).max(axis=0) < GROSS
        error, sigma = error[:, fine], sigma[:, fine]
        rms, ratio = (float(np.sqrt(np.mean(np.square(each)))) for each in (error, error / sigma))
        yield name or "none", float(valid.mean()), 1e6 * float(1 - fine.mean()), rms, ratio


def main() -> None:
    """Print the table."""
    print("| sequence | fault | valid | wrong per million | r.m.s. / without | observed / predicted |")
    print("|---|---|---|---|---|---|")
    for sequence, ways in SEQUENCES.items():
        for estimate in ways:
            floor = np.nan
            for name, valid, wrong, rms, ratio in rows(sequence, estimate):
                floor = rms if name == "none" else floor
                shown = f"{rms:.4f} lines" if name == "none" else f"{rms / floor:.2f}"
                label = f"{sequence}{', --estimate' if estimate else ''}"
                print(f"| {label} | {name} | {valid:.4f} | {wrong:.0f} | {shown} | {ratio:.2f} |", flush=True)


if __name__ == "__main__":
    main()
