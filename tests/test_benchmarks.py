"""The benchmarks' harness: wrong answers are refused, who is absent says so, the README shows the harness's rows."""

from __future__ import annotations

import gc
import importlib.util
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from core.decode import decode
from core.patterns import reference_sequence
from tests.benchmarks import environments, timing
from tests.benchmarks.__main__ import PARTS
from tests.benchmarks.networks import judge, similar, task
from tests.benchmarks.plots import write_plots
from tests.benchmarks.results import BEGIN, END, HEADLINES, readme_block, update_readme, write_results
from tests.benchmarks.scenes import LINES, frames
from tests.benchmarks.timing import EFFORT, FLOOR, OURS, WARM, Absent, Contestant, Row, floor, race

ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def little_effort(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "EFFORT", timing.Effort(seconds=0.01, rounds=2, quick=True))


def of(rows: list[Row], name: str) -> Row:
    return next(row for row in rows if row.contestant == name)


def test_a_race_times_who_is_right_and_refuses_who_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(EFFORT, "rounds", 3)
    monkeypatch.setattr(gc, "collect", lambda: 0)  # before each call, of all that the tests have loaded

    def right(total: int) -> str:
        assert total == 4950, f"{total} is not the sum"
        return "the sum"

    def broken() -> int:
        raise RuntimeError("no such thing")

    field = [
        Contestant(OURS, lambda: sum(range(100)), right),
        Contestant("wrong", lambda: sum(range(99)), right),
        Contestant("broken", broken, right, peer=True),
        Absent("absent", "no wheel of it"),
    ]
    rows = race("sums", "100", 100, "numbers", field)
    assert [row.contestant for row in rows] == [OURS, "wrong", "broken", "absent"]
    ours = of(rows, OURS)
    assert ours.rounds > 0
    assert ours.least <= ours.seconds
    assert (ours.ratio, ours.right, ours.failed) == (1.0, "the sum", False)
    for name, reason in (("wrong", "WRONG: 4851 is not"), ("broken", "no such thing"), ("absent", "no wheel of it")):
        assert reason in of(rows, name).right
        assert of(rows, name).failed
        assert math.isnan(of(rows, name).seconds)


def test_an_error_of_ours_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError):
        race("part", "", 1, "", [Contestant(OURS, lambda: 1 // 0)])


def test_the_floor_copies_all_bytes_into_new_memory() -> None:
    sources = [np.arange(12.0).reshape(3, 4), np.array([1, np.nan], np.float32)]
    fresh, warm = floor(sources, 100)
    assert (fresh.name, warm.name) == (FLOOR, WARM)
    copies, again = fresh.work(), fresh.work()
    assert fresh.right(copies) == fresh.right(warm.work()) == "0.0 MB"
    assert not np.shares_memory(copies[0], again[0])
    copies[0][1, 2] += 1
    with pytest.raises(AssertionError, match="differs"):
        fresh.right(copies)


def test_the_judge_of_decoding_refuses_a_shifted_map() -> None:
    from tests.benchmarks.decode import _close

    data = frames(reference_sequence(), 96, 80)
    right = _close(data)
    phase = decode(data.patterns, data.images, lines=(LINES, LINES))
    assert "r.m.s." in right((phase.u, phase.v))
    with pytest.raises(AssertionError, match="wrong"):
        right((phase.u + 4, phase.v))
    with pytest.raises(AssertionError, match="decoded"):
        right((phase.u, np.full_like(phase.v, np.nan)))


def test_the_judge_of_adjustments_accepts_the_noise_in_any_datum_and_no_more() -> None:
    one = task(4)
    right = judge(one)
    truth = one.simulated.points_mm
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 1.54e-3 * np.sqrt(40 / 8), truth.shape)  # what eight stations leave
    elsewhere = 1.7 * (truth + noise) @ np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]) + [10.0, -20.0, 30.0]
    assert "off" in right(elsewhere)
    np.testing.assert_allclose(similar(2 * truth - 5, truth), truth, atol=1e-9)
    with pytest.raises(AssertionError, match="noise explains"):
        right(truth + 2 * noise)


def test_peers_see_the_truth_that_the_network_was_made_from() -> None:
    """OpenCV's eight parameters, converted from c, x0, y0, A1 to A6, give the image points without their noise."""
    import cv2

    one = task(2)
    network, data = one.network, one.arrays
    for station, pose in enumerate(one.simulated.stations):
        name = network.station_device[station]
        interior, spec = one.simulated.interior[name], network.devices[name].spec
        a1, a2, a3, _, a5, a6 = interior.a
        r2 = interior.r0_mm**2
        scale = 1 - a1 * r2 - a2 * r2**2
        c, (px, py) = interior.c_mm, spec.pitch_mm
        K = np.diag([c * scale * (1 + a3) / px, c * scale * (1 - a3) / py, 1.0])
        K[0, 2] = (spec.width - 1) / 2 + interior.x0_mm * (1 + a3) / px
        K[1, 2] = (spec.height - 1) / 2 - interior.y0_mm * (1 - a3) / py
        brown = np.array([a1 * c**2, a2 * c**4, -a5 * c, a6 * c]) / scale
        own = data["station"] == station
        axes = np.diag([1.0, -1.0, -1.0])
        turn, shift = cv2.Rodrigues(axes @ pose.rotation)[0], axes @ pose.translation_mm
        seen = cv2.projectPoints(one.simulated.points_mm[data["point"][own]], turn, shift, K, brown)[0][:, 0]
        off = data["uv"][own] - seen
        assert np.sqrt(np.mean(off**2)) == pytest.approx(0.02, rel=0.1)  # 247 points: 4.5 % at one sigma
        assert np.abs(off.mean(axis=0)).max() < 0.005


