"""The road's direction: a stage never imports a neighbour, and the core never imports Qt."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
GROUND = {
    "errors",
    "atomic",
    "progress",
    "fields",
    "digits",
    "algebra",
    "parallel",
    "compiling",
    "numerics",
    "model",
    "geometry",
    "patterns",
}
ALLOWED = {
    "errors": set(),
    "atomic": {"errors"},
    "progress": {"errors"},
    "fields": {"errors"},
    "digits": set(),
    "algebra": set(),
    "parallel": {"algebra", "errors", "progress"},
    "numerics": {"compiling"},
    "lazy": set(),  # which every room may import
    "resources": set(),
    "starting": set(),
    "compiling": {"atomic", "progress", "resources"},
    "model": {"geometry", "patterns"},  # for type annotations only: see below
    "geometry": {"errors", "model"},
    "patterns": {"errors", "fields"},
    "project": GROUND | {"resources"},
    "devices": GROUND | {"resources", "project", "bench"},  # the virtual devices switch the bench
    "verify": GROUND,
    "capture": GROUND | {"project", "devices", "verify"},
    "bench": GROUND | {"project"},
    "decode": GROUND,
    "measure": GROUND,
    "calibrate": GROUND,
    "reconstruct": GROUND,
    "evaluate": GROUND,
    "checks": GROUND,
    "exchange": GROUND,
    "orient": GROUND | {"evaluate"},
    "report": {"errors", "atomic", "progress", "digits", "parallel", "resources", "model", "geometry"},
    "figures": {"geometry", "model"},
    "pipeline": GROUND
    | {"figures", "project", "capture", "bench", "decode", "measure", "calibrate", "reconstruct", "evaluate", "report"}
    | {"verify", "checks", "exchange", "orient"},
    "batch": GROUND | {"figures", "project", "pipeline", "reconstruct", "evaluate"},
    "arrays": {"errors", "model", "patterns"},
    "api": GROUND | {"arrays", "decode", "calibrate", "checks", "reconstruct", "orient"},
    "demo": {"progress", "model", "patterns", "figures", "project", "pipeline", "report"},
    "cli": {
        "errors",
        "atomic",
        "progress",
        "digits",
        "model",
        "patterns",
        "figures",
        "project",
        "pipeline",
        "report",
        "batch",
        "demo",
        "starting",
    },
    "__main__": {"cli"},
}


def rooms() -> dict[str, list[Path]]:
    """Every room of the core (a folder or a module beside it) and its files."""
    files: dict[str, list[Path]] = {}
    for path in sorted((ROOT / "core").rglob("*.py")):
        room = path.relative_to(ROOT / "core").parts[0].removesuffix(".py")
        if room != "__init__":
            files.setdefault(room, []).append(path)
    return files


@cache
def imports_of(path: Path) -> tuple[set[str], set[str]]:
    """The absolute module names that a file imports, inside functions too: all, and those that type checkers need."""
    names: set[str] = set()
    checked: set[str] = set()

    def visit(node: ast.AST, to: set[str]) -> None:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            to = checked
        if isinstance(node, ast.Import):
            to.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: write imports in full"
            to.add(node.module or "")
            to.update(f"{node.module}.{alias.name}" for alias in node.names)
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, ast.expr):
                visit(child, to)

    visit(ast.parse(path.read_text()), names)
    return names, checked


def imported(path: Path, skip_type_checking: bool = False) -> set[str]:
    names, checked = imports_of(path)
    return names if skip_type_checking else names | checked


@pytest.mark.parametrize("room", sorted(rooms()))
def test_a_room_imports_only_what_the_road_allows(room: str) -> None:
    assert room in ALLOWED, f"core/{room} is new: say here what it may import"
    for path in rooms()[room]:
        used = {name.split(".")[1] for name in imported(path) if name.startswith("core.")} - {room, "lazy"}
        assert used <= ALLOWED[room], f"{path.relative_to(ROOT)} imports {sorted(used - ALLOWED[room])}"


def test_no_file_imports_itself_by_way_of_others() -> None:
    """Within rooms too: what is read first in a room needs nothing that is read later."""
    files = [*(ROOT / "core").rglob("*.py"), *(ROOT / "stripe_gui").rglob("*.py")]
    names = {".".join(p.relative_to(ROOT).with_suffix("").parts): p for p in files if p.name != "__init__.py"}
    imports = {name: imported(path, skip_type_checking=True) & names.keys() for name, path in names.items()}
    TopologicalSorter(imports).prepare()  # CycleError names the files


def test_a_package_that_lists_its_files_lists_all_of_them() -> None:
    lists = 0
    for path in [*(ROOT / "core").rglob("__init__.py"), *(ROOT / "stripe_gui").rglob("__init__.py")]:
        told = set(re.findall(r"\b(\w+\.py)\b", ast.get_docstring(ast.parse(path.read_text())) or ""))
        if told:
            lists += 1
            assert told == {file.name for file in path.parent.glob("*.py")} - {"__init__.py"}, path
    assert lists > 10


def test_the_model_imports_nothing_at_run_time() -> None:
    for path in (ROOT / "core/model").glob("*.py"):
        names = {n for n in imported(path, skip_type_checking=True) if n.startswith("core.")}
        assert not {n for n in names if not n.startswith(("core.model", "core.lazy"))}, path


def test_every_kernel_is_kept_by_the_content_of_what_it_is_made_from() -> None:
    for path in (ROOT / "core").rglob("*.py"):
        if path.parent.name != "compiling":
            strange = {"numba.njit", "numba.jit", "numba.vectorize", "numba.extending.register_jitable"} & imported(
                path
            )
            assert not strange, f"{path}: take njit and inner from core.compiling"


@pytest.mark.parametrize("package", ["core", "core.pipeline"])
def test_a_lazy_package_says_the_same_to_type_checkers(package: str) -> None:
    module = importlib.import_module(package)
    told = {
        (node.module, alias.name)
        for node in ast.walk(ast.parse(Path(module.__file__ or "").read_text()))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name
    }
    assert told == {(home, name) for home, names in module._HOMES.items() for name in names.split()}


def test_the_data_folder_is_found_by_one_function() -> None:
    for path in (*(ROOT / "core").rglob("*.py"), *(ROOT / "stripe_gui").rglob("*.py")):
        assert "importlib.resources.files" not in imported(path), f"{path}: take `resource` from core.resources"


def test_the_core_names_no_window_toolkit() -> None:
    for path in (ROOT / "core").rglob("*.py"):
        tops = {name.split(".")[0] for name in imported(path)}
        assert not tops & {"PySide6", "PyQt6", "PyQt5", "qtpy", "pyqtgraph", "stripe_gui", "tkinter"}, path


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys, core.cli\n"
        "try: core.cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "print(sorted({'numpy', 'scipy', 'cv2', 'numba', 'matplotlib', 'reportlab'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.splitlines()[-1] == "[]"


def test_decoding_adjusting_and_reconstructing_wait_for_no_heavy_part_of_scipy() -> None:
    used = (
        "core.cli core.figures core.pipeline.calibrate core.calibrate core.verify.stored core.checks.network "
        "core.decode core.reconstruct"
    )
    code = (
        f"import sys, {', '.join([*used.split(), 'core.pipeline.reconstruct', 'core.pipeline.evaluate'])}\n"
        "heavy = {'special', 'linalg', 'spatial', 'ndimage', 'optimize', 'sparse'}\n"
        "print(sorted(m for m in ('scipy.' + h for h in heavy) if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.splitlines()[-1] == "[]"
