"""Recording a sequence so that no frame can be stored under the name of a pattern it does not show.

plan.py      what shall be recorded, as plain data
run.py       the loop: show, wait, take (with one camera or several), store; verify; take again
triggered.py a whole sequence by the clock of projector or camera, which triggers the other
store.py     shots on disk, the transcript, and how an interrupted capture resumes
live.py      the same sequence again and again, in memory
probe.py     every command of a projector's profile tried once
latency.py   how long the light takes from the program to the camera, by flashes
retake.py    one frame of a complete capture taken again
identity.py  which pattern a frame shows, told from the images alone
lookup.py    ... and what patterns look like on every projector line
importing.py frames that came from elsewhere: ordered, checked, copied whole
recognise.py ... which of them shows which pattern, found from the images alone
proof.py     ... whether that order is the only one
quality.py   saturation, modulation, movement, the lamp
stored.py    captures that were recorded before, by whatever program, judged as a whole
pixels.py    ... how their frames were stored: bytes, compression, mosaics, size
unchanging.py ... pixels that no frame changes: dead lines, text drawn into frames
contradictions.py  ... the share of their pixels that no projector line explains
beside.py    ... phases that stand beside the code or run away from it, or from each other, by a little
overlapping.py ... frames that hold light of the pattern after, or before
exchanged.py ... frames of a code, or phase steps, that stand in each other's place
mistakes.py  ... and how people describe patterns wrongly
rigcheck.py  all checks of a rig that two URLs name
preflight.py the checks before the first calibration: the settle time, and the images for all others
fitness.py   ... what these images tell: linearity, exposure, focus, order, orientation, working depth
"""

from typing import TYPE_CHECKING

from core.lazy import attach

if TYPE_CHECKING:
    from core.capture.plan import Plan as Plan
    from core.capture.plan import make_plan as make_plan
    from core.capture.retake import retake_frame as retake_frame
    from core.capture.run import CaptureReport as CaptureReport
    from core.capture.run import run_capture as run_capture
    from core.capture.run import verify as verify
    from core.capture.store import Store as Store
    from core.capture.store import capture_status as capture_status

_HOMES = {
    "core.capture.plan": "Plan make_plan",
    "core.capture.retake": "retake_frame",
    "core.capture.run": "CaptureReport run_capture verify",
    "core.capture.store": "Store capture_status",
}
if not TYPE_CHECKING:  # else every name would be right
    __getattr__, __dir__, __all__ = attach(__name__, _HOMES)