def test_a_peer_that_is_not_there_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environments, "FOLDER", tmp_path)
    absent = environments.peer("pycolmap", "pycolmap", {}, lambda r: "", warm=True)
    assert absent == Absent("pycolmap", "not installed")
    (tmp_path / "pycolmap").mkdir()
    (tmp_path / "pycolmap/reason.txt").write_text("pip: no wheel")
    assert environments.peer("pycolmap", "pycolmap", {}, lambda r: "", warm=True) == Absent("pycolmap", "pip: no wheel")


def test_a_peer_works_in_its_own_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a stand-in in place of a package, and with one that does not start."""
    folder = tmp_path / "sum"
    (folder / "venv/bin").mkdir(parents=True)
    (folder / "venv/bin/python").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    (folder / "venv/bin/python").chmod(0o755)
    (folder / "installed.txt").write_text("sum")
    scripts = Path(environments.__file__).parent / "peers"
    (tmp_path / "peers").mkdir()
    (tmp_path / "peers/serving.py").write_text((scripts / "serving.py").read_text())
    (tmp_path / "peers/sum_peer.py").write_text(
        "from serving import serve\nserve(lambda d: lambda: d['a'].sum(), lambda r: {'sum': r})\n"
    )
    monkeypatch.setattr(environments, "FOLDER", tmp_path)
    monkeypatch.setattr(environments, "SCRIPTS", tmp_path / "peers")

    def right(result: dict[str, np.ndarray]) -> str:
        assert result["sum"] == 6
        return "6"

    numbers = {"a": np.array([1.0, 2.0, 3.0])}
    rows = race("part", "3", 3, "", [environments.peer("sum", "sum", numbers, right, warm=True)])
    assert (rows[0].right, rows[0].failed) == ("6", False)
    (tmp_path / "peers/sum_peer.py").write_text("import a_package_that_is_not_here\n")
    absent = environments.peer("sum", "sum", numbers, right, warm=True)
    assert isinstance(absent, Absent)
    assert "a_package_that_is_not_here" in absent.reason


def a_run() -> list[Row]:
    """Rows with invented times for everything that the README shows, and a series."""

    def row(part: str, size: str, amount: float, name: str, seconds: float) -> Row:
        return Row(part, size, amount, "pixels", name, seconds, seconds, 3, 1.0, OURS, 10 * seconds, "right")

    headlines = [row(p, s, 1, n, t) for p, s, _ in HEADLINES for n, t in ((OURS, 0.002), (FLOOR, 0.001), (WARM, 1e-4))]
    return headlines + [row("series", str(n), n, name, 1e-8 * n) for n in (10**5, 10**6) for name in (OURS, FLOOR)]


def test_a_run_is_written_as_table_plots_and_readme(tmp_path: Path) -> None:
    nan = math.nan
    absent = Row("decode", "748x576 x 28", 1, "", "fringes", nan, nan, 0, nan, OURS, nan, "not run: no wheel", True)
    machine = {"processor": "a processor, 2 cores", "memory": "24 GiB", "Python": "3.11"}
    write_results(tmp_path, [*a_run(), absent], machine, 1.0)
    data = json.loads((tmp_path / "table.json").read_text())
    assert data["machine"] == machine
    assert data["rows"][-1]["seconds"] is None
    assert "no wheel" in (tmp_path / "table.md").read_text()
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    update_readme(readme, tmp_path / "table.json")
    update_readme(readme, tmp_path / "table.json")
    text = readme.read_text()
    assert text.startswith(f"before\n{BEGIN}\n|")
    assert text.endswith(f"{END}\nafter\n")
    assert "2 ms | fresh copy of its bytes 1 ms (0.5×); fringes: not here |" in text
    assert "a processor, 2 cores" in text
    assert "old" not in text
    assert [path.name for path in write_plots(tmp_path, a_run())] == ["series.png"]


def test_a_partial_run_does_not_reach_the_readme() -> None:
    with pytest.raises(ValueError, match="make bench"):
        readme_block({"machine": {"processor": "", "memory": "", "Python": ""}, "rows": []})


def test_the_readme_shows_the_rows_of_the_harness() -> None:
    block = (ROOT / "README.md").read_text().partition(BEGIN)[2].partition(END)[0]
    shown = [line.split(" | ")[0].removeprefix("| ") for line in block.splitlines() if line.startswith("| ")]
    assert shown[1:] == [told for _, _, told in HEADLINES]


def test_every_part_is_there() -> None:
    for part in PARTS:
        assert importlib.util.find_spec(f"tests.benchmarks.{part}") is not None, part
