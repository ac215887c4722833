"""Wrong input through the commands on two rigs, files as people write them, and sound projects of many rigs.

    python -m tests.wrong                kinds of wrong input: named, told otherwise, or silent
    python -m tests.wrong --files        wrong and unusual files: accepted, or refused in one line
    python -m tests.wrong --sound 200    sound projects whose verdict is not passed

What was found is kept beside the projects, so that a campaign may be run in slices.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import shutil
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2

from tests.wrong.files import FILES
from tests.wrong.kinds import KINDS, NO_ERROR
from tests.wrong.rendered import unlike, varied

FEWEST_TOLD = 3  # sentences of a verdict that are looked at
RIGS = ("bench", "unlike")


def run(folder: Path) -> list[str]:
    """Calibrate and evaluate a project; give what was told, "" where nothing speaks against it."""
    from core.cli import main

    told = []
    for command in ("calibrate", "evaluate"):
        out, figures = io.StringIO(), folder / f"{command}.json"
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(out):
            code = main([command, str(folder), "--json", str(figures)])
        if code:
            said = out.getvalue().strip().splitlines() or [""]
            return [*told, f"exit {code}: {said[-1]}" + ("" if len(said) < 9 else " (many lines)")]
        found = json.loads(figures.read_text())
        verdicts = [v["verdict"] for v in (found["planes"] if command == "evaluate" else found.values())]
        told += [text for v in verdicts if v["state"] != "passed" for text in v["because"][:FEWEST_TOLD]]
    return list(dict.fromkeys(told))


def in_child(folder: Path) -> list[str]:
    """Run in a process of its own, which begins with what this one has loaded."""
    answer = folder / "told.json"
    if (pid := os.fork()) == 0:
        try:
            answer.write_text(json.dumps(run(folder)))
        except BaseException:
            answer.write_text(json.dumps([f"TRACEBACK {traceback.format_exc()}"]))
        os._exit(0)
    os.waitpid(pid, 0)
    return list(json.loads(answer.read_text())) if answer.exists() else ["TRACEBACK the process died"]


def _plain(text: str) -> str:
    """What is said, without its figures."""
    return re.sub(r"[0-9.,]+", "", text)


def rigs(place: Path, only: str) -> dict[str, Path]:
    """The sound projects, all stages done, made where they are not there yet."""
    from core.pipeline import simulate_project

    found = {name: place / name for name in RIGS if any(re.search(only, f"{name}: {kind}") for kind in KINDS)}
    for name, folder in found.items():
        if not (folder / "told.json").exists():
            shutil.rmtree(folder, ignore_errors=True)
            unlike(folder) if name == "unlike" else simulate_project(folder, "quick", seed=3)
            print(f"{name}: {in_child(folder) or 'sound, passed'}", flush=True)
    return found


def wrong(place: Path, only: str, again: bool) -> Iterator[tuple[str, str, str, list[str]]]:
    """Kind, rig, how it ended and what was told, of every kind on every rig."""
    for rig, sound in rigs(place, only).items():
        kept = place / f"{rig}.json"
        known: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
        for kind, (change, words) in KINDS.items():
            if not re.search(only, key := f"{rig}: {kind}"):
                continue
            if again or key not in known:
                folder = place / f"tried-{rig}"
                shutil.rmtree(folder, ignore_errors=True)
                shutil.copytree(sound, folder)
                (folder / "told.json").unlink()
                change(folder)
                known[key] = in_child(folder)
                kept.write_text(json.dumps(known, indent=1))
            before = {_plain(text) for text in json.loads((sound / "told.json").read_text())}
            told = [text for text in known[key] if _plain(text) not in before]
            state = "named" if any(re.search(words, text) for text in told) else "otherwise" if told else "SILENT"
            state = "no error" if key in NO_ERROR else state
            yield kind, rig, "TRACEBACK" if any("TRACEBACK" in t for t in told) else state, told


def refusals(place: Path, only: str) -> int:
    """Try the files; give how many are neither accepted nor refused as they should be."""
    from core.cli import main

    base = place / "few"
    if not base.exists():
        shutil.copytree(rigs(place, "bench")["bench"], base)
        kept = ("testfield-01", "testfield-02", "depth-01", "plane+00")
        for folder in (base / "captures").iterdir():
            if folder.name not in kept:
                shutil.rmtree(folder)
        document = json.loads((base / "project.json").read_text())
        document["captures"] = [name for name in document["captures"] if Path(name).name in kept]
        (base / "project.json").write_text(json.dumps(document))
        shutil.rmtree(base / "results")
        (base / "results").mkdir()
    count = 0
    for name, (change, expected) in FILES.items():
        if not re.search(only, name):
            continue
        folder = place / "tried-files"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(base, folder)
        change(folder)
        before, told = _contents(folder), io.StringIO()
        if (pid := os.fork()) == 0:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(told):
                code = main(["measure", str(folder)])
                code = main(["calibrate", str(folder)]) if not code and expected is not None else code
            (place / "answer.json").write_text(json.dumps([code, told.getvalue().strip().splitlines()]))
            os._exit(0)
        died = os.waitpid(pid, 0)[1]
        code, lines = json.loads((place / "answer.json").read_text()) if not died else (died, ["TRACEBACK"])
        refused = code == 2 and len(lines) == 1 and _contents(folder) == before
        good = not code if expected is None else refused and re.search(expected, lines[0]) is not None
        count += not good
        print(f"{'right' if good else 'WRONG'} {name}: {code} {lines[-1][:200] if lines else ''}", flush=True)
    return count


def _contents(folder: Path) -> dict[str, bytes]:
    """Files but the program's memory and targets, which `measure` may well have written."""
    files = [p for p in folder.rglob("*") if p.is_file() and p.parent.name != "results"]
    return {str(p): p.read_bytes() for p in files}


