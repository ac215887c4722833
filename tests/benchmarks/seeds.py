"""`python -m tests.benchmarks.seeds [--seeds N] [--keep FOLDER]`: errors over sigmas of the reference experiment.

Every stage against what the bench knows, over all seeds together: r.m.s. of error over sigma and the squared
Mahalanobis distance over its degrees of freedom, both 1 where sigmas hold. Beside them, the interval in which 95 % of
such figures would lie by chance: of as many adjustments of true places with errors drawn by the stated covariances
(`--drawn` for each seed, of all of which as many as seeds are taken at random). FOLDER keeps the simulated captures,
which take longest.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from core.bench import Experiment, experiment, true_targets, truth_maps
from core.bench.truth import TruthMaps
from core.calibrate import calibrate_photogrammetric
from core.geometry import rotation_vector_from_matrix, similarity
from core.measure import kind_of
from core.model import Adjustment, PhaseMap, PhotogrammetricCalibration, TargetSet
from core.pipeline import METHODS, CalibrateOptions, simulate_project
from core.pipeline.decode import phase_maps
from core.pipeline.folders import captures_of
from core.pipeline.methods.photogrammetric import ADJUSTMENT
from core.progress import SILENT
from core.project import read_project
from core.reconstruct import reconstruct

Array = NDArray[np.float64]

MEASURED = ("centre", "coordinate", "coordinate where read")
ADJUSTED = ("camera", "projector", "orientation", "all parameters", "points", "depth")
DRAWINGS = 400
FEW = 1000  # ratios that need wider bars
STAGES = ("centre", "coordinate", "interior", "orientation", "points", "depth")
WORDS = {
    "en": (
        "Centres of targets",
        "Their projector coordinates",
        "Interior orientations",
        "Relative orientation",
        "Points of the testfield",
        "Depths of planes",
        "error / sigma",
        "r.m.s. {:.2f}",
        ".",
    ),
    "de": (
        "Mitten der Zielmarken",
        "Ihre Projektorkoordinaten",
        "Innere Orientierungen",
        "Relative Orientierung",
        "Punkte des Testfelds",
        "Tiefen der Ebenen",
        "Fehler / Sigma",
        "RMS {:.2f}",
        ",",
    ),
}  # stages, the axis below, what each panel says, the decimal sign


@dataclass(frozen=True)
class Deviations:
    """Errors over their sigmas, any number of them, and the sum of squared Mahalanobis distances."""

    ratios: Array
    square: float
    dof: int


def of_groups(error: Array, cov: Array) -> Deviations:
    """Deviations of n small vectors (n, k) with their covariances (n, k, k); those with a NaN do not count."""
    known = np.isfinite(error).all(axis=1) & np.isfinite(cov).all(axis=(1, 2))
    error, cov = error[known], cov[known]
    square = float(np.einsum("ni,nij,nj->", error, np.linalg.inv(cov), error))
    return Deviations((error / np.sqrt(np.diagonal(cov, axis1=1, axis2=2))).ravel(), square, error.size)


def true_places(truth: Experiment, targets: TargetSet) -> tuple[Array, Array]:
    """Camera and projector coordinates (n, 2) of the targets of one set as they are."""
    true = true_targets(truth.rig, truth.shot(targets.capture).scene)
    place = {key: i for i, key in enumerate(zip(true.row.tolist(), true.col.tolist(), strict=True))}
    rows = [place[key] for key in zip(targets.row.tolist(), targets.col.tolist(), strict=True)]
    return true.camera_uv[rows], true.projector_uv[rows]


def recentred(truth: Experiment, targets: TargetSet) -> TargetSet:
    """Take the eccentricity from the true camera, as the adjustment takes it from the adjusted one."""
    shot, rig = truth.shot(targets.capture), truth.rig
    testfield = truth.testfields[shot.testfield or ""]
    correct = kind_of(testfield).recentred
    assert correct is not None
    return correct(targets, testfield, rig.camera, rig.camera_interior, shot.scene.camera_from_board)


def measured(truth: Experiment, targets: list[TargetSet]) -> dict[str, Deviations]:
    """Deviations of centres, of projector coordinates, and of these at the centres as measured."""
    parts: dict[str, list[tuple[Array, Array]]] = {name: [] for name in MEASURED}
    for each in targets:
        t = recentred(truth, each)
        camera, projector = true_places(truth, t)
        assert t.gradient is not None
        off, lines, cov = t.camera_uv - camera, t.projector_uv - projector, t.cov
        read = lines - np.einsum("nij,nj->ni", t.gradient, off)
        of_both = np.concatenate([-t.gradient, np.broadcast_to(np.eye(2), t.gradient.shape)], axis=2)
        parts["centre"].append((off, t.camera_cov))
        parts["coordinate"].append((lines, cov[:, 2:, 2:]))
        parts["coordinate where read"].append((read, of_both @ cov @ np.swapaxes(of_both, 1, 2)))
    return {name: of_groups(*map(np.concatenate, zip(*each, strict=True))) for name, each in parts.items()}


def adjusted(truth: Experiment, found: PhotogrammetricCalibration, adjustment: Adjustment) -> dict[str, Deviations]:
    """Deviations of parameters and of points, the true ones laid onto the adjusted ones."""
    rig, relative = truth.rig, found.projector_from_camera
    turned = rotation_vector_from_matrix(relative.rotation @ rig.projector_from_camera.rotation.T)
    error = np.concatenate(
        [
            found.camera.interior.vector - rig.camera_interior.vector,
            found.projector.interior.vector - rig.projector_interior.vector,
            turned,
            relative.translation_mm - rig.projector_from_camera.translation_mm,
        ]
    )
    groups = {
        "camera": slice(0, 9),
        "projector": slice(9, 18),
        "orientation": slice(18, 24),
        "all parameters": slice(0, 24),
    }
    result = {name: of_groups(error[None, own], found.covariance[None, own, own]) for name, own in groups.items()}
    board = truth.shots[0].scene.board.targets
    assert board is not None
    index = board.index()
    true = board.xyz_mm[[index[p.row, p.col] for p in adjustment.network.point_ids]]
    _, R, shift = similarity(true, adjustment.points_mm, scaled=False)
    return result | {"points": of_groups(adjustment.points_mm - true @ R.T - shift, adjustment.point_cov_mm2)}


def drawn(truth: Experiment, targets: list[TargetSet], rng: np.random.Generator) -> list[TargetSet]:
    """Give the targets as if measured with errors of the stated covariances, and with no other."""
    result = []
    for t in targets:
        camera, projector = true_places(truth, t)
        shifts = np.zeros((3, 3)) if t.row_shifts is None else t.row_shifts
        moved = rng.multivariate_normal(np.zeros(len(camera)), t.row_share, 3, method="eigh").T
        size, along = np.linalg.eigh(shifts)
        moved = np.einsum("nij,nj->ni", t.by_row, moved @ (along * np.sqrt(np.maximum(size, 0))).T)
        by_row, cov = np.diagonal(t.row_share), t.camera_cov.copy()
        cov[:, 0, 0] -= by_row * shifts[0, 0]
        off = np.einsum("nij,nj->ni", np.linalg.cholesky(cov), rng.standard_normal(camera.shape))
        assert t.gradient is not None
        by_centre = np.einsum("nij,njk,nik->ni", t.gradient, cov, t.gradient)
        in_row = np.einsum("nij,jk,nik->ni", t.by_row, shifts, t.by_row)[:, 2:]
        own = np.sqrt(np.maximum(t.projector_sigma**2 - by_centre - by_row[:, None] * in_row, 0.0))
        lines = (
            projector + np.einsum("nij,nj->ni", t.gradient, off) + moved[:, 2:] + own * rng.standard_normal(own.shape)
        )
        off += moved[:, :2]
        result.append(replace(t, camera_uv=camera + off, projector_uv=np.where(np.isfinite(own), lines, np.nan)))
    return result


def drawn_phase(phase: PhaseMap, true: TruthMaps, rng: np.random.Generator) -> PhaseMap:
    """Give a phase map as if decoded with the stated noise, and with no other error."""
    lines = [
        (place + sigma * rng.standard_normal(sigma.shape, np.float32)).astype(np.float32)
        for place, sigma in ((true.u, phase.sigma_u), (true.v, phase.sigma_v))
    ]
    return replace(phase, u=lines[0], v=lines[1])


def depths(planes: Sequence[tuple[PhaseMap, TruthMaps]], found: PhotogrammetricCalibration) -> Deviations:
    """Deviations of the depths of all planes' pixels; of their squares the mean counts, not each one."""
    squares, ratios = [], []
    for phase, true in planes:
        cloud = reconstruct(phase, found)
        assert cloud.sigma_mm is not None
        z = (cloud.xyz_mm[..., 2] - true.xyz_mm[..., 2]) / cloud.sigma_mm[..., 2]
        z = z[np.isfinite(z) & true.lit]
        squares.append(float(np.mean(np.square(z, dtype=np.float64))))
        ratios.append(z[:: len(z) // 1000])
    return Deviations(np.concatenate(ratios).astype(np.float64), float(np.sum(squares)), len(planes))


def of_seed(folder: Path, seed: int, count: int) -> tuple[dict[str, Deviations], list[dict[str, Deviations]]]:
    """What the program finds from one seed's captures, and from `count` draws of what it says of its measurements."""
    if not (folder / "project.json").exists():
        simulate_project(folder, "paper", seed)
    project, truth, method = read_project(folder), experiment("paper", seed), METHODS["photogrammetric"]
    captures = captures_of(project, "testfield")
    assert method.looks
    look = method.looks(project, captures, CalibrateOptions())
    made = method.calibrate(project, captures, CalibrateOptions(), SILENT, lambda: look.taken(project))
    found, adjustment, targets = made.calibration, made.beside[ADJUSTMENT], list(made.targets)
    assert isinstance(found, PhotogrammetricCalibration)
    assert isinstance(adjustment, Adjustment)
    planes = [
        (phase, truth_maps(truth.rig, truth.shot(capture.name).scene))
        for capture, phase in phase_maps(project, captures_of(project, "plane"))
    ]
    result = measured(truth, targets) | adjusted(truth, found, adjustment) | {"depth": depths(planes, found)}
    testfield, scale, rng = captures[0].testfield, project.scale, np.random.default_rng([seed, 3])
    board = truth.shots[0].scene.board.targets
    assert testfield is not None
    assert scale is not None
    assert board is not None
    index = board.index()
    length = float(np.linalg.norm(board.xyz_mm[index[scale.start]] - board.xyz_mm[index[scale.stop]]))
    chance = []
    for _ in range(count):
        bar = replace(scale, length_mm=length + scale.sigma_mm * rng.standard_normal())
        again, its = calibrate_photogrammetric(project.rig, testfield, drawn(truth, targets, rng), scale=bar)
        again_seen = [(drawn_phase(phase, true, rng), true) for phase, true in planes]
        chance.append(adjusted(truth, again, its) | {"depth": depths(again_seen, again)})
    return result, chance


def together(parts: list[Deviations]) -> tuple[float, float]:
    """R.m.s. of error over sigma, and squared Mahalanobis distance over its degrees of freedom."""
    ratios = np.concatenate([part.ratios for part in parts])
    return float(np.sqrt(np.mean(ratios**2))), sum(part.square for part in parts) / sum(part.dof for part in parts)


def by_chance(draws: list[dict[str, Deviations]], stage: str, seeds: int, rng: np.random.Generator) -> Array:
    """Limits (2, 2) of 95 % of both figures: as many draws as seeds, which are all of one plan, again and again."""
    figures = [together([draws[k][stage] for k in rng.integers(len(draws), size=seeds)]) for _ in range(DRAWINGS)]
    return np.asarray(np.quantile(figures, (0.025, 0.975), axis=0))


def rows(results: list[dict[str, Deviations]], draws: list[dict[str, Deviations]]) -> Iterator[str]:
    """Lines of Markdown."""
    yield "| stage | n | r.m.s. of error/σ | by chance | Mahalanobis²/dof | by chance |"
    yield "|---|---|---|---|---|---|"
    rng = np.random.default_rng(0)
    for stage in results[0]:
        parts = [result[stage] for result in results]
        ratio, square = together(parts)
        limits = [["", ""], ["", ""]]
        if stage in ADJUSTED and draws:
            limits = [[f"{value:.2f}" for value in row] for row in by_chance(draws, stage, len(results), rng)]
        cells = [f"{low}..{high}" if low else "" for low, high in zip(*limits, strict=True)]
        n = sum(part.dof for part in parts)
        yield f"| {stage} | {n} | {ratio:.3f} | {cells[0]} | {square:.3f} | {cells[1]} |"


def write_picture(path: Path, results: list[dict[str, Deviations]], words: Sequence[str]) -> None:
    """Draw how errors over sigmas are distributed in six stages, beside the normal distribution."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.2), layout="constrained", facecolor="white")
    x, edges = np.linspace(-4, 4, 161), np.linspace(-4, 4, 33)
    for axes, stage, title in zip(figure.subplots(2, 3, sharex=True, sharey=True).flat, STAGES, words, strict=False):
        parts = ("camera", "projector") if stage == "interior" else (stage,)
        ratios = np.concatenate([result[part].ratios for result in results for part in parts])
        counts = edges if len(ratios) > FEW else edges[::2]
        axes.hist(np.clip(ratios, -4, 4), counts, density=True, color="#9cc4e4")
        axes.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color="#222222", linewidth=1.2)
        axes.set_title(title, fontsize=10)
        rms = words[-2].format(np.sqrt(np.mean(ratios**2)))
        rms = rms[:-3] + words[-1] + rms[-2:]
        axes.text(0.03, 0.9, rms, transform=axes.transAxes, fontsize=8)
        axes.set(xlim=(-4, 4), yticks=[])
        axes.spines[["top", "left", "right"]].set_visible(False)
    figure.supxlabel(words[-3], fontsize=10)
    figure.savefig(path, dpi=100)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="tests.benchmarks.seeds", description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(10)))
    parser.add_argument("--drawn", type=int, default=20)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--pictures", type=Path, metavar="HELP", help="draw images/sigmas.png and de/images/sigmas.png")
    options = parser.parse_args()
    results: list[dict[str, Deviations]] = []
    draws: list[dict[str, Deviations]] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in options.seeds:
            found, more = of_seed((options.keep or Path(folder)) / str(seed), seed, options.drawn)
            results.append(found)
            draws += more
            figures = " ".join("{} {:.2f} {:.2f}".format(stage, *together([part])) for stage, part in found.items())
            print(f"seed {seed}: {figures}", flush=True)
    print(*rows(results, draws), sep="\n")
    if options.pictures:
        for language, folder in (("en", options.pictures), ("de", options.pictures / "de")):
            write_picture(folder / "images" / "sigmas.png", results, WORDS[language])


if __name__ == "__main__":
    main()
