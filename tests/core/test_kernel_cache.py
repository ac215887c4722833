"""Compiled kernels are kept by what they are made from: never an old one, and none compiled for nothing."""

from __future__ import annotations

import importlib.util
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from llvmlite.binding import get_host_cpu_features

from core import compiling
from core.compiling import kept, native

ROOT = Path(__file__).parents[2]
HELPERS = '''
"""What kernels share."""
from core.compiling import inner, njit

LEVEL = 10.0

@inner({how})
def raised(value):
    """Explained."""
    return value + LEVEL

@njit
def doubled(value):
    return 2 * raised(value)
'''
KERNEL = """
from core.compiling import njit
import helpers_of_a_kernel as helpers
from helpers_of_a_kernel import doubled
{before}
@njit(cache=True)
def kernel(values):
    return doubled(values[0]) + helpers.LEVEL{after}
"""


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., tuple[float, bool]]:
    """Run a kernel from sources just written; give its result and whether it was compiled for it."""
    monkeypatch.setattr(kept, "kernel_folder", lambda: tmp_path)

    def load(name: str, source: str) -> Any:
        file = tmp_path / f"{name}-{time.monotonic_ns()}.py"
        file.write_text(source)
        spec = importlib.util.spec_from_file_location(name, file)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        return module

    def run(
        helpers: Callable[[str], str] = str, before: str = "", after: str = "", how: str = "", values: Any = None
    ) -> tuple[float, bool]:
        load("helpers_of_a_kernel", helpers(HELPERS.format(how=how)))
        kernel = load("a_kernel", KERNEL.format(before=before, after=after)).kernel
        result = kernel(np.ones(3) if values is None else values)
        return float(result), kernel.compiled > 0

    return run


def test_a_kernel_is_compiled_once_and_not_for_what_changes_nothing(run: Callable[..., tuple[float, bool]]) -> None:
    assert run() == (32, True)
    assert run() == (32, False)
    assert run(before='"""Another line, and something else."""\nOTHER = 3\n\n\ndef unused():\n    return OTHER\n') == (
        32,
        False,
    )
    assert run(helpers=lambda text: text.replace("Explained", "Explained better")) == (32, False)


def test_a_kernel_is_compiled_anew_when_what_it_calls_changes(run: Callable[..., tuple[float, bool]]) -> None:
    assert run() == (32, True)
    assert run(helpers=lambda text: text.replace("LEVEL = 10.0", "LEVEL = 20.0")) == (62, True)
    assert run(helpers=lambda text: text.replace("2 * raised", "3 * raised")) == (43, True)
    assert run(helpers=lambda text: text.replace("value + LEVEL", "value - LEVEL")) == (-8, True)
    assert run(after=" + 1") == (33, True)
    assert run(how='error_model="numpy"') == (32, True)
    assert run(values=np.ones(3, np.float32)) == (32, True)
    assert run() == (32, False)


def test_every_process_gives_a_kernel_the_same_name() -> None:
    code = "from core.decode.kernels import kernel; print(kernel.decode_pixels.made_from)"
    names = set()
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", code], check=True, env=environment, cwd=ROOT, capture_output=True, text=True
        )
        names.add(done.stdout)
    assert len(names) == 1


def told(program: Path) -> list[bytes]:
    """Run a program in a process with a cache beside it; give the words that it prints."""
    where = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(program.parent), "PYTHONHASHSEED": "1"}
    return subprocess.run([sys.executable, program], check=True, env=where, capture_output=True).stdout.split()


