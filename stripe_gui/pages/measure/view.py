"""What the picking page shows of an image: marks in px, targets with their reasons, and what Enter does next."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import field
from enum import Enum

import numpy as np

from core.errors import InputError
from core.lazy import dataclass
from core.measure import kind_of, measured_view, predicted_view
from core.measure.identity.view import View
from core.model import Array, DeviceSpec, TargetSet
from core.report import Number, Table
from core.report.table import Cell
from stripe_gui.pages.measure.model import Measurement, Picking, Target
from stripe_gui.presenters.maps import round_factor
from stripe_gui.presenters.told import sentence, told, translate

NOTHING = np.zeros((0, 2))
NO_VALUES: tuple[Cell, ...] = (None,) * 5
CORNER = 0.3  # of a square's side, circle about its corner
VECTOR_SHARE = 1 / 40  # of the image's width that an average residual vector covers


def _nothing() -> Array:
    return NOTHING


class NextStep(Enum):
    """What Enter does."""

    PICK = "pick"
    GUESS = "guess"
    ACCEPT = "accept"
    NEXT = "next"
    DONE = "done"


@dataclass(frozen=True)
class Marks:
    """What lies over the image; all arrays (n, 2) in px."""

    picks: Array = field(default_factory=_nothing)
    labels: tuple[str, ...] = ()
    guessed: bool = False  # the picks are a guess that nobody has taken
    grid: Array = field(default_factory=_nothing)
    grid_px: Array = field(default_factory=lambda: NOTHING[:, 0])  # diameters of the dots there
    measured: Array = field(default_factory=_nothing)
    residual: Array = field(default_factory=_nothing)
    factor: float = 1.0  # by which residuals are drawn too long
    missing: Array = field(default_factory=_nothing)
    excluded: Array = field(default_factory=_nothing)


@dataclass(frozen=True)
class PickingView:
    """One image, ready to be shown."""

    marks: Marks
    places: dict[Target, tuple[float, float]]  # where every target is or should be, px
    targets: tuple[Target, ...]  # of the table's rows
    table: Table
    legend: str
    problem: str = ""  # why the picks cannot be accepted


def picking_view(model: Picking, camera: DeviceSpec) -> PickingView:
    """Put together what is known of the image at work."""
    measurement = model.measured(model.image)
    guessed = not model.picks.seeds and model.guess is not None
    seeds = model.guess if guessed and model.guess else model.picks.seeds
    places: dict[Target, tuple[float, float]] = {}
    grid, sizes, problem, view = NOTHING, NOTHING[:, 0], measurement.refusal if measurement else "", None
    targets = measurement.targets if measurement else None
    if model.complete or guessed:
        try:
            view = measured_view(model.field, camera, targets) if targets is not None else None
            view = view or predicted_view(model.field, camera, seeds, model.capture.name)
            grid = view.project(model.field.xyz_mm)
            sizes = _diameters(view, model.field.xyz_mm, model.field.diameter_mm)
            sizes = sizes if kind_of(model.field).round else CORNER * sizes
            places = {t: (float(u), float(v)) for t, (u, v) in zip(model.field.index(), grid, strict=True) if u == u}
        except InputError as error:
            problem = f"{error.seen}; {error.remedy}"
    places |= {(s.row, s.col): (s.u, s.v) for s in seeds}
    labels = tuple(_label(model, (s.row, s.col)) for s in seeds)
    excluded = np.array([places[t] for t in model.picks.excluded if t in places]).reshape(-1, 2)
    picks = np.array([[s.u, s.v] for s in seeds]).reshape(-1, 2)
    marks = Marks(picks, labels, guessed, grid, sizes, excluded=excluded)
    if targets is not None and view is not None:
        marks, places = _measured_marks(marks, places, model, targets, view, camera)
    rows = _rows(model, targets)
    return PickingView(marks, places, *rows, _legend(model, marks, measurement), told(problem))


def next_step(model: Picking, view: PickingView, at_work: Collection[int]) -> NextStep:
    """Say what Enter does; `at_work` are the images that are being measured."""
    if model.complete and (model.image in at_work or model.measured(model.image) is not None):
        return NextStep.DONE if model.next_due() is None else NextStep.NEXT
    if model.complete:
        return NextStep.ACCEPT
    return NextStep.GUESS if view.marks.guessed and not view.problem else NextStep.PICK


def _measured_marks(
    marks: Marks,
    places: dict[Target, tuple[float, float]],
    model: Picking,
    targets: TargetSet,
    view: View,
    camera: DeviceSpec,
) -> tuple[Marks, dict[Target, tuple[float, float]]]:
    index = model.field.index()
    residual = targets.camera_uv - view.project(model.field.xyz_mm[[index[t] for t in targets.keys]])
    length = float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))) if len(residual) else 0.0
    factor = round_factor(camera.width * VECTOR_SHARE / length) if length > 0 else 1.0
    places = places | {t: (float(u), float(v)) for t, (u, v) in zip(targets.keys, targets.camera_uv, strict=True)}
    unused = {(m.row, m.col) for m in targets.missing} - set(model.picks.excluded)
    missing = np.array([places[t] for t in sorted(unused) if t in places and _inside(places[t], camera)]).reshape(-1, 2)
    made = Marks(
        marks.picks,
        marks.labels,
        False,
        measured=targets.camera_uv,
        residual=residual,
        factor=factor,
        missing=missing,
        excluded=marks.excluded,
    )
    return made, places


def _inside(place: tuple[float, float], camera: DeviceSpec) -> bool:
    return -0.5 <= place[0] < camera.width - 0.5 and -0.5 <= place[1] < camera.height - 0.5


def _diameters(view: View, xyz_mm: Array, diameter_mm: Array) -> Array:
    """Diameters (n,) px of the dots' images, by area."""
    with np.errstate(invalid="ignore"):
        return np.asarray(diameter_mm * np.sqrt(np.abs(np.linalg.det(view.jacobian(xyz_mm)))))


