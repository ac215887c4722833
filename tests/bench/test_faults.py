"""Each named fault does what it says, and nothing else goes wrong with it."""

import numpy as np
import pytest

from core.bench import experiment, faults, lines_of, prepare, truth_maps
from core.bench.experiment import Experiment
from core.bench.faults import FAULTS, displaced
from core.patterns import Level, parse_sequence


@pytest.fixture(scope="module")
def small() -> Experiment:
    return experiment("quick", 1)


@pytest.fixture(scope="module")
def sound(small):
    return [image for _, image in small.take(small.shot("testfield-01"))]


def spoilt(small, name):
    return [image for _, image in small.take(small.shot("testfield-01"), [name])]


def test_all_faults_keep_number_and_size_of_the_frames(small, sound):
    assert len(faults()) >= 9
    for name in faults():
        images = spoilt(small, name)
        assert len(images) == len(sound)
        assert all(i.shape == s.shape and i.dtype == s.dtype for i, s in zip(images, sound, strict=True))
        # a line LCD shows no grey: its response does nothing
        assert name == "response" or any(np.any(i != s) for i, s in zip(images, sound, strict=True)), name


def test_a_dropped_frame_moves_all_later_ones_up(small, sound):
    images = spoilt(small, "dropped-frame")
    lost = len(sound) // 3
    assert all(np.array_equal(a, b) for a, b in zip(images[:lost], sound[:lost], strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(images[lost:-1], sound[lost + 1 :], strict=True))
    assert np.array_equal(images[-1], sound[-1])


def test_swapped_frames_are_the_same_frames_in_another_order(small, sound):
    images = spoilt(small, "swapped-frames")
    differ = [k for k, (a, b) in enumerate(zip(images, sound, strict=True)) if not np.array_equal(a, b)]
    assert len(differ) == 2
    assert np.array_equal(images[differ[0]], sound[differ[1]])


def test_an_overexposed_white_frame_saturates(small, sound):
    white = spoilt(small, "saturated")[-2]
    assert sound[-2].max() < 255
    assert np.mean(white[sound[-2] > 90] == 255) > 0.9


def test_out_of_focus_the_phase_steps_lose_modulation(small, sound):
    k = [p.kind for p in small.shot("testfield-01").patterns].index("phase")
    lit = sound[-2] > 80

    def modulation(images):
        a, b = (images[k + i].astype(float) - images[k + i + 2] for i in (0, 1))
        return np.hypot(a, b)[lit].mean() / 2

    assert modulation(spoilt(small, "blurred")) < 0.6 * modulation(sound)


def test_the_object_moves_only_in_the_second_half(small, sound):
    images = spoilt(small, "moved")
    half = len(sound) // 2
    assert np.array_equal(images[half - 1], sound[half - 1])
    assert np.abs(images[-2].astype(float) - sound[-2]).max() > 15
    shot = small.shot("testfield-01")
    before = truth_maps(small.rig, shot.scene).xyz_mm
    after = displaced(shot.scene, FAULTS["moved"].moved_mm).camera_from_board.inverse().apply(before[120, 160])
    there = shot.scene.camera_from_board.inverse().apply(before[120, 160])
    assert 0.2 < np.linalg.norm(after - there) < 1.2


def test_lamp_and_room_drift_during_the_sequence(small):
    plane = small.shot("plane+00")
    lit = truth_maps(small.rig, plane.scene).lit
    dark = ~lit
    sound = [i.astype(float) for _, i in small.take(plane)]
    lamp = [i.astype(float) for _, i in small.take(plane, ["lamp-drift"])]
    room = [i.astype(float) for _, i in small.take(plane, ["ambient-drift"])]
    offset = small.rig.sensor.offset
    assert np.mean(lamp[-2][lit] - offset) / np.mean(sound[-2][lit] - offset) == pytest.approx(0.925, abs=0.01)
    assert np.mean(lamp[0] - sound[0]) == pytest.approx(0.0, abs=0.02)
    assert np.mean(room[-1][dark] - offset) / np.mean(sound[-1][dark] - offset) == pytest.approx(4.0, rel=0.05)


def test_specks_and_glints_stand_on_the_board(small, sound):
    speckled = spoilt(small, "specks")[-2].astype(float)
    glinting = spoilt(small, "reflections")[-2]
    changed = np.abs(speckled - sound[-2]) > 12
    assert 0.001 < changed.mean() < 0.1
    assert (glinting == 255).sum() > 20


def test_a_response_changes_grey_alone(small):
    rig = FAULTS["response"].rig(small.rig)
    level, black = (prepare(rig, small.shot("plane+00").scene).light(*lines_of(Level(v), rig)) for v in (0.5, 0.0))
    white, half = (
        prepare(each, small.shot("plane+00").scene).light(*lines_of(Level(v), each))
        for each, v in ((rig, 1.0), (small.rig, 0.5**2.2))
    )
    assert np.allclose(level, half, atol=1e-3)
    assert level.sum() < 0.3 * white.sum() + black.sum()


def test_a_response_bends_sine_fringes():
    e = experiment("quick", 1, parse_sequence("gray-sine"))
    sound, bent = (e.take(e.shot("plane+00"), names) for names in ([], ["response"]))
    for (pattern, before), (_, after) in zip(sound, bent, strict=True):
        darker = float(np.mean(after < before - 5.0))
        assert darker > 0.1 if pattern.kind == "phase" else darker < 0.01


def test_flicker_changes_from_frame_to_frame():
    lamp = [FAULTS["lamp-flicker"].lamp(k / 27) for k in range(28)]
    assert 0.02 < np.abs(np.diff(lamp)).mean() < 0.1
    assert max(np.abs(np.array(lamp) - 1)) <= 0.05


def test_light_by_detours_is_the_light_that_there_is(small):
    """Below the surface it is spread, not lost; a facing wall gives so much more. Fringes too fine to be spread dim."""
    scene = small.shot("plane+00").scene
    columns, rows = np.ones(small.rig.projector.width), np.zeros(small.rig.projector.height)
    fine = np.arange(len(columns)) % 8 < 4.0

    def light(fault, lines):
        seen = scene if fault is None else FAULTS[fault].scene(scene, np.random.default_rng(0))
        return prepare(small.rig, seen).light(lines, rows)[80:160, 100:220]

    white, fringes = light(None, columns), light(None, fine)
    below, wall = light("subsurface", columns), light("facing-wall", columns)
    assert abs(below.mean() / white.mean() - 1) < 0.01
    assert 0.2 < wall.mean() / white.mean() - 1 < 0.27
    dimmed = [np.std(each / even) for each, even in ((light("subsurface", fine), below), (fringes, white))]
    assert abs(dimmed[0] / dimmed[1] - 0.67) < 0.02
