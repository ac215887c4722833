"""Recording a sequence so that no frame can be stored under the name of a pattern it does not show.

plan.py      what shall be recorded, by the project and by what the projector can show
run.py       the loop: show, wait, take (with one camera or several), store; verify; take again
triggered.py a whole sequence by the clock of projector or camera, which triggers the other
store.py     shots on disk, the transcript, and how an interrupted capture resumes
live.py      the same sequence again and again, in memory
probe.py     every command of a projector's profile tried once
latency.py   how long the light takes from the program to the camera, by flashes
retake.py    one frame of a complete capture taken again
importing.py frames that came from elsewhere: ordered, checked, copied whole
rigcheck.py  all checks of a rig that two URLs name
preflight.py the checks before the first calibration: the settle time, and the images for all others
fitness.py   ... what these images tell: linearity, exposure, focus, order, orientation, working depth
"""

from typing import TYPE_CHECKING

from core.lazy import attach

if TYPE_CHECKING:
    from core.capture.plan import make_plan as make_plan
    from core.capture.retake import retake_frame as retake_frame
    from core.capture.run import CaptureReport as CaptureReport
    from core.capture.run import run_capture as run_capture
    from core.capture.run import verify as verify
    from core.capture.store import Store as Store
    from core.capture.store import capture_status as capture_status

_HOMES = {
    "core.capture.plan": "make_plan",
    "core.capture.retake": "retake_frame",
    "core.capture.run": "CaptureReport run_capture verify",
    "core.capture.store": "Store capture_status",
}
if not TYPE_CHECKING:  # else every name would be right
    __getattr__, __dir__, __all__ = attach(__name__, _HOMES)
