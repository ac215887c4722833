"""What tests of several devices share."""

from pathlib import Path

import pytest


@pytest.fixture
def own(tmp_path: Path):
    """Write a profile of one's own; give its path."""

    def write(text: str) -> str:
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return str(path)

    return write
