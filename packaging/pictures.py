"""Take the pictures of the help and README again: ``python packaging/pictures.py PROJECT`` (`make pictures`).

PROJECT is a finished one, best that of `make demo`; the window is photographed page by page, nothing in it changes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from stripe_gui.tour import SCALE

FOLDER = Path(__file__).parents[1] / "resources" / "help" / "images"
PICTURES = {
    "new-project": "new-project-rig",
    "capture": "capture-wizard-picture",
    "decode": "decode-v",
    "measure": "measure-targets",
    "calibrate": "calibrate-results-residuals",
    "reconstruct": "reconstruct-height",
    "evaluate": "evaluate-maps",
    "report": "report",
    "rig": "rig-space",
}  # chapter of the help -> page and part, as the tour names them
COLOURS = 128  # enough for the window's few tints, and a quarter of the size


def main(project: Path) -> None:
    """Write one picture a chapter."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "stripe_gui", "--tour", folder, str(project)]
        alone = {"QT_QPA_PLATFORM": "offscreen", SCALE: "1", **os.environ}  # at one scale, which is all that is taken
        subprocess.run(command, check=True, env=alone)
        for chapter, page in PICTURES.items():
            with Image.open(Path(folder) / f"{page}-light-1x.png") as taken:
                taken.convert("RGB").quantize(COLOURS).save(FOLDER / f"{chapter}.png", optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
