"""The tables of the report as plain numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from core.digits import fixed
from core.geometry import (
    LENSES,
    at_radius,
    held_axes,
    lens_of,
    orientation_variances,
    pair_of,
    rotation_vector_from_matrix,
)
from core.model import AdjustedDevice, Array, DepthCalibration, DriftPoint, Interior, PlaneEvaluation, Registration
from core.report.data import CalibratedDevice, ReportData, calibrated_devices, side_by_side
from core.report.published import Published, published_names, read_published
from core.report.table import Cell, Number, Table

# of the control chart: name, unit, and the unit's factor
DRIFT_ELEMENTS = (*((f"turn {axis}", "µrad", 1e6) for axis in "XYZ"), *((f"shift {k}", "µm", 1e3) for k in (1, 2)))


def published_of(data: ReportData) -> Published | None:
    """Give the published results beside which the report sets its own, if the project names any that are known."""
    name = data.project.reference
    return read_published(name) if name in published_names() else None


def interior_tables(data: ReportData, published: Published | None) -> list[Table]:
    """Table 1: interior orientation and additional parameters, one table per device."""
    devices = calibrated_devices(data)
    letters = "abcdefghijklmnopqrstuvwxyz" if len(devices) > 1 else " "
    return [
        _interior_table(f"Table 1{letter.strip()}", device, published, true_parameters(data.truth, device))
        for letter, device in zip(letters, devices, strict=False)
    ]


def true_parameters(truth: Mapping[str, Any] | None, device: CalibratedDevice) -> np.ndarray | None:
    """True parameters, shape (k,), referred to the r0 of the adjusted device; None where not known."""
    entry = (truth or {}).get(device.kind or "") or (truth or {}).get(device.name)
    if not isinstance(entry, Mapping):
        return None
    interior = _interior_of(entry)
    if interior.model != device.device.interior.model:
        return None
    if np.isfinite(interior.r0_mm) and np.all(np.isfinite(interior.vector)):
        interior = at_radius(interior, device.device.interior.r0_mm)
    return interior.vector


def _interior_of(entry: Mapping[str, Any]) -> Interior:
    """Read an interior orientation as result files have it; what is absent is NaN."""

    def number(key: str) -> float:
        value = entry.get(key)
        value = value.get("value") if isinstance(value, Mapping) else value
        return float("nan") if value is None else float(value)

    lens = LENSES[entry.get("model", "A1..A6")]
    return Interior.from_vector(np.array([number(key) for key in lens.keys]), number("r0_mm"), lens.name)


def normalised_errors(device: AdjustedDevice, truth: np.ndarray) -> np.ndarray:
    """(value - true) / sigma of the parameters, NaN where a parameter was held fixed or its truth is not known."""
    sigma = np.where(device.sigma > 0, device.sigma, np.nan)
    return np.asarray((device.interior.vector - truth) / sigma)


def _interior_table(
    number: str, calibrated: CalibratedDevice, published: Published | None, truth: np.ndarray | None
) -> Table:
    device, lens = calibrated.device, lens_of(calibrated.device.interior)
    columns = ["parameter", "value", "σ", *(["published"] if published else [])]
    columns += ["true", "(value - true)/σ"] if truth is not None else []
    errors = normalised_errors(device, truth) if truth is not None else np.full(len(lens.names), np.nan)
    rows: list[tuple[Cell, ...]] = []
    for i, (name, unit) in enumerate(zip(lens.names, lens.units, strict=True)):
        spec, sigma_spec = (".6f", ".6f") if i < 3 else ("E6", "E2")
        sigma = "held fixed" if device.sigma[i] == 0 else Number(float(device.sigma[i]), sigma_spec)
        row: list[Cell] = [f"{name} [{unit}]" if unit else name]
        row += [Number(float(device.interior.vector[i]), spec), sigma]
        if published:
            row.append(_known(published.parameter(calibrated.kind, lens.keys[i]), spec))
        if truth is not None:
            row += [_known(float(truth[i]), spec), _known(float(errors[i]), "+.2f")]
        rows.append(tuple(row))
    notes = []
    if lens.referred is not None:
        rows.append(("r0 [mm]", Number(device.interior.r0_mm, ".6f"), *[None] * (len(columns) - 2)))
        central = at_radius(device.interior, 0.0).c_mm
        notes.append(
            f"c holds for the radius r0 at which the radial terms vanish; referred to r0 = 0 it is {central:.6f} mm."
        )
    if published:
        notes.append(f"Published: {published.name}; its sigmas and its r0 are not known here.")
    if truth is not None:
        notes.append("The true values are those of the simulated device, referred to the same r0.")
    title = f"{number}. Interior orientation and additional parameters of {calibrated.phrase}"
    return Table(title, tuple(columns), tuple(rows), tuple(notes))


def adjustment_table(data: ReportData, published: Published | None) -> Table:
    """Table 2: the bundle adjustment, and the relative orientation of projector and camera."""
    p = published or Published("", "")
    rows: list[tuple[Cell, ...]] = []

    def add(name: str, unit: str, value: Cell, known: Cell = None) -> None:
        rows.append((name, unit, value, known) if published else (name, unit, value))

    counts = network_counts(data)
    add("stations", "", _count(counts["stations"]), _count(p.stations))
    add("image points", "", _count(counts["image_points"]), _count(p.image_points))
    add("object points", "", _count(counts["object_points"]))
    add("redundancy", "", _count(counts["redundancy"]))
    add("σ0 (unit weight)", "", Number(counts["sigma0"], ".4f"))
    if data.adjustment is not None:
        add("iterations", "", _count(data.adjustment.iterations))
    for d in calibrated_devices(data):
        for axis, name in enumerate("xy"):
            known, rms = _known(p.residual_um(d.kind, axis), ".2f"), d.device.residual_rms_um[axis]
            add(f"residuals {d.name} {name}, r.m.s.", "µm", Number(rms, ".2f") if rms > 0 else "not observed", known)
    for axis, value in enumerate(object_sigmas_um(data)):
        known = None if p.object_sigma_rms_um is None else Number(p.object_sigma_rms_um[axis], ".1f")
        add(f"σ of object points {'XYZ'[axis]}, r.m.s.", "µm", Number(value, ".1f"), known)
    if data.adjustment is not None:
        for name, factor in data.adjustment.variance_factors.items():
            add(f"variance factor {name}", "", Number(factor, ".3f"))
    for name, unit, number in _relative_orientation(data):
        add(name, unit, number)
    columns = ("quantity", "unit", "this adjustment", *(["published"] if published else []))
    notes = (*_held_places(data), *([f"Published: {published.name}."] if published else []))
    return Table("Table 2. The bundle adjustment", columns, tuple(rows), notes)


def _held_places(data: ReportData) -> Iterable[str]:
    """What of the devices' places was held: a projector whose columns only were coded knows no other."""
    if data.photogrammetric is None:
        return
    for name, known in data.photogrammetric.orientations.items():
        for axis in held_axes(known.device_from_base, orientation_variances(data.photogrammetric, name)):
            yield f"The place of {name} against {known.base} along {name}'s {axis} axis was not observed: held at 0."


