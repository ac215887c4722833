"""What is found of frames, beside what decoding says of them."""

from core.model import Note
from core.model.finding import Finding
from core.pipeline.decode import all_notes


def test_a_frame_that_stands_elsewhere_is_not_called_late() -> None:
    """White and black in each other's place were also exposed while the pattern changed, it was said."""
    exchanged = Finding("identity", "bad", "frame 30 claims black and is bright", shots=(30,), names="value")
    late = [f"Frame {k} shows the pattern of frame {k - 1} in rows 1 to 9: it was exposed" for k in (30, 7, 3)]
    told = all_notes([exchanged], [Note(text) for text in late])
    assert told == ("frame 30 claims black and is bright", late[1], late[2])
    assert all_notes([], late) == tuple(late)
