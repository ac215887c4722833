"""What messages say."""

import pytest

from core.calibrate.diagnosis.weakness import UndeterminedError
from core.errors import AdjustmentError, choose_among
from core.pipeline.evidence import because_of


def test_of_many_names_the_likeliest_are_offered() -> None:
    names = [f"testfield-{n:02d}" for n in range(1, 41)] + ["plane+20"]
    assert choose_among("plane20", names).startswith("choose among plane+20")
    assert choose_among("plane20", names).endswith("41 in all")
    assert choose_among("x", ["a", "b"]) == "choose among a, b"
    assert choose_among("x", []) == "there is none yet"


def test_what_captures_say_is_told_of_every_adjustment_that_fails() -> None:
    """Also where the calibration has a kind of error of its own."""
    words = r"add poses\. First see to this: testfield-01: no dot near"
    with pytest.raises(AdjustmentError, match=words), because_of({"testfield-01": ["no dot near"]}):
        raise UndeterminedError("the network", "c cannot be estimated", "add poses")
