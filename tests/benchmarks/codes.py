"""`python -m tests.benchmarks.codes [N]`: codes without phases, decoded with and without `--estimate`, as a table.

N random captures (120 unless told) by a renderer of its own: Gray and binary code, cells of one to 32 lines, with and
without inverse and even frames, blurred projection, cameras with a gamma and a point spread, dots, texture and steps of
depth. Held against the truth: the part of the pixels that decode, the r.m.s. error (lines) of the median capture, its
error over predicted sigma, the part of all that is off by more than 5 sigma, and the seed of the capture with most.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation, gaussian_filter, gaussian_filter1d

from core.decode import DecodeOptions, decode
from core.model import Array
from core.patterns import Black, Code, Pattern, White, brightness, gray_and_phase

HEIGHT, WIDTH, OVER, FINE = 240, 320, 3, 16  # pixels, places in a pixel along an axis, places in a line


def scene(rng: np.random.Generator, lines: int) -> tuple[Array, Array]:
    """Projector columns and reflectance at places all over the image, `OVER` in a pixel along each axis."""
    y, x = np.mgrid[: HEIGHT * OVER, : WIDTH * OVER] / OVER
    scale = min(float(np.exp(rng.uniform(np.log(0.15), np.log(6)))), 0.77 * lines / WIDTH)  # lines a pixel
    first, angle = rng.uniform(2, lines - 1.15 * scale * WIDTH), rng.uniform(-0.3, 0.3)
    u = first + scale * (x * np.cos(angle) + (y if angle > 0 else y - HEIGHT) * np.sin(angle))
    u += rng.uniform(0, 3) * scale * np.sin(y / 13) + (x > 0.6 * WIDTH) * rng.choice([0, 0, 0.1]) * scale * WIDTH
    dots = np.where((x % 14 - 7) ** 2 + (y % 14 - 7) ** 2 < 16, 1, 0.15)
    rough = np.clip(1 + 5 * gaussian_filter(rng.normal(size=u.shape), 4), 0.1, 2)
    look = [np.ones_like(u), dots, rough][rng.integers(3)]
    return np.clip(u, 1, lines - 2), look * (1 - ((x - WIDTH / 2) ** 2 + (y - HEIGHT / 2) ** 2) / WIDTH**2)


def capture(seed: int) -> tuple[list[Pattern], list[Array], int, Array]:
    """Patterns, images, number of lines, and the columns that pixels see; NaN beside steps of depth."""
    rng = np.random.default_rng(seed)
    lines, cell = int(rng.choice([64, 128, 256, 640, 1024, 1920])), int(rng.choice([1, 1, 1, 1, 2, 4, 8, 16, 32]))
    inverse = bool(rng.random() < 0.5)
    codes = [p for p in gray_and_phase("x", lines, cell=cell, periods=[], inverse=inverse) if isinstance(p, Code)]
    if rng.random() < 0.25:
        codes = [replace(p, kind="binary") for p in codes]
    even = [White(), Black()] if not inverse or rng.random() < 0.7 else []
    u, look = scene(rng, lines)
    blur, spread = float(np.exp(rng.uniform(np.log(0.2), np.log(6)))), rng.uniform(0.8, 2.2)
    gain, ambient, noise = rng.choice([30, 80, 180]), rng.uniform(2, 40), rng.uniform(0.5, 3)
    gamma = rng.choice([1, 1, 1, 0.45, 0.6, 1.6, 2.2])
    places, images = (np.arange(lines * FINE) - (FINE - 1) / 2) / FINE, []
    for pattern in (*even, *codes):
        light = gaussian_filter1d(np.repeat(brightness(pattern, np.arange(lines)), FINE), blur * FINE, mode="nearest")
        seen = gaussian_filter(look * (ambient + gain * np.interp(u, places, light)), spread)
        images.append(seen.reshape(HEIGHT, OVER, WIDTH, OVER).mean(axis=(1, 3)))
    full = max(200, 1.05 * max(image.max() for image in images))
    grey = [255 * (image / full) ** gamma + rng.normal(0, noise, image.shape) for image in images]
    within = u.reshape(HEIGHT, OVER, WIDTH, OVER)
    apart = np.ptp(within, axis=(1, 3))
    beside = binary_dilation(apart > 2 * np.median(apart), iterations=4)
    truth = np.where(beside, np.nan, within[:, OVER // 2, :, OVER // 2])
    return [*even, *codes], [np.clip(np.rint(each), 0, 255).astype(np.uint8) for each in grey], lines, truth


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 120
    rows: dict[tuple[str, str, str], list[tuple[float, float, float, float, int]]] = {}
    for seed in range(count):
        patterns, images, lines, truth = capture(seed)
        code = patterns[-1]
        assert isinstance(code, Code)
        of = "one line" if code.cell == 1 else "more lines"
        for estimate in (False, True):
            phase = decode(patterns, images, lines=(lines, 1), options=DecodeOptions(estimate=estimate))
            error, told = phase.u - truth, np.isfinite(truth)
            known = np.isfinite(error)
            over = error[known] / phase.sigma_u[known]
            part = float(known.sum() / told.sum())
            rms, ratio = (float(np.sqrt(np.mean(each**2))) if part else np.nan for each in (error[known], over))
            far = float(np.mean(np.abs(over) > 5)) if part else 0.0
            kind = f"{code.kind}{', inverse' if code.inverse else ''}"
            rows.setdefault((kind, of, "yes" if estimate else "no"), []).append((part, rms, ratio, far, seed))
    print("| code | cells of | --estimate | captures | valid | r.m.s. | error / sigma | beyond 5 sigma | most in |")
    print("|---|---|---|---|---|---|---|---|---|")
    for key, found in sorted(rows.items()):
        parts, rms, ratios, far, seeds = np.array(found).T
        middle = f"{np.nanmedian(rms):.3f} | {np.nanmedian(ratios):.2f}"
        worst = f"{seeds[np.argmax(far)]:.0f} ({far.max():.2%})"
        print(f"| {' | '.join(key)} | {len(found)} | {parts.mean():.0%} | {middle} | {far.mean():.3%} | {worst} |")


if __name__ == "__main__":
    main()