def volume_table(figures: Mapping[str, Any]) -> Table:
    """How sure a calibration is, over the working volume."""
    names = {"sigma_mm": "F3", "form_sigma_mm": "F4", "camera_px": ".4f", "projector_lines": ".4f"}
    rows: list[tuple[Cell, ...]] = [
        (f"{fixed(row['depth_mm'], 0)} mm away", *(Number(row[name], digits) for name, digits in names.items()))
        for row in figures["depths"]
    ]
    columns = ("depth", "σ of a point [mm]", "of form [mm]", "of the camera's image [px]", "of the projector's [lines]")
    notes: tuple[str, ...] = (
        "r.m.s. over the image, by the calibration alone; form: after the best movement of all points as one, images: "
        "after the best place of the device.",
    )
    if "camera" in figures:
        notes += (
            f"Of {figures['camera']} with {figures['projector']}; `stripe-core uncertainty` tells of the others.",
        )
    return Table("Uncertainty over the working volume", columns, tuple(rows), notes)


def network_counts(data: ReportData) -> dict[str, Any]:
    """Stations, image points, object points, redundancy and sigma0, from whichever result is there."""
    keys = ("stations", "image_points", "object_points", "redundancy", "sigma0")
    if data.photogrammetric is not None:
        return {key: getattr(data.photogrammetric, key) for key in keys}
    a = data.adjustment
    if a is None:
        return dict.fromkeys(keys)
    network = a.network
    observed = len(np.unique(network.observation_point))
    values = (len(network.station_names), len(network.observation_uv), observed, a.redundancy, a.sigma0)
    return dict(zip(keys, values, strict=True))


def object_sigmas_um(data: ReportData) -> tuple[float, ...]:
    """Root mean square of the object points' sigmas in X, Y, Z, µm; points without a covariance do not count."""
    if data.photogrammetric is not None:
        return data.photogrammetric.object_sigma_rms_um
    if data.adjustment is None:
        return ()
    variances = np.diagonal(data.adjustment.point_cov_mm2, axis1=1, axis2=2)
    variances = variances[np.all(np.isfinite(variances), axis=1)]
    if not len(variances):
        return ()
    return tuple(float(s) for s in 1000 * np.sqrt(variances.mean(axis=0)))


