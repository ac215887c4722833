"""Where the kernels of an installed bundle are kept."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from core import compiling


def test_a_bundle_keeps_its_kernels_in_the_users_cache_and_only_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    older, foreign = tmp_path / "stripe-workbench/kernels-0123456789abcdef", tmp_path / "stripe-workbench/notes"
    older.mkdir(parents=True)
    foreign.mkdir()
    folder = compiling._cache_folder()
    assert folder.parent == tmp_path / "stripe-workbench"
    assert folder.name == f"kernels-{compiling.fingerprint()}"
    assert not older.exists()
    assert foreign.exists()
