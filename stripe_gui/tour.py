"""A picture of every page, in light and dark, at single and double scale."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtGui import QImage

from core.errors import StripeError
from stripe_gui.app import Program, make_application
from stripe_gui.garbage import collected_here
from stripe_gui.pages import PAGES
from stripe_gui.settings import Settings
from stripe_gui.workbench import Workbench

SIZE = (1360, 860)
PATIENCE_S = 300.0  # the machine may be busy
# plain areas: smaller without filters, and packed in a third of the time that Qt takes
PACKED = [cv2.IMWRITE_PNG_COMPRESSION, 2, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]
SCALE = "STRIPE_TOUR_SCALE"


def tour(out: Path, project: Path | None = None) -> int:
    """Write ``PAGE-THEME-SCALE.png`` of every page into a folder; give the exit code.

    Without a project the demo experiment is made first, at its quickest.
    """
    scale = os.environ.get(SCALE)
    with tempfile.TemporaryDirectory() as temporary:
        try:
            if scale is not None:
                return _pictures(out, project, scale)
            folder = project or _demo(Path(temporary) / "demo")
        except StripeError as error:
            print(f"stripe-gui: {error}", file=sys.stderr)
            return error.exit_code
        program = [sys.executable, *([] if getattr(sys, "frozen", False) else ["-m", "stripe_gui"])]
        running = []
        for scale in ("1", "2"):  # Qt reads the scale once, when a process starts
            environment = {**os.environ, SCALE: scale, "QT_SCALE_FACTOR": scale}
            running.append(subprocess.Popen([*program, "--tour", str(out), str(folder)], env=environment))
        return max([process.wait() for process in running])


def _demo(folder: Path) -> Path:
    from core.demo import run_demo
    from core.pipeline.folders import captures_of
    from core.pipeline.update import keep_points
    from core.project import read_project

    run_demo(folder, "quick")
    project = read_project(folder)
    for capture in captures_of(project, "object")[:1]:
        keep_points(project, capture.name, "photogrammetric")
    return folder


def _pictures(out: Path, project: Path | None, scale: str) -> int:
    out.mkdir(parents=True, exist_ok=True)
    application = make_application()
    with (
        tempfile.TemporaryDirectory() as temporary,
        closing(Settings(Path(temporary) / "settings.ini")) as settings,
        collected_here(),
    ):
        bench = Workbench(settings)
        program = Program(application, bench)
        problems: list[str] = []
        bench.noticed.connect(lambda notice: problems.append(notice.happened) if notice.kind == "error" else None)
        window = program.window
        window.resize(*SIZE)
        window.show()
        points: list[Path] = []
        if project is not None and window.open_path(project):
            points = sorted((project / "results" / "points").glob("*.npz"))
        for theme in ("light", "dark") if not problems else ():
            program.show_theme(theme)
            for page in PAGES:
                if page == "reconstruct" and points:
                    bench.session.choose_capture(points[0].name.split(".")[0])
                window.show_page(page)
                wait_until(lambda: not bench.views.busy, page)  # which parts there are may depend on what is computed
                for part in window.page.parts():
                    wait_until(lambda: not bench.views.busy, page + part)
                    write(out / f"{page}{part}-{theme}-{scale}x.png", window.grab().toImage())
        window.close()
        for problem in problems:
            print(f"stripe-gui: {problem}", file=sys.stderr)
        return 1 if problems else 0


def write(path: Path, picture: QImage) -> None:
    """Write a picture as PNG."""
    picture = picture.convertToFormat(QImage.Format.Format_BGR888)
    rows = np.frombuffer(picture.constBits(), np.uint8).reshape(picture.height(), picture.bytesPerLine())
    colours = rows[:, : 3 * picture.width()].reshape(picture.height(), picture.width(), 3)
    path.write_bytes(cv2.imencode(path.suffix, colours, PACKED)[1].data)


def wait_until(done: Callable[[], bool], what: str = "the window") -> None:
    """Let the window work until something is done, and then until it has drawn; StripeError after five minutes."""
    end = time.monotonic() + PATIENCE_S
    while not done():
        if time.monotonic() > end:
            raise StripeError(what, f"not ready in {PATIENCE_S:g} s", "try again while the machine does less")
        QCoreApplication.processEvents()
        time.sleep(0.005)
    for _ in range(5):
        QCoreApplication.processEvents()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
