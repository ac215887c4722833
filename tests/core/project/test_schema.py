"""The published schema and the readers know the same keys, and refuse the same values."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

import core.patterns.pattern
import core.project.captures
import core.project.networks
from core.cli import main
from core.errors import InputError
from core.fields import Fields, read_document
from core.geometry import LENSES
from core.patterns import PRESETS, pattern_from_dict, read_sequence
from core.project import read_capture, read_network, read_project
from core.project.captures import MOST_FRAMES, read_picks
from core.project.rigs import read_bar, read_device
from core.project.schema import files_schema

SCHEMA = json.loads(files_schema())
FILES = Draft202012Validator(SCHEMA)
LAMP = {"width": 16, "height": 16, "response": [[0, 0], [1, 0.9]]}
PLAIN = {"width": 8, "height": 6, "pitch_mm": [0.01, 0.01], "nominal_c_mm": 12}
DEVICE = {**PLAIN, "r0_mm": 0.02, "response": [[0, 0]]}
BAR = {"from": [0, 0], "to": [0, 1], "length_mm": 100.0, "sigma_mm": 0.1}
Keys = dict[tuple[str, ...], set[str]]


def known_before(model: str) -> dict[str, Any]:
    """A device with every key, whose lens is of a model."""
    values = dict.fromkeys(LENSES[model].keys, 0.0)
    more = {"c_mm": 12.5, "x0_mm": {"value": 0.01, "sigma": 0.002}, "sigma": {"c_mm": 0.1, "y0_mm": 0.0}}
    return {**DEVICE, "interior": {"model": model, "hold": False, "r0_mm": 0.02, **values, **more}}


def project(**keys: Any) -> dict[str, Any]:
    return {"format": "stripe-project", "version": 2, "captures": ["one"], **keys}


FRAME = {"file": "0.png", "pattern": {"kind": "white"}, "camera": "camera", "projector": "lamp", "exposure_ms": 2.5}
CAPTURE = {"format": "stripe-capture", "version": 2, "state": "complete", "frames": [FRAME]}
SEED = {"row": 0, "col": 1, "u": 2.5, "v": -0.5, "camera": "left"}
PHASE = {"period": 4.5, "steps": 4, "step": 1, "shift_rad": 0.5, "profile": "square"}
CODE = {"axis": "x", "bit": 0, "bits": 4, "cell": 2, "inverse": True}
PATTERNS: list[dict[str, Any]] = [
    {"kind": "white"},
    {"kind": "black"},
    {"kind": "level", "value": 0.5},
    {"kind": "gray", **CODE},
    {"kind": "binary", **CODE},
    {"kind": "phase", "axis": "y", **PHASE},
    {"kind": "line", "axis": "x", "index": 3, "width": 2},
    {"kind": "lines", "axis": "x", "values": "0110"},
    {"kind": "lines", "axis": "x", "values": [0, 0.5, 1]},
]
OPTIONS: dict[str, Any] = {
    "axes": "xy", "plain": True, "period": 24.0, "steps": 5, "cell": 3, "code": "gray", "profile": "sine",
    "inverse": False, "periods": [9.0, 10.0], "frames": 24, "blur": 0.5, "seed": 3,
}  # fmt: skip
BROWN = {**PLAIN, "interior": {"model": "brown", "sigma": {}}, "estimate": ["c", "k1"], "rigid_with": "cam"}
NETWORK = {
    "devices": {"cam": {**PLAIN, "estimate": ["c", "A1"]}, "b": BROWN},
    "stations": {"1": {"device": "cam", "pose": "p"}, "2": {"device": "b", "pose": "p"}},
    "scale": {**BAR, "from": "P", "to": "Q"},
    "lengths": [{**BAR, "from": "P", "to": "R"}],
}
#: by name: a definition of the schema, or none for a whole file, and documents that use all of it
DOCUMENTS: dict[str, tuple[str, list[Any]]] = {
    "project": ("", [
        project(camera=PLAIN, projector=PLAIN, name="x", scale=BAR, lengths=[BAR], reference="brenner1999",
                sequence="paper", decode={"estimate": True}),
        project(cameras={"left": PLAIN}, projectors={"lamp": PLAIN}),
    ]),
    "capture": ("", [
        {**CAPTURE, "role": "depth", "testfield": "board.csv", "z_mm": -50.0},
        {**CAPTURE, "role": "plane", "angle_deg": 15},
    ]),
    "picks": ("", [{"format": "stripe-picks", "version": 2, "seeds": [SEED], "excluded": [[3, 7]]}]),
    "network": ("", [{"format": "stripe-network", "version": 2, **NETWORK}]),
    "distance": ("distance", [BAR]),
    **{f"camera {model}": ("camera", [known_before(model), {**DEVICE, "interior": {"model": model, "sigma": {}}}])
       for model in LENSES},
    "projector": ("projector", [LAMP, {**DEVICE, "interior": None}]),
    **{f"pattern {k}": ("pattern", [pattern]) for k, pattern in enumerate(PATTERNS)},
    **{f"sequence {name}": ("sequence", [{"preset": name, **{key: OPTIONS[key] for key in preset.options}}])
       for name, preset in PRESETS.items()},
    "sequence listed": ("sequence", [[{"kind": "white"}, {"kind": "lines", "axis": "y", "values": "01"}]]),
}  # fmt: skip


class Noted(dict[str, Any]):
    """An object that notes what is asked for of it, under the names of the objects around it."""

    def __init__(self, data: dict[str, Any], path: tuple[str, ...], asked: Keys) -> None:
        super().__init__({key: noted(value, (*path, key), asked) for key, value in data.items()})
        self.note = asked[path].add

    def get(self, key: str, default: Any = None) -> Any:
        self.note(key)
        return super().get(key, default)

    def __getitem__(self, key: str) -> Any:
        self.note(key)
        return super().__getitem__(key)


def noted(value: Any, path: tuple[str, ...], asked: Keys) -> Any:
    if isinstance(value, list):
        return [noted(item, path, asked) for item in value]
    return Noted(value, path, asked) if isinstance(value, dict) else value


def schema_keys(schema: Any, value: Any, path: tuple[str, ...], found: Keys) -> None:
    """Note the keys that the schema has for every object of a sound document; a map has those that are there."""
    if not isinstance(schema, dict):
        return
    if "$ref" in schema:
        schema_keys(SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]], value, path, found)
    branches = [*schema.get("allOf", []), *filter(lambda b: sound(b, value), schema.get("anyOf", []))]
    if "if" in schema:
        branches.append(schema.get("then" if sound(schema["if"], value) else "else"))
    for branch in branches:
        schema_keys(branch, value, path, found)
    if isinstance(value, list):
        for item in value:
            schema_keys(schema.get("items"), item, path, found)
    if isinstance(value, dict):
        named, others = schema.get("properties", {}), schema.get("additionalProperties")
        found[path] |= named.keys() | (value.keys() if others else set())
        found[path] |= set(schema.get("propertyNames", {}).get("enum", ()))
        for key, item in value.items():
            schema_keys(named.get(key, others), item, (*path, key), found)


def sound(schema: dict[str, Any], value: Any) -> bool:
    return validator(schema).is_valid(value)


def validator(schema: dict[str, Any]) -> Draft202012Validator:
    """Of a part of the schema."""
    return FILES.evolve(schema={"$id": SCHEMA["$id"], "$defs": SCHEMA["$defs"], "allOf": [schema]})


def part(name: str) -> dict[str, Any]:
    """Give a definition of the schema, or what it says of whole files."""
    return {"$ref": f"#/$defs/{name}"} if name else {key: SCHEMA[key] for key in ("required", "properties", "allOf")}


@pytest.fixture
def read(tmp_path: Path) -> Callable[[str, Any], object]:
    """Read a document of one of the names in `DOCUMENTS`; its frames, tables and captures are there."""
    (tmp_path / "one").mkdir()
    for file in ("0.png", "one/capture.json"):
        (tmp_path / file).touch()
    (tmp_path / "board.csv").write_text("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n")
    (tmp_path / "points.csv").write_text("point,x_mm,y_mm,z_mm\nP,0,0,0\nQ,0,9,0\nR,9,0,0\n")
    (tmp_path / "observations.csv").write_text("station,point,u,v,sigma_px\n1,P,2,3,0.1\n2,P,3,3,0.1\n")
    readers: dict[str, tuple[str, Callable[[Path], object]]] = {
        "project": ("project.json", lambda path: read_project(path.parent)),
        "capture": ("capture.json", lambda path: read_capture(path.parent)),
        "picks": ("picks.json", read_picks),
        "network": ("network.json", lambda path: read_network(path.parent)),
    }
    parts: dict[str, Callable[[Any], object]] = {
        "distance": lambda data: read_bar(Fields.of(data, "here")),
        "camera": lambda data: read_device(Fields.of(data, "here")),
        "projector": lambda data: read_device(Fields.of(data, "here"), True),
        "pattern": lambda data: pattern_from_dict(data, "here"),
        "sequence": lambda data: read_sequence(data, "here"),
    }

    def by_name(name: str, data: Any) -> object:
        kind = name.partition(" ")[0]
        if kind in parts:
            return parts[kind](data)
        file, reader = readers[kind]
        (tmp_path / file).write_text(json.dumps(data))
        try:
            return reader(tmp_path / file)
        finally:
            (tmp_path / file).unlink()

    return by_name


@pytest.mark.parametrize("name", DOCUMENTS)
def test_readers_and_schema_know_the_same_keys(
    read: Callable[[str, Any], object], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, found = defaultdict(set), defaultdict(set)
    monkeypatch.setattr(core.patterns.pattern, "_KNOWN", {})

    def document(path: Path, kind: str) -> Fields:
        fields = read_document(path, kind)
        return replace(fields, data=Noted(dict(fields.data), (), asked))

    for module in (core.project.captures, core.project.networks):
        monkeypatch.setattr(module, "read_document", document)
    which, documents = DOCUMENTS[name]
    for data in documents:
        read(name, noted(data, (), asked))
        validator(part(which)).validate(data)
        schema_keys(part(which), data, (), found)
    if not which:
        asked[()] |= {"format", "version"}  # of `read_document` itself
    assert dict(asked) == dict(found)


WRONG = (None, "", "wrong", True, 2.5, 1e13, [], [1, 2], ["x"], {"a": 1})
BOUNDS = {float(bound) for bound in re.findall(r'm(?:in|ax)imum": ([^,}]*)', json.dumps(SCHEMA), re.I)}
NUMBERS = sorted({bound + more for bound in BOUNDS for more in (-1, 0, 1)})  # the least and largest, and those beyond
#: what a schema cannot say, for it is about several values, or other files
BEYOND_SCHEMA = (
    "field of view", "rising levels", "light that rises", "two different", "give both", "principal point",
    "would be moved", "from 0 to 3", "is not there", "cannot be read", "use a name that", "device is", "rigid_with is",
    "rigid with", "known so well",
)  # fmt: skip


def changed(data: Any) -> Iterator[Any]:
    """Documents in which one value after the other is replaced by all that may be wrong, or left out."""

    def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield (*path, key)
            if isinstance(item, dict | list) and item not in (PLAIN, BAR):  # which are tried alone
                yield from places(item, (*path, key))

    for *above, last in places(data):
        held = data
        for key in above:
            held = held[key]
        number = isinstance(held[last], float | int) and not isinstance(held[last], bool)
        for wrong in (*WRONG, ..., *(NUMBERS if number else ())):
            copy = deepcopy(data)
            node = copy
            for key in above:
                node = node[key]
            if wrong is ...:
                del node[last]
            else:
                node[last] = wrong
            yield copy


@pytest.mark.parametrize("name", DOCUMENTS)
def test_readers_and_schema_refuse_the_same(read: Callable[[str, Any], object], name: str) -> None:
    """But for what a schema cannot say."""
    which, documents = DOCUMENTS[name]
    of, met = validator(part(which)), set()
    for data in (wrong for document in documents for wrong in changed(document)):
        told = ""
        try:
            read(name, data)
        except InputError as error:
            told = str(error)
        fits = of.is_valid(data)
        beyond = fits and any(words in told for words in BEYOND_SCHEMA)
        assert fits == (not told) or beyond, f"{told or 'the reader takes it'}: {data}"
        met.add(bool(told))
    assert True in met


def test_a_capture_has_as_many_frames_as_the_reader_takes() -> None:
    assert SCHEMA["$defs"]["capture"]["properties"]["frames"]["maxItems"] == MOST_FRAMES


def test_every_file_of_a_project_fits_the_schema(whole_original: Path) -> None:
    files = [path for name in ("project", "capture", "picks") for path in whole_original.rglob(f"{name}.json")]
    assert len(files) > 30
    for path in files:
        FILES.validate(json.loads(path.read_text()))


def test_the_schema_is_one_and_says_what_every_key_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA
    Draft202012Validator.check_schema(SCHEMA)
    for name, defined in SCHEMA["$defs"].items():
        for key, said in defined.get("properties", {}).items():
            shared = said.get("$ref", "").rpartition("/")[2]
            told = said.keys() | SCHEMA["$defs"].get(shared, {}).keys()
            assert told & {"description", "title", "const"} or name == "camera", f"{name}: {key}"
