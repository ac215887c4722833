"""The whole experiment on the virtual bench."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from core import pipeline
from core.cli.arguments import Commands, Options, Parser, chosen_sequence, sequence_argument
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add(
        "demo", _demo, "simulate the whole experiment, calibrate by both methods, evaluate, write the report"
    )
    sub.add_argument("folder", nargs="?", type=Path, default=Path("demo"), metavar="OUT")
    _scenario(sub)

    sub = commands.add("simulate", _simulate, "write a project with its captures, as a rig would")
    sub.add_argument("folder", type=Path, metavar="OUT")
    _scenario(sub)


def _scenario(sub: Parser) -> None:
    sub.add_argument(
        "--scenario",
        default="paper",
        metavar="NAME",
        help="paper (default), modern, quick, stereo (two cameras) or many (three, two projectors)",
    )
    sub.add_argument("--seed", type=int, default=0)
    sequence_argument(sub)


def _demo(options: Options, progress: Progress) -> dict[str, Any]:
    from core.cli.console import print_plane_verdicts, print_verdict
    from core.demo import run_demo
    from core.project import read_project

    sequence = chosen_sequence(options)
    demo = run_demo(options.folder, options.scenario, options.seed, progress, sequence=sequence)
    for method in pipeline.METHODS:
        if method in demo.figures:  # two cameras have no depth method
            print_verdict(method, demo.figures[method]["verdict"])
    print_plane_verdicts(demo.figures["planes"], not read_project(options.folder).rig.is_pair)
    print()
    print(demo.text)
    print(f"\nproject  {options.folder}\nreport   {demo.report.html}\n         {demo.report.pdf}")
    return demo.figures


def _simulate(options: Options, progress: Progress) -> dict[str, Any]:
    sequence = chosen_sequence(options)
    project = pipeline.simulate_project(options.folder, options.scenario, options.seed, progress, sequence=sequence)
    print(f"{project.path}: {len(project.captures)} captures")
    return {"project": str(project.path), "captures": len(project.captures), "seed": options.seed}
