"""`python -m tests.benchmarks [PART ...]`: all contestants in one run, a table and a plot in bench-results/.

Peers are installed into .bench-venv, which also sees the packages of the environment that calls; nothing is asserted
about times.
"""

from __future__ import annotations

import argparse
import importlib
import os
import platform
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

ROOT = Path(__file__).parents[2]
PARTS = ("decode", "intersection", "adjustment", "start", "opening")
PEERS = ("fringes",)


def main() -> None:
    """Make the environment, run the parts asked for, write what was measured."""
    parser = argparse.ArgumentParser(prog="tests.benchmarks", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all if unsaid")
    parser.add_argument("--no-peers", action="store_true", help="install nothing")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(PARTS):
        parser.error(f"no part {sorted(unknown)[0]!r}: choose among {', '.join(PARTS)}")
    folder = ROOT / ".bench-venv"
    if not options.no_peers and Path(sys.prefix) != folder:
        _install(folder)
        os.execv(folder / "bin" / "python", [str(folder / "bin" / "python"), "-m", "tests.benchmarks", *sys.argv[1:]])
    from tests.benchmarks.results import write_results

    rows = []
    for part in options.parts or PARTS:
        print(part, flush=True)
        rows += importlib.import_module(f"tests.benchmarks.{part}").run()
    write_results(ROOT / "bench-results", rows, _machine())


def _install(folder: Path) -> None:
    """Make the environment of the peers, or leave it as it is; tell which peers could not be had."""
    if not (folder / "bin" / "python").exists():
        venv.create(folder, with_pip=True)
        version = f"python{sys.version_info.major}.{sys.version_info.minor}"
        site = folder / "lib" / version / "site-packages"
        (site / "project.pth").write_text(f"{sysconfig.get_paths()['purelib']}\n{ROOT}\n")
        for peer in PEERS:
            command = [folder / "bin" / "python", "-m", "pip", "install", "--quiet", peer]
            if subprocess.run(command, check=False).returncode:
                print(f"{peer} could not be installed and does not take part", flush=True)


def _machine() -> str:
    model = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    except OSError:
        pass
    load = f", load {os.getloadavg()[0]:.1f} at the end" if hasattr(os, "getloadavg") else ""
    return f"{model}, {os.cpu_count()} processors, Python {platform.python_version()}, {platform.system()}{load}"


if __name__ == "__main__":
    main()
