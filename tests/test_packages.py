"""What is given to others: nothing that only POSIX has, a licence for all its parts, a bill of materials."""

import ast
import importlib.metadata
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
POSIX_MODULES = {"fcntl", "termios", "tty", "pty", "grp", "pwd", "resource", "syslog", "crypt", "posix"}
POSIX_CALLS = {  # of os; with what stands for it elsewhere, or the guard that keeps others out, in the same file
    "chown": 'hasattr(os, "chown")',
    "fork": 'hasattr(os, "fork")',
    "getuid": 'hasattr(os, "getuid")',
    "geteuid": 'hasattr(os, "geteuid")',
    "kill": 'os.name == "nt"',  # ends the process there
    "killpg": 'hasattr(os, "killpg")',
    "mkfifo": 'hasattr(os, "mkfifo")',
    "openpty": 'hasattr(os, "openpty")',
    "pread": 'hasattr(os, "pread")',
    "pwrite": 'hasattr(os, "pwrite")',
    "sched_getaffinity": 'hasattr(os, "sched_getaffinity")',
    "setsid": 'hasattr(os, "setsid")',
    "statvfs": 'hasattr(os, "statvfs")',
    "sync": 'hasattr(os, "sync")',
    "ttyname": 'hasattr(os, "openpty")',
    "symlink": 'hasattr(os, "openpty")',
    "O_CLOEXEC": 'getattr(os, "O_CLOEXEC"',
    "O_DIRECTORY": 'getattr(os, "O_DIRECTORY"',
    "O_NONBLOCK": 'getattr(os, "O_NONBLOCK"',
}
ELSEWHERE = {  # of other modules; select.select takes nothing but sockets on Windows
    "socket.AF_UNIX": 'platform.startswith("linux")',
    "select.select": ("create_server", "/dev/hidraw"),
    **dict.fromkeys((f"select.{name}" for name in ("poll", "epoll", "kqueue")), 'hasattr(select, "'),
    **dict.fromkeys((f"signal.{name}" for name in ("SIGKILL", "SIGHUP", "SIGUSR1", "SIGALRM")), 'hasattr(signal, "'),
    "time.tzset": 'hasattr(time, "tzset")',
}


def dotted(node: ast.AST) -> str:
    """A name, or one attribute of a name; empty for all else."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{node.value.id}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


@pytest.mark.parametrize("room", ["core", "stripe_gui"])
def test_nothing_that_only_posix_has_stands_without_its_counterpart(room: str) -> None:
    """Windows and macOS have not been tried: this is what can be seen without them."""
    for path in (ROOT / room).rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        nodes = list(ast.walk(ast.parse(text)))
        caught = {
            id(inner)
            for node in nodes
            if isinstance(node, ast.Try) and any("ImportError" in ast.unparse(h) for h in node.handlers)
            for inner in node.body
        }
        for node in nodes:
            if isinstance(node, ast.Import | ast.ImportFrom):
                modules = {a.name for a in node.names} if isinstance(node, ast.Import) else {str(node.module)}
                guarded = id(node) in caught or 'hasattr(os, "openpty")' in text
                assert guarded or not modules & POSIX_MODULES, f"{path}:{node.lineno}: {modules} without ImportError"
            if (name := dotted(node)).startswith("os.") and (guard := POSIX_CALLS.get(name[3:])):
                assert guard in text, f"{path}:{node.lineno}: {name} without {guard}"
            if guards := ELSEWHERE.get(name):
                guards = (guards,) if isinstance(guards, str) else guards
                assert any(guard in text for guard in guards), f"{path}:{node.lineno}: {name} without {guards}"
            opened = isinstance(node, ast.Call) and dotted(node.func) in ("open", "Path.open") and len(node.args) < 2
            read = isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("read_text", "write_text")
            if opened or read:
                assert any(k.arg in ("encoding", "mode") for k in node.keywords), f"{path}:{node.lineno}: no encoding"


def test_the_bill_of_materials_lists_every_part_and_is_the_same_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "packaging")
    licences = importlib.import_module("licences")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    own, parts = licences.of_program(), [licences.of_python()]
    parts += [licences.of_distribution(licences.distribution(name)) for name in ("numpy", "PyYAML")]
    bill = licences.bill(own, parts)
    assert json.dumps(bill) == json.dumps(licences.bill(own, parts))
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.5")
    assert bill["metadata"]["timestamp"] == "2023-11-14T22:13:20+00:00"
    assert bill["metadata"]["component"]["name"] == "stripe-workbench"
    by_name = {part["name"]: part for part in bill["components"]}
    assert by_name["PyYAML"]["purl"].startswith("pkg:pypi/pyyaml@6")
    assert all(part["version"] and part["licenses"] for part in by_name.values())
    assert bill["dependencies"] == [{"ref": "stripe-workbench", "dependsOn": [p["name"] for p in bill["components"]]}]


def test_the_bill_of_a_wheel_lists_the_fonts_in_it_and_what_it_asks_for(monkeypatch: pytest.MonkeyPatch) -> None:
    import tomllib

    monkeypatch.syspath_prepend(ROOT / "packaging")
    listed = importlib.import_module("bill").of_wheel(importlib.metadata.metadata("stripe-workbench"))
    by_name = {part["name"]: part for part in listed["components"]}
    assert by_name["DejaVu fonts"]["licenses"] == [{"license": {"name": "Bitstream-Vera"}}]
    assert (
        by_name["DejaVu fonts"]["version"].encode("utf-16-be") in (ROOT / "resources/fonts/DejaVuSans.ttf").read_bytes()
    )
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    required = {re.split("[>;=]", line)[0] for line in project["dependencies"]}
    assert {name for name, part in by_name.items() if part.get("scope") == "required"} == required
    assert by_name["pyserial"]["scope"] == "optional"
    assert "numpy>=2.0" in by_name["numpy"]["properties"][0]["value"]


def test_the_licence_names_the_fonts_and_the_description_leads_nowhere_inside() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["license"] == "BSD-3-Clause AND Bitstream-Vera"
    assert all((ROOT / name).is_file() for name in project["license-files"])
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    inner = next(n.value for n in tree.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "INNER")
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    said = re.sub(ast.literal_eval(inner), lambda link: link[1] or "", readme)
    assert "user guide" in said
    assert "](resources" not in said
    assert "](ARCHITECTURE" not in said
