"""Recording a sequence so that no frame can be stored under the name of a pattern it does not show.

plan.py      what shall be recorded, as plain data
run.py       the loop: show, wait, take, store; verify; take again
store.py     shots on disk, the transcript, and how an interrupted capture resumes
writer.py    ... while the next one is taken
live.py      the same sequence again and again, in memory
probe.py     every command of a projector's profile tried once
retake.py    one frame of a complete capture taken again
identity.py  which pattern a frame shows, told from the images alone
lookup.py    ... and what patterns look like on every projector line
importing.py frames that came from elsewhere: ordered, checked, copied whole
recognise.py ... which of them shows which pattern, found from the images alone
quality.py   saturation, modulation, movement, the lamp
stored.py    captures that were recorded before, by whatever program, judged as a whole
mistakes.py  ... and how people describe patterns wrongly
rigcheck.py  all checks of a rig that two URLs name
preflight.py the checks before the first calibration: the settle time, and the images for all others
fitness.py   ... what these images tell: linearity, exposure, focus, order, orientation, working depth
finding.py   what a check found, in words and figures
"""

from core.capture.finding import Finding
from core.capture.plan import Plan, make_plan
from core.capture.preflight import preflight
from core.capture.retake import retake_frame
from core.capture.run import CaptureReport, Loop, run_capture, verify
from core.capture.store import Status, Store, capture_status, open_store

__all__ = [
    "CaptureReport",
    "Finding",
    "Loop",
    "Plan",
    "Status",
    "Store",
    "capture_status",
    "make_plan",
    "open_store",
    "preflight",
    "retake_frame",
    "run_capture",
    "verify",
]