def test_a_kept_kernel_runs_without_numba_and_equal_sources_give_equal_bytes(tmp_path: Path) -> None:
    """Wherever they lie."""
    source = (
        "import sys, math, numpy\n"
        "from core.compiling import inner, njit\n"
        "@inner(error_model='numpy', fastmath={'contract', 'reassoc'})\n"
        "def half(value): return value / 2\n"
        "@njit(cache=True)\n"
        "def total(values): return (numpy.zeros(3) + values).sum()\n"
        "@njit(cache=True)\n"
        "def kernel(values, out):\n"
        "    flat = values.reshape(-1)\n"
        "    for i in range(len(flat)):\n"
        "        x = flat[i]\n"
        "        out[i] = math.erf(x) + math.lgamma(x + 2) + x ** 1.5 + x % 0.3 + half(x)\n"
        "out = numpy.empty(4)\n"
        "kernel(numpy.array([[1.0, 2], [3, 4]]), out)\n"
        "print(total(numpy.ones(3)), out.sum().round(6), kernel.compiled, 'numba' in sys.modules)\n"
    )
    values = np.arange(1.0, 5)
    sums = sum(math.erf(x) + math.lgamma(x + 2) + x**1.5 + x % 0.3 + x / 2 for x in values)
    expected, made = [b"3.0", f"{sums:.6f}".encode()], []
    for folder in (tmp_path / "one", tmp_path / "another/deeper"):
        folder.mkdir(parents=True)
        (folder / "program.py").write_text(source)
        assert told(folder / "program.py") == [*expected, b"1", b"True"]
        made.append({path.name: path.read_bytes() for path in folder.glob("stripe-workbench/kernels/*.kernel-*")})
    assert len(made[0]) == 1
    assert made[0] == made[1]
    assert told(folder / "program.py") == [*expected, b"0", b"False"]


@pytest.mark.skipif(sys.platform == "win32", reason="processes are not copied there")
def test_of_two_processes_at_once_one_compiles(tmp_path: Path) -> None:
    program = tmp_path / "copied.py"
    program.write_text(
        "import os, numba, numpy\n"
        "from core.compiling import njit\n"
        "@njit(cache=True)\n"
        "def total(values): return values.sum()\n"
        "for _ in range(2):\n"
        "    if os.fork() == 0:\n"
        "        os._exit(int(total(numpy.ones(3))) * 10 + total.compiled)\n"
        "print(*sorted(os.waitstatus_to_exitcode(os.wait()[1]) for _ in range(2)))\n"
    )
    where = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run([sys.executable, program], check=True, env=where, capture_output=True)
    assert done.stdout.split() == [b"30", b"31"]


def test_kernels_brought_along_are_loaded_where_they_fit(tmp_path: Path) -> None:
    program = tmp_path / "brings.py"
    program.write_text(
        "import sys, pathlib, numpy\n"
        "from core.compiling import kept, njit\n"
        "kept._BROUGHT = pathlib.Path(sys.argv[1])\n"
        "kept._LEVEL_HAS = set(sys.argv[2:])\n"
        "@njit(cache=True)\n"
        "def halves(values): return (values / 2).sum()\n"
        "print(halves(numpy.ones(3)), halves.compiled)\n"
    )

    def told(cache: Path, *arguments: object, **more: str) -> list[str]:
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(cache), **more}
        command = [sys.executable, str(program), *map(str, arguments)]
        return subprocess.run(command, check=True, env=environment, capture_output=True, text=True).stdout.split()

    brought = tmp_path / "ahead/stripe-workbench/kernels"
    level = {"NUMBA_CPU_NAME": kept._LEVEL, "NUMBA_CPU_FEATURES": ""}
    assert told(tmp_path / "ahead", tmp_path, **level) == ["1.5", "1"]
    assert told(tmp_path / "one", brought, "+lacks") == ["1.5", "1"]
    features = {f"+{name}" for name, has in get_host_cpu_features().items() if has}
    if features >= kept._LEVEL_HAS:
        assert told(tmp_path / "two", brought, *kept._LEVEL_HAS) == ["1.5", "0"]
        assert not list(tmp_path.glob("two/stripe-workbench/kernels/*"))
    assert told(tmp_path / "one", brought, "+lacks") == ["1.5", "0"]


