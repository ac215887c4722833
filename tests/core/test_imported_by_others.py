"""The core as a library: nothing of the caller's process changes, and the names are there with their types."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from importlib.metadata import version
from pathlib import Path

import pytest

import core

ROOT = Path(__file__).parents[2]
STATE = """
import gc, locale, logging, os, signal, sys, warnings
import cv2, matplotlib, numba, numpy
def state():
    return {
        "environment": dict(os.environ), "garbage": (gc.isenabled(), gc.get_threshold(), gc.callbacks[:]),
        "numba": {n: getattr(numba.config, n) for n in dir(numba.config) if n.isupper()},
        "opencv": (cv2.utils.logging.getLogLevel(), cv2.getNumThreads()), "matplotlib": dict(matplotlib.rcParams),
        "numpy": numpy.geterr(), "warnings": warnings.filters[:], "path": sys.path[:], "cwd": os.getcwd(),
        "logging": {n: getattr(l, "level", None) for n, l in logging.root.manager.loggerDict.items()},
        "root": (logging.root.level, logging.root.handlers[:]), "hooks": (sys.excepthook, signal.getsignal(2)),
        "locale": locale.setlocale(locale.LC_ALL), "recursion": sys.getrecursionlimit(),
    }
def loggers_of_others(kept):
    return {**kept, "logging": {n: l for n, l in kept["logging"].items() if not n.startswith("core")}}
"""


def run(code: str, cwd: Path = ROOT) -> str:
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT), "HOME": str(Path.home())}
    command = [sys.executable, "-c", textwrap.dedent(code)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=cwd, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_every_public_name_changes_nothing_in_the_callers_process() -> None:
    # what SciPy, Jinja and others imported on the way do is theirs: they are imported before
    run(
        STATE
        + """
import jinja2, reportlab, scipy.linalg, scipy.ndimage, scipy.spatial, scipy.optimize, scipy.sparse
before = loggers_of_others(state())
import core
for name in core.__all__: getattr(core, name)
after = loggers_of_others(state())
after["logging"] = {n: after["logging"][n] for n in before["logging"]}
for key in before: assert before[key] == after[key], (key, before[key], after[key])
"""
    )


def test_reading_a_broken_image_leaves_opencvs_log_level_as_it_was(tmp_path: Path) -> None:
    run(
        STATE
        + f"""
from pathlib import Path
from core.project.images import read_image
from core import StripeError
from concurrent.futures import ThreadPoolExecutor
path = Path({str(tmp_path)!r}) / "x.tif"
path.write_bytes(b"II*" + bytes(50))
def read(_):
    try: read_image(path)
    except StripeError: return True
before = cv2.utils.logging.getLogLevel()
with ThreadPoolExecutor(4) as pool: assert all(pool.map(read, range(200)))
assert cv2.utils.logging.getLogLevel() == before
"""
    )


def test_importing_the_package_loads_nothing_else() -> None:
    code = """
        import sys
        before = set(sys.modules)
        import core
        dir(core)
        print(sorted({n.split(".")[0] for n in set(sys.modules) - before} - {"core"} - set(sys.stdlib_module_names)))
        """
    assert run(code).strip() == "[]"


def test_all_public_names_are_there_and_listed() -> None:
    assert len(set(core.__all__)) == len(core.__all__)
    assert set(core.__all__) <= set(dir(core))
    for name in core.__all__:
        assert getattr(core, name) is not None
    with pytest.raises(AttributeError, match="no_such_thing"):
        _ = core.no_such_thing


def test_the_version_is_the_packages() -> None:
    assert core.__version__ == version("stripe-workbench")
    done = subprocess.run(
        [sys.executable, "-m", "core", "--version"], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout == f"stripe-core {core.__version__}\n"


def test_a_users_type_checker_knows_the_types(tmp_path: Path) -> None:
    snippet = tmp_path / "user.py"
    snippet.write_text(
        "from pathlib import Path\n"
        "from typing import assert_type\n"
        "import core\n"
        "from core.model import PhaseMap, Project\n"
        "project = core.read_project(Path('bench'))\n"
        "assert_type(project, Project)\n"
        "assert_type(core.decode_capture(Path('x')), PhaseMap)\n"
        "assert_type(core.__version__, str)\n"
        "core.read_project(3)  # wrong\n"
        "core.no_such_thing  # wrong\n"
    )
    import mypy.api

    settings = tmp_path / "mypy.ini"  # a user's own, not this project's
    # without the types of other packages, which take most of the time
    alone = "follow_imports = silent\nno_site_packages = True"
    settings.write_text(f"[mypy]\nstrict = True\nmypy_path = {ROOT}\n{alone}\n")
    out, err, _ = mypy.api.run(["--config-file", str(settings), "--cache-dir", str(tmp_path / "cache"), str(snippet)])
    assert not err
    wrong = [line for line in out.splitlines() if "error" in line and "user.py" in line]
    assert [int(line.split(":")[1]) for line in wrong] == [9, 10], out
