"""What messages say."""

from core.errors import choose_among


def test_of_many_names_the_likeliest_are_offered() -> None:
    names = [f"testfield-{n:02d}" for n in range(1, 41)] + ["plane+20"]
    assert choose_among("plane20", names).startswith("choose among plane+20")
    assert choose_among("plane20", names).endswith("41 in all")
    assert choose_among("x", ["a", "b"]) == "choose among a, b"
    assert choose_among("x", []) == "there is none yet"
