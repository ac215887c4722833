"""A report's seal shows every change; cells that look like formulas are text."""

import dataclasses
from pathlib import Path

import pytest

from core.cli import main
from core.errors import InputError
from core.report import SignOff, Table, write_report, write_table_csv
from core.report.csv_files import as_text
from core.report.seal import sealed, verify

SIGNED = SignOff("A. --> Operator", "rig 7", date="2026-11-22")


@pytest.mark.parametrize("ending", [".html", ".pdf"])
@pytest.mark.parametrize("content", [b"<html>\n</html>\n", b"%PDF-1.4\n%%EOF", b"\n<!-- stripe-report {} -->\n"])
def test_a_seal_holds_until_a_byte_changes(ending, content, tmp_path) -> None:
    whole = sealed(content, ending, SIGNED)
    path = tmp_path / f"report{ending}"
    path.write_bytes(whole)
    seal = verify(path)
    assert (seal.intact, seal.operator, seal.date) == (True, SIGNED.operator, SIGNED.date)
    for at in range(len(whole)):
        changed = bytearray(whole)
        changed[at] ^= 1
        path.write_bytes(changed)
        assert not intact(path), at
    for more in (b" ", b"x\n", b"<script></script>"):
        path.write_bytes(whole + more)
        assert not intact(path)


def intact(path: Path) -> bool:
    try:
        return verify(path).intact
    except InputError:  # the mark of the seal itself was changed
        return False


@pytest.mark.usefixtures("plain_reports")
def test_the_command_says_what_became_of_a_report(data, tmp_path, capsys) -> None:
    small = dataclasses.replace(data, adjustment=None, photogrammetric=None, sign_off=SIGNED)
    paths = write_report(small, tmp_path)
    for path in (paths.html, paths.pdf):
        assert main(["verify-report", str(path)]) == 0
        assert "signed by A. --> Operator on 2026-11-22, unchanged" in capsys.readouterr().out
    paths.html.write_bytes(paths.html.read_bytes().replace(b"0.0", b"0.1", 1))
    assert main(["verify-report", str(paths.html)]) == 1
    assert main(["verify-report", str(tmp_path / "none.html")]) == 2


@pytest.mark.parametrize("cell", ["=1+1", "+cmd", "-x", "@SUM(A1)", " =1", "\t=1"])
def test_cells_that_look_like_formulas_are_text(cell, tmp_path) -> None:
    assert as_text(cell) == f"'{cell}"
    write_table_csv(tmp_path / "t.csv", Table("t", (cell, "b"), ((cell, "-15.5"),), (f"note, {cell}",)))
    lines = (tmp_path / "t.csv").read_text(encoding="utf-8-sig").splitlines()
    for part in ",".join(lines).split(","):
        assert not part.strip().strip('"').startswith(("=", "+", "@")), part
    assert "-15.5" in lines[1]
