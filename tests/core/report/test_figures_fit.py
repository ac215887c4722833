"""Every text of the figures stands inside its figure and on no other, for rigs and names unlike the demo's."""

import dataclasses
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from core.model import DriftPoint, Finding
from core.report.chapters import drawings
from core.report.html import write_checks


@pytest.fixture
def texts(monkeypatch):
    """What is drawn as text, by figure: the words, and the box (left, bottom, right, top) of their outlines in pt."""
    found: dict[tuple[int, str], list] = {}
    draw = RendererSVG.draw_text

    def recorded(self, gc, x, y, s, prop, angle, *more, **options):
        draw(self, gc, x, y, s, prop, angle, *more, **options)
        outline = TextPath((0, 0), s, size=prop.get_size_in_points(), prop=FontProperties("DejaVu Sans")).vertices
        turn = np.radians(angle)
        turned = outline @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]] + [x, self.height - y]
        box = (*turned.min(axis=0), *turned.max(axis=0))
        found.setdefault((id(self), f"{self.width:.0f} by {self.height:.0f}"), []).append(
            (s, box, self.width, self.height)
        )

    monkeypatch.setattr(RendererSVG, "draw_text", recorded)
    monkeypatch.setattr("core.parallel.can_fork", lambda *_: False)  # drawn here, where it is recorded
    return found


def faults(texts):
    """Tell texts that are cut off, and pairs that overlap by more than half a point."""
    told = []
    for (_, figure), drawn in texts.items():
        for s, (left, bottom, right, top), width, height in drawn:
            if left < 0 or bottom < 0 or right > width or top > height:
                told.append(f"{figure}: {s!r} is cut off")
        for (s, a, *_), (t, b, *_) in combinations(drawn, 2):
            if all(min(a[k + 2], b[k + 2]) - max(a[k], b[k]) > 0.5 for k in (0, 1)):
                told.append(f"{figure}: {s!r} on {t!r}")
    return told


def other_rig(adjustment):
    """Three devices of names as long as they may be, in large images, 60 m away."""
    names = {"camera": "camera of the left hand side, 12 Mpx", "projector": "projector above the whole bench"}
    third = "another camera, which looks from behind"
    big = {name: dataclasses.replace(spec.spec, width=12000, height=9000) for name, spec in adjustment.devices.items()}
    devices = {names[n]: dataclasses.replace(d, spec=big[n]) for n, d in adjustment.devices.items()}
    devices[third] = devices[names["camera"]]
    network = adjustment.network
    stations = [names[d] for d in network.station_device]
    stations[-2] = third
    return dataclasses.replace(
        adjustment,
        devices=devices,
        network=dataclasses.replace(
            network, station_device=tuple(stations), observation_uv=network.observation_uv * [20, 15]
        ),
        parameter_names=tuple(
            f"{names[d]}.{n}" for d, _, n in (name.partition(".") for name in adjustment.parameter_names)
        ),
        station_from_object=tuple(
            dataclasses.replace(pose, translation_mm=pose.translation_mm * 100)
            for pose in adjustment.station_from_object
        ),
        points_mm=adjustment.points_mm * 100,
    )


def drift_of(names, scale):
    rng = np.random.default_rng(3)
    values = scale * rng.normal(size=(len(names), 5)) * 1e-4
    sigma = np.full(5, scale * 1e-4)
    return tuple(
        DriftPoint(name, "camera", "projector", value, np.zeros(5), sigma, 0.5, "steady")
        for name, value in zip(names, values, strict=True)
    )


def volume_of(height, width):
    layers = [{"depth_mm": depth, "layer": k} for k, depth in enumerate((539.0, 603.0, 666.0))]
    return {"depths": layers}, {"form_sigma_mm": np.random.default_rng(4).uniform(0, 1e-2, (3, height, width))}


def planes_of(evaluations, scale, longer, makers):
    """Twice the planes, deviations times `scale`, by each of the makers."""
    return tuple(
        dataclasses.replace(
            e,
            capture=f"{e.capture}{k}{longer}",
            deviation_mm=e.deviation_mm * np.float32(scale),
            devices=(e.devices[0], by),
            rms_mm=e.rms_mm * scale,
            predicted_rms_mm=None if e.predicted_rms_mm is None else e.predicted_rms_mm * scale,
        )
        for k in range(2)
        for e in evaluations
        for by in makers
    )


@pytest.mark.parametrize("usual", [True, False])
def test_texts_stand_inside_their_figure_and_on_no_other(data, adjustment, evaluations, texts, usual) -> None:
    level = np.linspace(0, 1, 9)
    makers = ["projector"] if usual else ["projector above the whole bench", "projector 2"]
    longer = "" if usual else " of the plane-table, taken in the evening"
    report = dataclasses.replace(
        data,
        adjustment=adjustment if usual else other_rig(adjustment),
        evaluations=planes_of(evaluations, 1.0 if usual else 1e-3, longer, makers),
        responses={"projector": {"a": np.column_stack([level, level**2])}},
        volume=volume_of(*((6, 8) if usual else (8, 6))),
        drift=(drift_of([f"watched-{k}{longer}" for k in range(6)], 1.0 if usual else 1e3),),
    )
    assert sum(len(of) for of in drawings(report).values()) == len(texts)
    assert faults(texts) == []


def test_texts_of_checks_stand_inside_too(texts, tmp_path) -> None:
    level = np.random.default_rng(5).uniform(0, 1e-3, (60, 300))
    curve = Finding("settle", "good", "", curve=((0.0, 1e-4), (1000.0, 2e-4)))
    pictures = [Finding("grain", "good", "", picture=picture) for picture in (level, level.T)]
    write_checks([curve, *pictures], "Checks", tmp_path)
    assert len(texts) == 3
    assert faults(texts) == []
