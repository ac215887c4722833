"""The peers: each is installed by pip into an environment of its own in .bench-venv, and works in its own process."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.timing import Absent, Contestant, say

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / ".bench-venv"
SCRIPTS = Path(__file__).parent / "peers"


@dataclass(frozen=True)
class Peer:
    """A package to compare with, what pip installs for it, and the interpreters its wheels are made for, best first."""

    package: str
    requirements: tuple[str, ...]
    pythons: tuple[str, ...] = (sys.executable,)
    pip_options: tuple[str, ...] = ()


PEERS = (
    Peer("fringes", ("fringes==2.1.0",)),
    Peer("pycolmap", ("pycolmap==4.2.1",)),
    # its wheels begin with Python 3.12; its viewer alone needs the other packages, which want FLTK's headers
    Peer(
        "mrcal",
        ("mrcal==2.5.2.post1", "numpy", "numpysane", "packaging", "scipy"),
        ("python3.14", "python3.13", "python3.12"),
        ("--no-deps", "--only-binary", "mrcal,numpy,scipy"),
    ),
)


def install_peers() -> None:
    """Install what is not there yet; a peer that cannot be had leaves its reason and stops nothing."""
    for peer in PEERS:
        folder = FOLDER / peer.package
        stamp = folder / "installed.txt"
        if stamp.exists() and stamp.read_text().splitlines() == list(peer.requirements):
            continue
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        say(f"installing {peer.package} into {folder.relative_to(ROOT)}")
        reason = _install(peer, folder)
        if reason:
            (folder / "reason.txt").write_text(reason)
            say(f"{peer.package} does not take part: {reason}")
        else:
            stamp.write_text("\n".join(peer.requirements))


def _install(peer: Peer, folder: Path) -> str:
    """Make the environment; give the reason why not, empty if it is there."""
    python = next((found for name in peer.pythons if (found := _interpreter(name))), None)
    if python is None:
        return f"pip has no wheel of it for Python {sys.version_info.major}.{sys.version_info.minor}, and of " + (
            f"{', '.join(peer.pythons)} none is here"
        )
    made = subprocess.run([python, "-m", "venv", str(folder / "venv")], capture_output=True, text=True, check=False)
    if made.returncode:
        return f"no environment: {_last_line(made.stdout + made.stderr)}"
    command = [str(folder / "venv/bin/python"), "-m", "pip", "install", "--quiet", *peer.pip_options]
    done = subprocess.run([*command, *peer.requirements], capture_output=True, text=True, check=False)
    if done.returncode:
        return f"pip: {_last_line(done.stderr)}"
    tried = subprocess.run([command[0], "-c", f"import {peer.package}"], capture_output=True, text=True, check=False)
    return f"does not load: {_last_line(tried.stderr)}" if tried.returncode else ""


def _interpreter(name: str) -> str | None:
    """Give an interpreter's path if it is there and starts: a shim may stand for one that is not installed."""
    candidates = [shutil.which(name), *sorted(map(str, Path.home().glob(f".pyenv/versions/*/bin/{name}")))]
    for path in candidates:
        if path and not subprocess.run([path, "-c", "import venv"], capture_output=True, check=False).returncode:
            return path
    return None


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if "ERROR" in line] or text.splitlines() or ["no message"]
    return lines[-1].removeprefix("ERROR: ")[:200]


@dataclass(frozen=True)
class Served(Contestant):
    """A contestant in the process of its environment, which times itself; `peers/serving.py` is the other end."""

    process: subprocess.Popen[str] | None = None
    folder: tempfile.TemporaryDirectory[str] | None = None

    def once(self, trim: bool = False) -> tuple[float, float, Any]:
        """Let it work; fetch its result."""
        told = self._ask("run trim" if trim else "run")
        assert self.folder is not None
        path = Path(self.folder.name) / "result.npz"
        if not path.exists():  # the first answer is the one that is judged
            self._ask(f"result {path}")
        with np.load(path) as file:
            return told["seconds"], told["peak_mb"], dict(file)

    def close(self) -> None:
        """End the process."""
        assert self.process is not None
        assert self.folder is not None
        with self.process:  # closes its pipes and waits
            pass
        self.folder.cleanup()

    def _ask(self, request: str) -> dict[str, Any]:
        assert self.process is not None
        assert self.process.stdin is not None
        self.process.stdin.write(request + "\n")
        self.process.stdin.flush()
        return self.reply()

    def reply(self) -> dict[str, Any]:
        """Read one answer; if the process is gone, raise with the last line it wrote."""
        assert self.process is not None
        assert self.process.stdout is not None
        assert self.folder is not None
        line = self.process.stdout.readline()
        if line:
            return json.loads(line)
        self.process.wait()
        raise RuntimeError(_last_line((Path(self.folder.name) / "stderr.txt").read_text()))


def peer(
    package: str, name: str, data: Mapping[str, np.ndarray], right: Callable[[dict[str, np.ndarray]], str], warm: bool
) -> Contestant | Absent:
    """Start a peer with its data, or tell why it cannot take part."""
    folder = FOLDER / package
    if not (folder / "installed.txt").exists():
        reason = folder / "reason.txt"
        return Absent(name, reason.read_text() if reason.exists() else "not installed")
    place = tempfile.TemporaryDirectory()
    np.savez(Path(place.name) / "data.npz", **data)
    script = SCRIPTS / f"{package}_peer.py"
    with (Path(place.name) / "stderr.txt").open("w") as errors:
        process = subprocess.Popen(
            [str(folder / "venv/bin/python"), str(script), str(Path(place.name) / "data.npz")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env={key: value for key, value in os.environ.items() if not key.startswith("PYTHON")},
        )
    served = Served(name, lambda: None, right, warm=warm, peer=True, process=process, folder=place)
    try:
        served.reply()
    except RuntimeError as error:
        served.close()
        return Absent(name, f"does not start: {error}")
    return served


def versions() -> dict[str, str]:
    """Name the versions of the peers that are installed."""
    return {
        p.package: p.requirements[0].partition("==")[2]
        for p in PEERS
        if (FOLDER / p.package / "installed.txt").exists()
    }
