"""What tests of whole commands share: small projects from the virtual bench, each made once for all workers."""

from __future__ import annotations

import fcntl
import gc
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the commands do: its threads would only spin beside our own

import cv2
import pytest

from core.bench.scenarios import _PLANS, plan
from core.pipeline import calibrate_project, simulate_project, update_project
from core.project import read_project
from tests.copies import copied, stamps, written_into

cv2.setNumThreads(1)  # small images, and a processor that others share: its threads would spin as well
gc.set_threshold(20_000)  # as the commands do: among so many objects the search for garbage takes a fiftieth of the run
os.fsync = lambda fd: None  # what a cut of power leaves is tested by recorded calls; no disk need follow

Make = Callable[[Path], Any]
GUIDE = Path(__file__).parents[1] / "resources" / "docs" / "extending"
LONGEST = (  # above ten seconds
    "test_paper_experiment.py",
    "test_starting.py",
    "test_operators_day.py",
    "test_other_laboratories.py",
    "test_target_identity.py",
    "test_commands.py",
    "test_disturbed_commands.py",
    "test_batch.py",
)
RENDERED = "quick_original"  # the fixture from which all recorded projects come


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest tests: who began one last would end alone. Mark those of recorded projects."""
    order = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: order.get(item.path.name, len(order)))
    for item in items:
        if RENDERED in getattr(item, "fixturenames", ()):
            item.add_marker("rendered")


def pytest_collection_finish() -> None:
    """Leave what collecting made out of all later searches for garbage: 300,000 objects that stay."""
    gc.freeze()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """See that no test changed what is shared, which then goes: it is no clue to a failure and takes gigabytes."""
    made = session.config._tmp_path_factory._basetemp  # type: ignore[attr-defined]
    if made is None or "PYTEST_XDIST_WORKER" in os.environ:
        return
    for done in made.glob("*.made"):
        if spoiled := written_into(made / "shared" / done.stem, done.read_text()):
            print(f"\nA test wrote into shared files, which it should have made its own first: {spoiled}")
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
    shutil.rmtree(made / "shared", ignore_errors=True)


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Make], Path]:
    """Make a folder once in a run, whichever worker needs it first; nobody may change it."""
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent

    def make(name: str, how: Make) -> Path:
        folder, done = root / "shared" / name, root / f"{name}.made"
        with (root / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                shutil.rmtree(folder, ignore_errors=True)
                how(folder)
                done.write_text(stamps(folder))
        return folder

    return make


@pytest.fixture(scope="session")
def quick_original(once: Callable[[str, Make], Path]) -> Path:
    """The `quick` scenario as the bench records it; never change it."""
    return once("quick-3", lambda folder: simulate_project(folder, "quick", seed=3))


@pytest.fixture(scope="session")
def calibrated_original(quick_original: Path, once: Callable[[str, Make], Path]) -> Path:
    """The same, calibrated both ways; never change it."""

    def calibrated(folder: Path) -> None:
        copied(quick_original, folder)
        calibrate_project(read_project(folder))

    return once("quick-3-calibrated", calibrated)


@pytest.fixture(scope="session")
def whole_original(calibrated_original: Path, once: Callable[[str, Make], Path]) -> Path:
    """The same with every stage done, the report without drawings; never change it."""

    def whole(folder: Path) -> None:
        copied(calibrated_original, folder)
        with pytest.MonkeyPatch.context() as patch:
            without_drawings(patch)
            update_project(read_project(folder))

    return once("quick-3-whole", whole)


@pytest.fixture
def quick(quick_original: Path, tmp_path: Path) -> Path:
    """A copy of the `quick` project to work on."""
    return copied(quick_original, tmp_path / "quick")


@pytest.fixture
def calibrated(calibrated_original: Path, tmp_path: Path) -> Path:
    """A copy of the calibrated `quick` project to work on."""
    return copied(calibrated_original, tmp_path / "calibrated")


@pytest.fixture
def whole(whole_original: Path, tmp_path: Path) -> Path:
    """A copy of the project with every stage done to work on."""
    return copied(whole_original, tmp_path / "whole")


@pytest.fixture(scope="session")
def quick_truth(quick_original: Path) -> dict[str, Any]:
    """What the bench knows about the `quick` project."""
    return json.loads((quick_original / "truth.json").read_text())


def without_drawings(patch: pytest.MonkeyPatch) -> None:
    """Leave the drawings out of reports: nine tenths of the work."""
    from core.report.chapters import CHAPTERS

    for key, chapter in CHAPTERS.items():
        patch.setitem(CHAPTERS, key, replace(chapter, drawings=()))


@pytest.fixture
def plain_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports without their drawings: where it matters that they are there, not how they look."""
    without_drawings(monkeypatch)


@pytest.fixture
def few_captures(monkeypatch: pytest.MonkeyPatch) -> int:
    """Let the `quick` scenario have as few captures as can be calibrated both ways: so many."""
    whole = plan("quick")
    few = replace(whole, places=whole.places[:5], depths_mm=(-50, 0, 50), angles_deg=(0,), objects=False)
    monkeypatch.setitem(_PLANS, "quick", lambda: few)
    return 5 + 3 + 1


@pytest.fixture
def edit_json() -> Callable[..., None]:
    """Change fields of a JSON file; None removes one."""

    def edit(path: Path, **changes: Any) -> None:
        data = {**json.loads(path.read_text()), **changes}
        path.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))

    return edit


@pytest.fixture
def extension(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., ModuleType]]:
    """Add to a registry what an example of the developer's guide adds, without its demonstration; gone afterwards."""
    kept: list[tuple[dict, dict]] = []

    def add(example: str, registry: dict) -> ModuleType:
        kept.append((registry, dict(registry)))
        code = (GUIDE / f"{example}.py").read_text().partition("# %%")[0]
        (tmp_path / f"guide_{example}.py").write_text(code.replace("import matplotlib.pyplot as plt\n", ""))
        monkeypatch.syspath_prepend(tmp_path)
        sys.modules.pop(f"guide_{example}", None)
        return import_module(f"guide_{example}")

    yield add
    for registry, before in kept:
        registry.clear()
        registry.update(before)
