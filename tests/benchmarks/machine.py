"""What a run came from: processor, memory, system and versions."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path

from tests.benchmarks.environments import versions

PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "PySide6-Essentials", "pyqtgraph")


def machine() -> dict[str, str]:
    """Describe this machine and what is installed, one entry a line of the table's head."""
    return {
        "processor": f"{_line('/proc/cpuinfo', 'model name') or platform.machine()}, {os.cpu_count()} cores",
        "memory": f"{int((_line('/proc/meminfo', 'MemTotal') or '0 kB').split()[0]) / 2**20:.0f} GiB",
        "system": f"{platform.system()} {platform.release()}",
        "Python": platform.python_version(),
        "packages": ", ".join(f"{name} {version(name)}" for name in PACKAGES),
        "peers": ", ".join(f"{name} {number}" for name, number in versions().items()) or "none installed",
    }


def load() -> float:
    """Give how many processes wanted a processor in the last minute; NaN where the system does not tell."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")


def _line(path: str, name: str) -> str:
    """Give what stands after a name in one of the system's own tables."""
    try:
        lines = Path(path).read_text().splitlines()
    except OSError:
        return ""
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(name)), "")
