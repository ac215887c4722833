"""What once failed in the fuzzer, and a few hundred new inputs: each is read or refused in one line."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.fuzz.__main__ import CORPUS, fails, mutated
from tests.fuzz.readers import readers


@pytest.mark.filterwarnings("error")
def test_every_input_is_read_or_refused_in_one_line(tmp_path: Path) -> None:
    known, rng = readers(tmp_path), random.Random(1)
    for name, reader in known.items():
        assert fails(reader, tmp_path, reader.seed) == "", name
        kept = [p.read_bytes() for p in sorted(CORPUS.glob(f"{name}-*"))]
        for data in [*kept, *(mutated(reader.seed, reader.seed, rng) for _ in range(6))]:
            assert fails(reader, tmp_path, data) == "", (name, data[:300])
        (tmp_path / reader.file).write_bytes(reader.seed)
