"""`python -m tests.devices.pace`: how long a pattern takes, with everything that storing and verifying it costs.

The projector needs 14 ms to switch, as the reference projector does; the camera gives images of 748 x 576 px that were
rendered beforehand, so that only the program's own time is measured.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from pathlib import Path

from core.capture import run_capture
from core.devices.opening import open_camera
from core.devices.protocol import Pixels
from core.devices.scene import FlatScene, Lines
from core.devices.virtual import Stage
from core.model import DeviceSpec, Subject
from core.patterns import Pattern, reference_sequence
from core.project import read_project, write_project

CAMERA, PROJECTOR = (748, 576), (640, 640)
RUNS = 3


class Rendered(FlatScene):
    """A flat scene whose images are there already."""

    def render(self) -> None:
        """Render every pattern once."""
        frames = {p: super(Rendered, self).frame(p, 1) for p in reference_sequence(*PROJECTOR)}
        object.__setattr__(self, "frames", frames)

    def frame(self, pattern: Pattern, seed: int) -> Pixels:
        """Give the image of a pattern."""
        frames: dict[Pattern, Pixels] = self.__dict__["frames"]
        return frames[pattern]

    def frame_lines(self, columns: Lines, rows: Lines, seed: int) -> Pixels:
        """Refuse single lines: nobody asks for them here."""
        raise NotImplementedError


def main() -> None:
    """Capture a few times and print what a pattern took."""
    scene = Rendered(camera_size=CAMERA, projector_size=PROJECTOR)
    scene.render()
    for settle_ms in (14, 0):
        url = f"virtual:flat?settle_ms={settle_ms}"
        for run in range(RUNS):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder)
                camera, projector = DeviceSpec(*CAMERA, (0.01, 0.01), 12.0), DeviceSpec(*PROJECTOR, (0.09, 0.09), 182.0)
                write_project(path, "pace", camera, projector)
                held = open_camera("virtual:flat")  # keeps the stage, and the scene put on it
                stage: Stage = held.stage  # type: ignore[attr-defined]
                stage.scene = scene
                start = time.perf_counter()
                report = run_capture(read_project(path), Subject("object", "a"), url, "virtual:flat")
                whole = time.perf_counter() - start
                held.close()
                entries = [json.loads(line) for line in (report.folder / "transcript.jsonl").open(encoding="utf-8")]
            exposed = [e["exposed"] for e in entries if e["event"] == "shot"]
            shot_ms = 1000 * (exposed[-1] - exposed[0]) / (len(exposed) - 1)
            print(
                f"switching {settle_ms:2d} ms, run {run + 1}: {shot_ms:5.1f} ms a pattern while taking; "
                f"{len(exposed)} images stored and verified in {whole:.2f} s"
            )


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
