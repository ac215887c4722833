"""Picks at work: `picks.json` once there are enough for measuring, `picks-draft.json` beside it before.

No command reads a draft. Of two files that a crash left side by side the later one counts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from core.model import Seed
from core.project.captures import read_picks, write_picks

ENOUGH = 4  # picks that measuring needs
PICKS, DRAFT = "picks.json", "picks-draft.json"


def keep_picks(folder: Path, seeds: Sequence[Seed], excluded: Sequence[tuple[int, int]] = ()) -> None:
    """Keep the picks of a capture, finished or not; the file that no longer holds goes after the other is there.

    They are finished when every camera that has any has enough.
    """
    fewest = min(Counter(seed.camera for seed in seeds).values(), default=0)
    kept, gone = (PICKS, DRAFT) if fewest >= ENOUGH else (DRAFT, PICKS)
    if seeds or excluded:
        write_picks(Path(folder) / kept, seeds, excluded)
    else:
        (Path(folder) / kept).unlink(missing_ok=True)
    (Path(folder) / gone).unlink(missing_ok=True)


def kept_picks(folder: Path) -> tuple[tuple[Seed, ...], tuple[tuple[int, int], ...]]:
    """Give the picks of a capture and the targets it excludes, as they were kept last."""
    there = [path for path in (Path(folder) / PICKS, Path(folder) / DRAFT) if path.exists()]
    return read_picks(max(there, key=lambda path: path.stat().st_mtime_ns)) if there else ((), ())
