"""The summary: what was measured, in sentences with the figures in them, what was warned of and what is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.digits import fixed
from core.lazy import dataclass
from core.model import Method, PlaneEvaluation, Verdict
from core.report.data import (
    ReportData,
    calibrated_devices,
    captures_in_order,
    finite_deviations,
    methods_in_order,
    plane_name,
    verdicts_of,
    warnings_of,
)
from core.report.numbers import network_counts, normalised_errors, object_sigmas_um, published_of, true_parameters
from core.report.published import Published
from core.report.sign_off import sign_off_sentence
from core.report.table import Number


@dataclass(frozen=True)
class Summary:
    """The sentences at the head of the report."""

    verdicts: tuple[tuple[str, Verdict], ...]
    findings: tuple[str, ...]
    warnings: tuple[str, ...]
    missing: tuple[str, ...]
    passed: tuple[str, ...]  # what passed, a plane of several rows once if all of them did


@dataclass(frozen=True)
class Highlight:
    """One figure to be read first, its unit within it, and what to compare it with."""

    label: str
    value: str
    context: str


def highlights(data: ReportData) -> tuple[Highlight, ...]:
    """Give the few figures to be read first: the plane-table by each method, residuals, object points."""
    published, result = published_of(data), []
    for method in methods_in_order(data.evaluations):
        own = _measured(data.evaluations, method)
        if not own:
            continue
        known = _published_rms(own, published)
        context = (
            f"published {_span(known)} mm" if known else f"largest deviation {fixed(max(e.max_mm for e in own), 3)} mm"
        )
        result.append(Highlight(f"plane-table, {method}, r.m.s.", f"{_span([e.rms_mm for e in own])} mm", context))
    for d in calibrated_devices(data):
        x, y = d.device.residual_rms_um
        pair = [published.residual_um(d.kind, axis) for axis in (0, 1)] if published else []
        told = " and ".join(f"{value:.2f}" for value in pair if value is not None)
        context = f"x and y, published {told} µm" if told else "x and y"
        result.append(Highlight(f"residuals of {d.phrase}, r.m.s.", f"{_digits(x, 2)} and {_digits(y, 2)} µm", context))
    if data.adjustment is not None or data.photogrammetric is not None:
        n = network_counts(data)
        result.append(Highlight("σ0 of the adjustment", _digits(n["sigma0"], 3), f"redundancy {n['redundancy']}"))
    if data.depth is not None:
        count = _plural(len(data.depth.depths_mm), "plate position")
        result.append(Highlight("depth calibration, r.m.s.", f"{fixed(data.depth.residual_rms_mm, 4)} mm", count))
    return tuple(result)


def summary(data: ReportData) -> Summary:
    """Sum the report up in sentences."""
    published = published_of(data)
    findings = [*_adjustment_findings(data), *_truth_findings(data), *_depth_findings(data)]
    for method in methods_in_order(data.evaluations):
        findings.append(_plane_finding(method, data.evaluations, published))
    findings += _exclusion_findings(data.evaluations)
    if data.sign_off is not None:
        findings.insert(0, sign_off_sentence(data.sign_off, data.evaluations))
    warnings = tuple(f"{source[0].upper()}{source[1:]}: {text}" for source, text in warnings_of(data))
    outdated = tuple(f"Made from something else than the project holds now: {text}" for text in data.outdated)
    return Summary(
        tuple(verdicts_of(data)), tuple(findings), (*outdated, *warnings), tuple(_missing(data)), _passed(data)
    )


def _passed(data: ReportData) -> tuple[str, ...]:
    own = verdicts_of(replace(data, evaluations=()))
    found = [name for name, verdict in own if verdict.state == "passed"]
    planes: dict[tuple[str, Method], list[PlaneEvaluation]] = {}
    for e in data.evaluations:
        planes.setdefault((e.capture, e.method), []).append(e)
    for (capture, method), rows in planes.items():
        good = [e for e in rows if e.verdict is not None and e.verdict.state == "passed"]
        if len(good) == len(rows) > 1:
            found.append(f"{capture}, all {len(rows)} rows of Table 3, {method}")
        else:
            found += [f"{plane_name(e, data.evaluations)}, {e.method}" for e in good]
    return tuple(found)


def _adjustment_findings(data: ReportData) -> list[str]:
    if data.adjustment is None and data.photogrammetric is None:
        return []
    n = network_counts(data)
    steps = f" in {_plural(data.adjustment.iterations, 'iteration')}" if data.adjustment is not None else ""
    findings = [
        f"The bundle adjustment fits {_plural(n['image_points'], 'image point')} of "
        f"{_plural(n['stations'], 'station')} to {_plural(n['object_points'], 'object point')}{steps}: "
        f"σ0 = {_digits(n['sigma0'], 3)} at a redundancy of {n['redundancy']}."
    ]

    residuals = []
    for d in calibrated_devices(data):
        x, y = d.device.residual_rms_um
        residuals.append(f"{_digits(x, 2)} and {_digits(y, 2)} µm (x and y) in the image of {d.phrase}")
    if residuals:
        findings.append(f"The residuals are {_listed(residuals)}, r.m.s.")
    sigmas = object_sigmas_um(data)
    if sigmas:
        told = _listed([_digits(s, 1) for s in sigmas])
        findings.append(f"The object points' σ is {told} µm in X, Y and Z, r.m.s.")
    return findings


def _truth_findings(data: ReportData) -> list[str]:
    found = []
    for d in calibrated_devices(data):
        truth = true_parameters(data.truth, d)
        if truth is not None:
            found.append(normalised_errors(d.device, truth))
    errors = np.concatenate(found) if found else np.zeros(0)
    errors = errors[np.isfinite(errors)]
    if not len(errors):
        return []
    within = int(np.sum(np.abs(errors) <= 3))
    return [
        f"Against the simulated truth, {within} of {len(errors)} parameters of interior orientation lie within 3σ; "
        f"their errors divided by σ have an r.m.s. of {np.sqrt(np.mean(errors**2)):.2f} (1 is expected)."
    ]


def _depth_findings(data: ReportData) -> list[str]:
    d = data.depth
    if d is None:
        return []
    shape = "a linear table" if d.degree is None else f"a polynomial of degree {d.degree}"
    share = d.valid_pixels / max(1, d.camera_spec.width * d.camera_spec.height)
    span = f" from {d.depths_mm.min():g} to {d.depths_mm.max():g} mm" if len(d.depths_mm) else ""
    return [
        f"The depth calibration fits {shape} per pixel to {_plural(len(d.depths_mm), 'plate position')}{span} with "
        f"residuals of {fixed(d.residual_rms_mm, 4)} mm r.m.s.; it covers {share:.0%} of the image."
    ]


def _plane_finding(method: Method, evaluations: tuple[PlaneEvaluation, ...], published: Published | None) -> str:
    own = _measured(evaluations, method)
    if not own:
        return f"Plane-table, {method} method: no pixel could be evaluated."
    largest = max(own, key=lambda e: e.max_mm)
    text = (
        f"Plane-table, {method} method: {_span([e.rms_mm for e in own])} mm r.m.s. from the fitted plane over "
        f"{_plural(len({e.capture for e in own}), 'position')}"
    )
    known = _published_rms(own, published)
    if known:
        text += f" (published for these angles: {_span(known)} mm)"
    text += f"; the largest deviation is {fixed(largest.max_mm, 3)} mm, in {plane_name(largest, evaluations)}."
    ratios = [e.rms_mm / e.predicted_rms_mm for e in own if e.predicted_rms_mm]
    if ratios:
        text += f" That is {_span(ratios, 2)} times what the noise of the phases predicts"
        told = all(e.verdict is not None for e in own)
        sound = told and all(e.verdict.state == "passed" for e in own if e.verdict is not None)
        # variances add, so at √2 times the prediction all other errors together equal the noise
        if sound and max(ratios) < np.sqrt(2):
            rest = "; the sigmas of the calibration explain the rest."
            text += ": noise dominates." if all(e.noisy for e in own) else rest
        else:
            text += ": other errors exceed the noise, see the maps." if told or max(ratios) >= np.sqrt(2) else "."
    forms = [e.form_pv_um for e in own if e.form_pv_um is not None]
    if forms:
        text += f" The form left in the low-passed maps is {_span(forms, 0)} µm from peak to valley."
    return text


def _exclusion_findings(evaluations: tuple[PlaneEvaluation, ...]) -> list[str]:
    excluded = sum(e.excluded for e in evaluations)
    if not evaluations:
        return []
    if not excluded:
        return ["No pixel that the decoder called valid was left out of these figures."]
    total = sum(e.n for e in evaluations) + excluded
    return [f"{excluded} of {total} valid pixels were left out of these figures, by the rules below Table 3."]


def _missing(data: ReportData) -> list[str]:
    missing = []
    if data.adjustment is None and data.photogrammetric is None:
        missing.append("There is no photogrammetric calibration: Tables 1 and 2 and their figures are left out.")
    elif data.adjustment is None:
        missing.append(
            "The adjustment itself was not kept: residual vectors, coverage, network and convergence are left out."
        )
    if data.depth is None:
        missing.append("There is no polynomial depth calibration.")
    if not data.evaluations:
        missing.append("No plane was evaluated: Table 3, deviation maps and histograms are left out.")
    elif not all(len(finite_deviations(e)) for e in data.evaluations):
        missing.append("Some planes come without a map of their deviations: those maps and histograms stay empty.")
    if data.evaluations:
        missing += _missing_pairs(data.evaluations)
    return missing


def _missing_pairs(evaluations: tuple[PlaneEvaluation, ...]) -> list[str]:
    done = {(e.capture, e.method) for e in evaluations}
    return [
        f"{capture} was not evaluated by the {method} method."
        for capture, _ in captures_in_order(evaluations)
        for method in methods_in_order(evaluations)
        if (capture, method) not in done
    ]


def _measured(evaluations: tuple[PlaneEvaluation, ...], method: Method) -> list[PlaneEvaluation]:
    return [e for e in evaluations if e.method == method and e.n > 0 and np.isfinite(e.rms_mm)]


def _published_rms(evaluations: list[PlaneEvaluation], published: Published | None) -> list[float]:
    if published is None:
        return []
    known = (published.plane_rms_mm(e.method, e.angle_deg) for e in evaluations)
    return [rms for rms in known if rms is not None]


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _digits(value: float, digits: int) -> str:
    """Give a figure with so many decimals, or a dash where there is none."""
    return Number(value, f".{digits}f").text


def _span(values: list[float], digits: int = 3) -> str:
    low, high = fixed(min(values), digits), fixed(max(values), digits)
    return low if low == high else f"{low} to {high}"


def _listed(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