def test_a_broken_entry_is_compiled_anew(run: Callable[..., tuple[float, bool]], tmp_path: Path) -> None:
    assert run() == (32, True)
    (entry,) = tmp_path.glob("*.kernel")
    whole = entry.read_bytes()
    for broken in (b"", whole[: len(whole) // 2], b"not a kernel"):
        entry.write_bytes(broken)
        assert run() == (32, True)
        assert run() == (32, False)


def test_where_numba_has_other_private_parts_kernels_run_all_the_same(
    run: Callable[..., tuple[float, bool]], monkeypatch: pytest.MonkeyPatch
) -> None:
    from core.compiling import build  # with numba

    with monkeypatch.context() as other:
        other.delattr(build, "_entry")
        other.setattr(build, "_type", lambda kind: getattr(kind, "of another numba"))
        assert run() == (32, True)
        assert run() == (32, True)
    assert run() == (32, True)
    assert run() == (32, False)


def test_what_nobody_used_for_long_goes_and_so_do_the_oldest_beyond_a_size(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder, foreign = tmp_path / "stripe-workbench/kernels", tmp_path / "stripe-workbench/notes"
    folder.mkdir(parents=True)
    foreign.mkdir()
    monkeypatch.setattr(kept, "_KEPT_BYTES", 250)
    for name, days in (("used", 0), ("known", 1), ("older", 2), ("forgotten", 100)):
        (folder / f"{name}.kernel").write_bytes(bytes(100))
        os.utime(folder / f"{name}.kernel", (time.time() - days * 86400,) * 2)
    kept._sweep(folder)
    assert sorted(path.name for path in folder.iterdir()) == ["known.kernel", "used.kernel"]
    assert sorted(path.name for path in folder.parent.iterdir()) == ["kernels", "notes"]


def test_kernels_lie_in_the_users_cache_and_nowhere_in_the_package(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert kept.kernel_folder.__wrapped__() == tmp_path / "stripe-workbench/kernels"


def test_a_cache_that_cannot_be_written_stops_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "kernel_folder", lambda: None)

    @compiling.njit(cache=True)
    def twice(values):
        return 2 * values[0]

    assert twice(np.ones(3)) == 2


def test_numbas_own_settings_and_the_callers_kernels_stay_as_they_are(tmp_path: Path) -> None:
    program = tmp_path / "callers.py"
    program.write_text(
        "import gc, numba, numpy\n"
        "before = numba.config.CACHE_DIR, gc.isenabled(), gc.get_threshold()\n"
        "import core.compiling\n"
        "@numba.njit(cache=True)\n"
        "def theirs(values): return values.sum()\n"
        "theirs(numpy.ones(3))\n"
        "assert before == (numba.config.CACHE_DIR, gc.isenabled(), gc.get_threshold())\n"
    )
    places = {"PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    subprocess.run([sys.executable, program], check=True, env={**os.environ, **places})
    assert list((tmp_path / "__pycache__").glob("callers.theirs-*.nbi"))
    assert not (tmp_path / "cache").exists()


class Pair(NamedTuple):
    values: Any
    factor: Any


def test_kernels_take_and_give_what_numba_takes_and_gives() -> None:
    import numba  # takes half a second, which only one worker needs to spend

    def mixed(whole, pair, out, several, flag):
        room = np.empty(2)  # of numba's runtime
        for i in range(pair.values.shape[0]):
            for j in range(pair.values.shape[1]):
                room[j % 2] = pair.factor * pair.values[i, j]
                out[i, j] = room[j % 2] + whole + several[0][0][i] + several[1]
        return not flag, out[0, 0], pair.values.shape[1] - 2, np.float32(pair.factor) / 3

    ours, numbas = compiling.njit(mixed), numba.njit(mixed)
    image = np.random.default_rng(1).normal(size=(4, 5))
    locked = image.copy()
    locked.flags.writeable = False
    unaligned = np.frombuffer(b"." + image.tobytes(), np.uint8)[1:].view(float).reshape(image.shape)
    taken = [
        (image, 2.5, True), (np.asfortranarray(image), np.float32(0.1), np.False_), (image.T, np.int32(-3), False),
        (image[::2, ::-1], 7, np.True_), (image[:0], 2.5, True), (image.astype(np.int16), np.uint8(200), True),
        (locked, 2.5, True), (unaligned, 2.5, True),
    ]  # fmt: skip
    for values, factor, flag in taken:
        given = [np.full((5, 5), np.nan), np.full((5, 5), np.nan)]
        found = [
            kernel(-4, Pair(values, factor), out, ((np.arange(5.0),), 1e-3), flag)
            for kernel, out in zip((ours, numbas), given, strict=True)
        ]
        assert np.array_equal(found[0], found[1], equal_nan=True)
        assert [type(value) for value in found[0]] == [bool, float, int, float]
        assert np.array_equal(*given, equal_nan=True)
    with pytest.raises(TypeError, match="not str"):
        ours("text")


@pytest.mark.parametrize("name", ["_version", "_helperlib", "core.runtime._nrt_python"])
def test_modules_of_numba_are_had_without_the_rest_or_else_with_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    alone = native.numbas(name)
    monkeypatch.setattr(native.PathFinder, "find_spec", lambda *_: None)
    whole = native.numbas(name)
    assert whole is sys.modules[f"numba.{name}"]
    assert vars(alone).keys() == vars(whole).keys()