def sound(place: Path, count: int, first: int) -> int:
    """Varied rigs; give the number of those whose verdict is not passed."""
    kept = place / "sound.json"
    known: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    alarms = 0
    for seed in range(first, first + count):
        if str(seed) not in known:
            folder = place / f"sound-{seed}"
            shutil.rmtree(folder, ignore_errors=True)
            like = varied(folder, seed)
            told = in_child(folder)
            known[str(seed)] = like, told
            kept.write_text(json.dumps(known, indent=1))
            if not told:
                shutil.rmtree(folder)
        like, told = known[str(seed)]
        if told:
            alarms += 1
            print(f"{seed}: {like}", *told, sep="\n    ", flush=True)
    return alarms


def main() -> int:
    """Print the campaign; the exit code is 1 where something is silent or a sound project is doubted."""
    parser = argparse.ArgumentParser(prog="python -m tests.wrong", description=__doc__)
    parser.add_argument("--only", default="", help="kinds and rigs that match this")
    parser.add_argument("--files", action="store_true", help="files instead")
    parser.add_argument("--again", action="store_true", help="also what was run before")
    parser.add_argument("--sound", type=int, default=0, help="so many sound projects instead")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them")
    parser.add_argument("--place", type=Path, default=Path("wrong-results"), help="where projects and results are kept")
    options = parser.parse_args()
    options.place.mkdir(exist_ok=True)
    cv2.setNumThreads(0)  # `in_child` copies none, and OpenCV would wait for them
    if options.files:
        count = refusals(options.place, options.only)
        print(f"{count} of {len(FILES)} kinds of files are not dealt with as they should be")
        return int(count > 0)
    if options.sound:
        alarms = sound(options.place, options.sound, options.first)
        print(f"{alarms} of {options.sound} sound projects are not passed")
        return int(alarms > 0)
    states: dict[str, dict[str, int]] = {rig: {} for rig in RIGS}
    for kind, rig, state, told in wrong(options.place, options.only, options.again):
        states[rig][state] = states[rig].get(state, 0) + 1
        print(f"{state:10}{rig:8}{kind}: {told[0][:200] if told and state == 'named' else ''}", flush=True)
        for text in told[:4] if state != "named" else ():
            print(f"    {text[:400]}", flush=True)
    for rig, counts in states.items():
        print(f"{rig}: {sum(counts.values())} kinds: {', '.join(f'{n} {state}' for state, n in counts.items())}")
    return int(any(set(counts) - {"named", "no error"} for counts in states.values()))


if __name__ == "__main__":
    sys.exit(main())