def _label(model: Picking, target: Target) -> str:
    return str(model.wanted.index(target) + 1) if target in model.wanted else ""


def _rows(model: Picking, targets: TargetSet | None) -> tuple[tuple[Target, ...], Table]:
    """List the targets: excluded ones, missing ones with the reason, measured ones."""
    columns = (
        translate("Picking", "row"),
        translate("Picking", "col"),
        translate("Picking", "what became of it"),
        "u [px]",
        "v [px]",
        "σ [px]",
        translate("Measure", "u projector [lines]"),
        translate("Measure", "v projector [lines]"),
    )
    fates: dict[Target, str] = {}
    if targets is not None:
        fates |= {(m.row, m.col): told(m.reason) for m in targets.missing}
    fates |= {t: translate("Picking", "excluded by the operator") for t in model.picks.excluded}
    fates = {t: fates[t] for t in sorted(fates, key=lambda t: (t not in model.picks.excluded, t))}
    if targets is not None:
        measured = translate("Picking", "measured")
        fates |= {t: measured for t in targets.keys if t not in fates}
    values = _values(targets) if targets is not None else {}
    rows = tuple((Number(t[0], "d"), Number(t[1], "d"), text, *values.get(t, NO_VALUES)) for t, text in fates.items())
    return tuple(fates), Table("", columns, rows)


def _values(targets: TargetSet) -> dict[Target, tuple[Cell, ...]]:
    """Give what was measured of every target: camera coordinates, their sigma, projector coordinates."""
    sigma = np.sqrt(np.einsum("nii->n", targets.camera_cov) / 2)
    columns = (*targets.camera_uv.T, sigma, *targets.projector_uv.T)
    specs = (".3f", ".3f", ".4f", ".3f", ".3f")
    return {
        target: tuple(Number(float(x[i]), spec) for x, spec in zip(columns, specs, strict=True))
        for i, target in enumerate(targets.keys)
    }


def _legend(model: Picking, marks: Marks, measurement: Measurement | None) -> str:
    if measurement is not None and measurement.targets is not None:
        targets = measurement.targets
        count, lost = len(targets.row), len(targets.missing)
        if not len(marks.residual):  # too few to tell how the board is seen
            return translate("Picking", "{n} measured, {m} missing").format(n=count, m=lost)
        rms = float(np.sqrt(np.mean(np.sum(marks.residual**2, axis=1))))
        text = translate(
            "Picking", "{n} measured, {m} missing; residuals drawn {f:g} times, r.m.s. {r:.2f} px (pose and nominal c)"
        )
        return text.format(n=count, m=lost, f=marks.factor, r=rms)
    if marks.guessed:
        text = translate("Picking", "A guess, one of {n}: is target 1 where the map has it? R shows the next one.")
        alone = translate("Picking", "A guess: are the targets where the map has them?")
        return text.format(n=model.guesses) if model.guesses > 1 else alone
    if model.complete:
        return translate("Picking", "The circles are where the picks put the targets: do they lie on the dots?")
    return ""


def state_text(model: Picking, image: int, at_work: Collection[int]) -> tuple[str, str]:
    """Give an image's state as the name of a sign and in words."""
    picks, measurement = model.picks_of(image), model.measured(image)
    count = len(picks.seeds)
    if image in at_work:
        return "run", translate("Picking", "being measured")
    if measurement is not None and measurement.targets is not None:
        text = translate("Picking", "{n} measured, {m} missing")
        return "success", text.format(n=len(measurement.targets.row), m=len(measurement.targets.missing))
    if measurement is not None:
        return "error", translate("Picking", "refused: {why}").format(why=measurement.refusal)
    if count >= 4:
        return "info", translate("Picking", "picked, not measured")
    if count:
        return "warning", translate("Picking", "{n} of 4 picked").format(n=count)
    return "capture", translate("Picking", "no picks yet")


def question(model: Picking, view: PickingView, step: NextStep) -> tuple[str, str]:
    """Say what to do now, and what the next step is called."""
    row, col = model.target
    target = translate("Picking", "row {r}, column {c}").format(r=row, c=col)
    does = {
        NextStep.PICK: translate("Picking", "Pick here"),
        NextStep.GUESS: translate("Picking", "Accept the guess"),
        NextStep.ACCEPT: translate("Picking", "Accept and measure"),
        NextStep.NEXT: translate("Picking", "Next image"),
        NextStep.DONE: translate("Picking", "All picked: calibrate"),
    }[step]
    if view.problem:
        return view.problem, does
    if step is NextStep.PICK:
        number = model.wanted.index(model.target) + 1 if model.target in model.wanted else len(model.wanted)
        text = translate(
            "Picking", "Target {k} of {n}: {target}. Click its dot, or bring the cross hairs there and press Space."
        )
        return text.format(k=number, n=len(model.wanted), target=target), does
    if model.target in view.targets:
        fate = str(view.table.rows[view.targets.index(model.target)][2])
        return translate("Picking", "{target}: {fate}").format(target=sentence(target), fate=fate), does
    return translate("Picking", "At work: {target}").format(target=target), does
