"""The core's sentences in the window's language: the catalogue knows every reason, verdict, concern and table's text.

The sentences are read from the core's sources, so that a new one that nobody has translated is named here.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import core
from core.resources import resource
from stripe_gui.presenters.told import speak, told

ROOT = Path(core.__file__).parent
ROOMS = """
checks/* pipeline/state/* pipeline/evidence pipeline/judge pipeline/measure pipeline/evaluate pipeline/orient
pipeline/orient_known pipeline/orient_words pipeline/methods/* pipeline/volumes calibrate/* calibrate/diagnosis/*
calibrate/solution/solve calibrate/approximate/columns calibrate/depth/* evaluate/* decode/notes measure/* measure/*/*
orient/motion orient/known exchange/pinhole digits capture/fitness capture/preflight verify/* report/words
report/numbers report/chapters report/sign_off model/finding patterns/kinds/* patterns/presets
"""
REFUSING = """
atomic fields project/archive project/boards project/captures project/images project/lock project/made project/rigs
patterns/* patterns/kinds/* capture/* verify/* decode/* decode/*/* measure/board measure/targets measure/identity/*
calibrate/depth/* calibrate/photogrammetric evaluate/planes evaluate/profile reconstruct/* reconstruct/export/*
pipeline/calibrate pipeline/capture pipeline/decode pipeline/evaluate pipeline/folders pipeline/measure pipeline/orient
pipeline/picking pipeline/planning pipeline/reconstruct pipeline/runs pipeline/sequences pipeline/signing
pipeline/tables pipeline/testfield pipeline/views report/board orient/known
"""
# calls that show no reason
REFUSED = re.compile(r"Error$|^(_refuse|progress|picked|re\.compile|getLogger)|warning$|\.over$|\.part$")
NOT_TOLD = {
    *("{} is {}: {}", "{}: line {}", "{} corner{}"),  # of every stage, of one and several, on its own
    # by the command alone
    "no capture shows both projector coordinates of enough pixels",
    "{} against {}: drift from what earlier captures led to expect, and its sigma",
    "{}  turned about X, Y, Z, µrad{}shifted across the base, µm         p",
    *("out of control: {}", "in control"),
    # pieces of what is translated as a whole
    "{} has the same targets as {}, to half of their sigma: one capture measured ",
    "{}twice; take one out",
    *(", or ", "give at least {} to tell place, light and offset"),
    *("the capture was seen by one camera alone", "leave it out"),
    *("claims black", "claims {} and is {}"),
    *("frames {} and {}", "two phase steps", "frames across {} contradict each other: {} were exchanged"),
    *("it is of another capture, or something moved or flickered in part; record again", "frames across {}: {}"),
    "{}; or {}",
    *("agree on no line", "run apart, by {} lines over the field"),
    " the same{}: correct exposure_ms in capture.json, or put the frames in order",
}


def template(node: ast.expr) -> str:
    """Give what an expression says, ``{}`` for what varies."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return re.sub(r"\{[^}]*\}", "{}", node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(v.value if isinstance(v, ast.Constant) else "{}" for v in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return template(node.left) + template(node.right)
    return "{}"


def sentences(node: ast.AST) -> Iterator[str]:
    """Give what a piece of code says, but for documentation and errors."""
    if isinstance(node, ast.Raise) or (isinstance(node, ast.Call) and REFUSED.search(ast.unparse(node.func))):
        return
    said = template(node) if isinstance(node, ast.expr) else "{}"
    if isinstance(node, ast.BinOp) and said.replace("{}", "").strip():
        yield said
        for piece in ast.walk(node):
            if isinstance(piece, ast.IfExp | ast.Call):
                yield from sentences(piece)
        return
    yield said
    for child in ast.iter_child_nodes(node):
        if isinstance(node, ast.JoinedStr) and isinstance(child, ast.Constant):
            continue
        if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
            continue
        if not (isinstance(node, ast.FormattedValue) and child is node.format_spec):
            yield from sentences(child)


def files_of(rooms: str) -> list[Path]:
    """Give the files of rooms, of which each has some."""
    found = {room: sorted(ROOT.glob(f"{room}.py")) for room in rooms.split()}
    assert all(found.values()), [room for room, files in found.items() if not files]
    return [file for files in found.values() for file in files]


def said() -> dict[str, str]:
    """Give every sentence of the rooms, and the file that says it."""
    found: dict[str, str] = {}
    for file in files_of(ROOMS):
        for text in sentences(ast.parse(file.read_text(encoding="utf-8"))):
            if " " in text.strip(" {}") and re.search("[a-z]{2}", text.replace("{}", "")):
                found.setdefault(text, f"{file.relative_to(ROOT)}")
    return {text: file for text, file in found.items() if text not in NOT_TOLD}


@pytest.fixture
def german() -> Iterator[None]:
    speak("de")
    yield
    speak("en")


def test_every_sentence_has_a_translation(german: None) -> None:
    known = json.loads(resource("translations", "core_de.json").read_text(encoding="utf-8"))
    left = []
    for text, file in said().items():
        filled = text.replace("{}", "7")
        if text not in known and told(filled) == filled:
            left.append(f"{file}: {text}")
    assert not left, "\n".join(left) + "translate these in resources/translations/core_de.json"


def test_every_refusal_of_what_the_window_reads_and_does_has_a_translation(german: None) -> None:
    """Those of readers, of picks and of `patterns` stood in English in its messages."""
    left = []
    for file in files_of(REFUSING):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("InputError", "StripeError", "BusyError"):
                for text in (text for part in node.args[1:] for text in sentences(part)):
                    filled = text.replace("{}", "7")
                    spoken = " " in text.strip(" {}") and re.search("[a-z]{2}", text.replace("{}", ""))
                    if spoken and text not in NOT_TOLD and told(filled) == filled:
                        left.append(f"{file.relative_to(ROOT)}: {text}")
    assert not left, "\n".join(left) + "translate these in resources/translations/core_de.json"


def test_whatever_is_said_of_running_work_has_a_translation(german: None) -> None:
    """It stood in English in the window's bar."""
    left = []
    for file in (file for file in ROOT.rglob("*.py") if file.stem != "batch"):  # which is the command's alone
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "progress" and len(node.args) == 2:
                filled = template(node.args[1]).replace("{}", "7")
                left += [f"{file.name}: {filled}"] if filled != "7" and told(filled) == filled else []
    assert not left, "\n".join(left) + "translate these in resources/translations/core_de.json"


@pytest.mark.parametrize(
    ("english", "text"),
    [
        (
            "its photogrammetric calibration is failed: camera: residuals are 3.1 times what the sigmas of its "
            "observations allow (chi-square test, variance factor 9.8; up to 2.9 is what sigmas known to a half "
            "and uneven pixels explain): 40 % of it comes from station 1",
            "die Kalibrierung photogrammetrisch ist durchgefallen: Kamera: die Verbesserungen sind das 3.1fache "
            "dessen, was die σ der Beobachtungen erlauben (Chi-Quadrat-Test, Varianzfaktor 9.8; bis 2.9 erklären auf "
            "die Hälfte bekannte σ und ungleiche Pixel): 40 % davon kommt aus dem Standpunkt 1",
        ),
        ("2 of 5 captures: not decoded yet (a, b)", "2 von 5 Aufnahmen: noch nicht dekodiert (a, b)"),
        (
            "Only 15% of the pixels that the projector lights decode: in 84% of them the fringes are too weak for the "
            "noise of 0.7 grey values. Focus, expose longer or use longer periods.",
            "Nur 15% der vom Projektor beleuchteten Pixel lassen sich dekodieren: in 84% davon: die Streifen sind zu "
            "schwach für das Rauschen von 0.7 Grauwerten. Scharf stellen, länger belichten oder längere Perioden "
            "verwenden.",
        ),
        (
            "plane+0, photogrammetric: 866 points lie on other surfaces than the plane of the 9000 others: left out; "
            "check that they do not belong to the plane-table",
            "plane+0, photogrammetrisch: 866 Punkte liegen auf anderen Flächen als der Ebene der 9000 anderen: "
            "weggelassen; prüfen, dass sie nicht zur Planplatte gehören",
        ),
        (
            "the rig was not rigid: F = 16.23, critical value 1.46; one orientation for all poses moves the image "
            "points by 0.36 sigma r.m.s.; over 20 poses the relative orientation scatters by 0.213 mm and 0.367 mrad "
            "r.m.s.; adjust with free stations, and mount the devices firmly",
            "der Aufbau war nicht starr: F = 16.23, Grenzwert 1.46; eine einzige Orientierung für alle Lagen bewegt "
            "die Bildpunkte um 0.36 σ r.m.s.; über 20 Lagen streut die relative Orientierung um 0.213 mm und 0.367 "
            "mrad r.m.s.; mit freien Standpunkten ausgleichen und die Geräte fest montieren",
        ),
        (
            "plane+00: left and projector do not see it as they were calibrated: with the movement taken out, depths "
            "change by -1.8 ± 0.3 mm (p = 3e-22): one of them moved since, or the frames are shifted or of another "
            "rig; see `stripe-core orient`, or calibrate again",
            "plane+00: „links“ und „Projektor“ sehen es nicht so, wie sie kalibriert wurden: ohne die Bewegung ändern "
            "sich Tiefen um -1.8 ± 0.3 mm (p = 3e-22): einer hat sich seither bewegt, oder die Bilder sind verschoben "
            "oder von einem anderen Aufbau; siehe `stripe-core orient`, oder neu kalibrieren",
        ),
        (
            "/p: is being written by process 33 (calibrate); wait until it is done; reading goes on",
            "/p: dort schreibt gerade process 33 (kalibrieren); warten, bis es fertig ist; Lesen geht weiter",
        ),
        (
            'capture.json: names no role; add "role": one of object',
            "capture.json: nennt kein Feld role; „role“ ergänzen: eines von object",
        ),
        ("the words of a plug-in of somebody", "the words of a plug-in of somebody"),
        ("testfield-03: not measured yet; is gone", "testfield-03: noch nicht gemessen; fehlt jetzt"),
        (
            "000.png and 001.png are the same image under two patterns and 43 pairs more: record one again",
            "000.png und 001.png sind dasselbe Bild unter zwei Mustern und 43 weitere Paare: eines neu aufnehmen",
        ),
    ],
)
def test_figures_and_sentences_within_a_sentence_are_told(german: None, english: str, text: str) -> None:
    assert told(english) == text


def test_placeholders_are_the_same_on_both_sides() -> None:
    known = json.loads(resource("translations", "core_de.json").read_text(encoding="utf-8"))
    assert not [english for english, text in known.items() if english.count("{") != text.count("{")]


def test_english_stays_as_it_is() -> None:
    assert told("not decoded yet") == "not decoded yet"


def test_sentences_that_the_core_puts_together_are_all_told(german: None) -> None:
    """They stood half in English: a colon within came before the one between them."""
    text = (
        "frames across columns: the phase runs away from the code, by 0.53 lines over the field: they fit with a "
        "period of 7.96 lines, not 8; or what is seen moved between them"
    )
    assert told(text) == (
        "Bilder quer zu Spalten: die Phase läuft dem Code davon, um 0.53 Linien über das Feld: sie passen mit einer "
        "Periode von 7.96 Linien, nicht 8; oder das Gesehene bewegte sich dazwischen"
    )