def _relative_orientation(data: ReportData) -> Iterable[tuple[str, str, Number]]:
    """Base and convergence of projector and camera, the base with its sigma."""
    if data.photogrammetric is None:
        return
    found = data.photogrammetric
    several = len(found.devices) > 2 or not found.projectors
    for camera in found.cameras if found.projectors else found.cameras[:1]:
        for projector in found.projectors or found.cameras[1:]:
            pair, of = pair_of(found, camera, projector), f" {camera} to {projector}"
            t = pair.projector_from_camera.translation_mm
            base = float(np.linalg.norm(t))
            yield f"base{of}" if several else "base camera to projector", "mm", Number(base, "F3")
            if base > 0:
                sigma = float(np.sqrt(abs(t @ pair.covariance[-3:, -3:] @ t))) / base
                yield f"σ of the base{of if several else ''}", "mm", Number(sigma, "F4")
            cosine = min(max(float(pair.projector_from_camera.rotation[2, 2]), -1.0), 1.0)
            name = f"angle of the viewing axes{of}" if several else "angle between the viewing axes"
            yield name, "°", Number(float(np.degrees(np.arccos(cosine))), ".3f")


def drift_table(chart: Sequence[DriftPoint]) -> Table:
    """What every capture shows of the rig, less what those before it led to expect."""
    rows: list[tuple[Cell, ...]] = []
    for point in chart:
        scaled = zip(DRIFT_ELEMENTS, point.value - point.expected, strict=True)
        numbers = [Number(scale * float(off), ".1f") for (_, _, scale), off in scaled]
        rows.append((point.capture, *numbers, Number(point.p, ".2g"), point.state))
    names = [f"{name} [{unit}]" for name, unit, _ in DRIFT_ELEMENTS]
    title = f"Control chart: {chart[0].projector} against {chart[0].camera}"
    notes = (
        "What a capture shows less what those before it led to expect; the shifts are across the base. "
        "warning: p below 0.05; action: below 0.001, the share of false alarms of a rig at rest.",
    )
    return Table(title, ("capture", *names, "p", "state"), tuple(rows), notes)


def merged_table(registration: Registration, sigmas: Array) -> Table:
    """How the rig stood in captures of one object that were merged."""
    first, rows = registration.captures[0], list[tuple[Cell, ...]]()
    posed = zip(registration.captures[1:], registration.poses[1:], sigmas, strict=True)
    for name, pose, sigma in posed:
        turn = np.degrees(np.linalg.norm(rotation_vector_from_matrix(pose.rotation)))
        own = [o for o in registration.overlaps if name in o.captures]
        counts: list[Cell] = [str(sum(o.number for o in own if o.kind == kind)) for kind in ("targets", "places")]
        spread = 1e3 * float(np.linalg.norm(sigma[:3])), float(np.linalg.norm(sigma[3:]))
        numbers = (Number(float(turn), ".2f"), Number(spread[0], ".3f"), Number(spread[1], ".3f"))
        rows.append((name, *numbers, *counts, Number(max(o.misfit for o in own), ".2f")))
    columns = ("capture", "turned [°]", "σ turn [mrad]", "σ shift [mm]", "targets", "places", "misfit")
    note = (
        "Targets and places of the surface in common with the others. Misfit: the largest of what remains between two "
        "captures, over its standard deviation by noise. σ: of all three elements, with the calibration's part."
    )
    return Table(f"Captures merged with {first}", columns, tuple(rows), (note,))


def response_table(projector: str, curves: Mapping[str, Array]) -> Table:
    """How much light the projector makes of three levels, as every capture shows it."""
    levels = (0.25, 0.5, 0.75)
    rows: list[tuple[Cell, ...]] = []
    for capture, curve in curves.items():
        light = np.interp(levels, *curve.T)
        power = np.log(max(float(light[1]), 1e-6)) / np.log(0.5)
        rows.append((capture, *(Number(float(each), ".3f") for each in light), Number(float(power), ".2f")))
    columns = ("capture", *(f"light at level {level:g}" for level in levels), "power")
    note = (
        "Light as a part of that at full level. Power: of the power law that makes as much light at level 0.5. "
        "Fringes of one period do not tell the curve from an unusual blur: at a blur of 1.5 lines and a period of 16, "
        "light at level 0.5 is 0.05 too large, though phases are straightened as well. Several periods tell both."
    )
    return Table(f"Response of {projector}", columns, tuple(rows), (note,))


