"""The state of a project: what is current, and doing what is not."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from core import pipeline
from core.cli.arguments import Commands, Options, UnfinishedError
from core.cli.console import print_verdict
from core.errors import InputError
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    commands.add_on_project("status", _status, "show every stage of every capture: absent, current, outdated or failed")
    commands.add_on_project("update", _update, "run outdated and absent stages, in order")
    sub = commands.add_on_folder("check", _check, "explain every inconsistency of a project")
    sub.add_argument("--repair", action="store_true", help="mend what can be mended without loss")


def _status(options: Options, progress: Progress) -> dict[str, Any]:
    states = pipeline.project_states(options.project)
    told: dict[str, str] = {}  # cause, and the stage at which it is told
    for stage, state in states.stages.items():
        new: dict[str, str] = {}
        for text in state.because:
            new.setdefault(_cause(text), text)
        before = dict.fromkeys(told[cause] for cause in new if cause in told)
        lines = [text for cause, text in new.items() if cause not in told]
        told |= {cause: stage for cause in new if cause not in told}
        first, *more = [*lines, *([f"see {', '.join(before)}"] if before else [])] or [""]
        print(f"{stage:12s} {state.state:9s} {first}".rstrip())
        for text in more:
            print(f"{'':22s} {text}")
    print()
    for name, of in states.captures.items():
        own = []
        for stage, state in of.items():
            causes = ", ".join(text for text in state.because if _cause(text) not in told)
            own += [f"{stage} {state.state}: {causes}".removesuffix(": ")] if state.state != "current" else []
        print(f"{name:20s} {'; '.join(own) or 'current: ' + ', '.join(of)}")
    return states.as_dict()


def _cause(text: str) -> str:
    """Give a cause without the stages that hand it on."""
    return text.rpartition(" is outdated: ")[2]


def _update(options: Options, progress: Progress) -> dict[str, Any]:
    from core.figures import verdict_figures

    def tell(text: str) -> None:
        print(text, flush=True)

    update = pipeline.update_project(options.project, progress, tell)
    if not update.done:
        print("nothing to do")
    verdicts = {}
    with suppress(InputError):  # there is none
        for method, calibration in pipeline.load_calibrations(options.project).items():
            verdicts[method] = verdict_figures(calibration.verdict)
            if verdicts[method]["state"] != "passed":
                print_verdict(method, verdicts[method])
    left = {stage: state for stage, state in update.states.stages.items() if state.state != "current"}
    for stage, state in left.items():
        print(f"left: {stage} is {state.state}: {'; '.join(state.because)}", file=sys.stderr)
    return {"done": list(update.done), "verdicts": verdicts, **update.states.as_dict()}


def _check(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.check import check_project

    found = check_project(options.project, options.repair, progress)
    for item in found:
        print(item)
    left = [item for item in found if not item.mended]
    figures = {"inconsistencies": [asdict(item) for item in found], "left": len(left)}
    if left:
        more = "see to them, or" if options.repair else "mend what can be mended with --repair, or"
        count = "1 inconsistency" if len(left) == 1 else f"{len(left)} inconsistencies"
        raise UnfinishedError(figures, options.project, count, f"{more} see what is said of each")
    print("everything fits" if not found else f"{len(found)} mended")
    return figures