def _rule(evaluation: PlaneEvaluation) -> str:
    """Why pixels were excluded, without their number where there is one reason: that stands in the table."""
    return evaluation.excluded_rule.removeprefix(f"{evaluation.excluded} ")


def _not_judged(evaluations: tuple[PlaneEvaluation, ...]) -> list[tuple[str, list[str]]]:
    """Planes that other methods judged by the same devices, by method."""
    judged = {(e.capture, e.devices, e.method) for e in evaluations}
    missing: dict[str, list[str]] = {}
    for method, devices in dict.fromkeys((e.method, e.devices) for e in evaluations):
        for capture in dict.fromkeys(e.capture for e in evaluations if e.devices == devices):
            if (capture, devices, method) not in judged:
                missing.setdefault(method, []).append(capture)
    return [*missing.items()]


def plane_table(evaluations: tuple[PlaneEvaluation, ...], published: Published | None) -> Table:
    """Table 3: deviations from the fitted plane, one row per capture and method."""
    rules = list(dict.fromkeys(_rule(e) for e in evaluations if e.excluded))
    marks = {rule: chr(ord("a") + i) if i < 26 else str(i + 1) for i, rule in enumerate(rules)}

    several = len({e.devices for e in evaluations}) > 1
    rows = []
    for e in side_by_side(evaluations):
        row: list[Cell] = [
            e.capture,
            *([" and ".join(e.devices)] if several else []),
            _known(e.angle_deg, "g"),
            e.method,
            _count(e.n),
            Number(e.excluded, "d", marks[_rule(e)] if e.excluded else ""),
            Number(e.rms_mm, "F4"),
            Number(e.max_mm, "F3"),
            Number(e.min_mm, "F3"),
            _known(e.predicted_rms_mm, "F4"),
        ]
        if published:
            row.append(_known(published.plane_rms_mm(e.method, e.angle_deg), ".3f"))
        rows.append(tuple(row))
    columns = ["capture", *(["devices"] if several else [])]
    columns += ["angle [°]", "method", "pixels", "excluded", "r.m.s. [mm]", "max |d| [mm]", "min d [mm]"]
    columns += ["predicted [mm]", *(["published [mm]"] if published else [])]
    notes = ["d: deviation from the fitted plane; max |d| its largest magnitude, min d the most negative one."]
    notes += [f"({mark}) excluded: {rule or 'no rule given'}" for rule, mark in marks.items()]
    notes += [
        f"Not judged by {method}, which has no points there: {', '.join(of)}."
        for method, of in _not_judged(evaluations)
    ]
    if not rules:
        notes.append("No pixel that the decoder called valid was excluded.")
    if published:
        most = published.max_mm
        span = "" if most is None else f"; the maxima there are {most[0]:.2f} to {most[1]:.2f} mm"
        notes.append(f"Published: r.m.s. of {published.name}{span}.")
    return Table("Table 3. Deviations from the plane-table", tuple(columns), tuple(rows), tuple(notes))


def depth_table(d: DepthCalibration) -> Table:
    """The depth calibration, which the three tables of the published experiment do not show."""

    pixels = d.camera_spec.width * d.camera_spec.height
    shape = "linear table" if d.degree is None else f"polynomial of degree {d.degree}"
    rows: tuple[tuple[Cell, ...], ...] = (
        ("depth as a function of", "", f"{d.axis}, {shape} per pixel"),
        ("plate positions", "", str(len(d.depths_mm))),
        ("least depth", "mm", fixed(d.depths_mm.min(), 3) if len(d.depths_mm) else None),
        ("greatest depth", "mm", fixed(d.depths_mm.max(), 3) if len(d.depths_mm) else None),
        ("calibrated pixels", "", f"{d.valid_pixels} of {pixels}"),
        ("residuals in depth, r.m.s.", "mm", fixed(d.residual_rms_mm, 4)),
    )
    if d.covariance is not None:
        sigma = fixed(float(d.covariance[0, 0]) ** 0.5, 3)
        c = f"{d.camera.c_mm:.{len(sigma.partition('.')[2])}f}"
        rows += (("c of the camera", "mm", f"{c} ± {sigma}, nominal {d.camera_spec.nominal_c_mm:g}"),)
    return Table("Depth per pixel, from the positions of the plate", ("quantity", "unit", "value"), rows)


def _known(value: float | None, spec: str) -> Number | None:
    return None if value is None or not np.isfinite(value) else Number(float(value), spec)


def _count(value: int | None) -> Number | None:
    return None if value is None else Number(int(value), "d")
