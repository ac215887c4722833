"""The rig as project.json has it: cameras and projectors by name, and what is known of them before."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from core.errors import InputError
from core.fields import Fields
from core.geometry import LENSES, Lens, distort, lens_of
from core.model import DeviceSpec, Interior, Rig, ScaleBar

MOST_PIXELS = 1_000_000  # along one side of a device
FIELD_DEG = 0.15, 170.0  # along the longer side: telescopes see more, and no lens that maps planes as much
OTHER_C, MOST_OFF = 4.0, 5.0  # times the nominal c, sides of the image off its middle: another device's, or no mm
MOST_BENT = 1.0  # of the way from the middle to a corner, by which a lens may move that corner
MOST_UNSURE = 0.2  # sigma of a length as a share of it: the scale that this gives would be called not estimable
LEAST_UNSURE = 1e-9  # and so would all else beside a length that outweighs every image
BELOW_ZERO = 0.05  # of the full light: so far a response measured over a dark frame may reach below none
KINDS = ("camera", "projector")


def read_device(fields: Fields, may_label: bool = False) -> DeviceSpec:
    """Read a camera or projector of project.json or network.json; the latter may be there to label places alone."""
    if may_label and all(fields.get(key) is None for key in ("pitch_mm", "nominal_c_mm", "interior")):
        size = fields.integer("width", 1, MOST_PIXELS), fields.integer("height", 1, MOST_PIXELS)
        return DeviceSpec(*size, (0.0, 0.0), 0.0, response=_response(fields))
    spec = DeviceSpec(
        fields.integer("width", 1, MOST_PIXELS),
        fields.integer("height", 1, MOST_PIXELS),
        fields.pair("pitch_mm", above=0.0),
        fields.real("nominal_c_mm", above=0.0),
        fields.real("r0_mm", least=0.0, default=None),
        response=_response(fields),
    )
    half = max(spec.width * spec.pitch_mm[0], spec.height * spec.pitch_mm[1]) / 2
    wide = 2 * math.degrees(math.atan2(half, spec.nominal_c_mm))
    if not FIELD_DEG[0] <= wide <= FIELD_DEG[1]:
        seen = (
            f"is {list(spec.pitch_mm)}: with nominal_c_mm {spec.nominal_c_mm:g} the field of view would be {wide:.3g}°"
        )
        raise InputError(fields.where, f"pitch_mm {seen}", "give both in mm, neither in µm or m")
    if (known := fields.optional("interior")) is None:
        return spec
    interior, sigma = _interior(known, spec)
    return replace(spec, interior=interior, interior_sigma=sigma)


def _interior(fields: Fields, spec: DeviceSpec) -> tuple[Interior, tuple[float, ...]]:
    """Interior orientation known before: values plain or as results have them, with their sigmas, or held."""
    lens = LENSES[fields.text("model", default="A1..A6", among=tuple(LENSES))]
    given = fields.optional("sigma") or Fields({}, fields.where)
    hold = fields.flag("hold")
    usual = lens.interior(spec.nominal_c_mm).vector
    values, sigmas = [], []
    for name, key, start in zip(lens.names, lens.keys, usual.tolist(), strict=True):
        field = key if fields.get(key) is not None else name
        entry = fields.get(field)
        if isinstance(entry, Mapping):  # {"value": ..., "sigma": ...}, as `calibrate --json` writes it
            one = fields.nested(field)
            values.append(one.real("value"))
            sigma = one.real("sigma", least=0.0, default=math.inf)
        else:
            values.append(fields.real(field, above=0.0 if name == "c" else None, default=start))
            sigma = math.inf
        told = key if given.get(key) is not None else name
        sigma = given.real(told, least=0.0, default=sigma)
        sigmas.append(0.0 if hold else sigma)
    if unknown := [k for k in given.data if k not in (*lens.names, *lens.keys)]:
        raise given.refuse(
            unknown[0], given.data[unknown[0]], f"name parameters of {lens.name}: {', '.join(lens.keys)}"
        )
    if not 1 / OTHER_C < values[0] / spec.nominal_c_mm < OTHER_C:
        remedy = f"nominal_c_mm is {spec.nominal_c_mm:g}: give both of this device and in mm, not px or m"
        raise InputError(fields.where, f"c_mm is {values[0]:g}", remedy)
    sides = spec.width * spec.pitch_mm[0], spec.height * spec.pitch_mm[1]
    for key, off, side in zip(("x0_mm", "y0_mm"), values[1:3], sides, strict=True):
        if abs(off) > MOST_OFF * side:
            remedy = f"the image measures {side:.3g} mm: give the principal point in mm from its middle, not in px"
            raise InputError(fields.where, f"{key} is {off:g}", remedy)
    r0 = fields.real("r0_mm", least=0.0, default=spec.zero_radius_mm)
    interior = Interior(values[0], values[1], values[2], tuple(values[3:]), r0, lens.name)
    _check_distortion(fields.where, interior, sides)
    return interior, tuple(sigmas)


def _check_distortion(where: str, interior: Interior, sides: tuple[float, float]) -> None:
    """Refuse parameters that throw the corners of the image about; the one that alone does most of it is named."""
    lens, corner = lens_of(interior), float(np.hypot(*sides)) / 2
    xy = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * sides

    def moved(a: Sequence[float]) -> float:
        off = distort(replace(interior, x0_mm=0.0, y0_mm=0.0, a=tuple(a)), xy) - xy
        return float(np.linalg.norm(off, axis=1).max())

    if (far := moved(interior.a)) <= MOST_BENT * corner:
        return
    alone = [moved([a if k == j else 0.0 for j in range(len(interior.a))]) for k, a in enumerate(interior.a)]
    worst = alone.index(max(alone))
    seen = f"{lens.keys[3 + worst]} is {interior.a[worst]:g}: a corner of the image, {corner:.3g} mm from its middle"
    remedy = "correct it, and see the units of the lens's parameters"
    raise InputError(where, f"{seen}, would be moved by {far:.3g} mm", remedy)


def _response(fields: Fields) -> tuple[tuple[float, float], ...]:
    pairs: list[tuple[float, float]] = []
    for i, item in enumerate(fields.items("response", [])):
        pair = Fields({"pair": item}, f"{fields.where}: response, entry {i}").pair("pair")
        if pairs and pair[0] <= pairs[-1][0]:
            raise fields.refuse(f"response, entry {i},", item, "give [level, light] with rising levels")
        pairs.append(pair)
    light = [value for _, value in pairs]
    if len(pairs) > 1 and (light[-1] <= light[0] or min(light) < -BELOW_ZERO * light[-1]):
        raise fields.refuse("response", [list(pair) for pair in pairs], "give [level, light] with light that rises")
    return tuple(pairs)


def read_rig(fields: Fields) -> Rig:
    """Read the cameras and projectors of project.json; `camera` and `projector` are one device of that name."""
    found: dict[str, dict[str, DeviceSpec]] = {}
    for kind in KINDS:
        many, own = f"{kind}s", found.setdefault(kind, {})
        if devices := fields.optional(many):
            for name in devices.data:
                if not name or any(c in name for c in "/.:\\") or name.strip() != name:
                    raise InputError(devices.where, f"a device is named {name!r}", "use letters, digits, - and _")
                own[name] = read_device(devices.nested(name), kind == "projector")
        if fields.get(kind) is not None or not own:
            if kind in own:
                raise fields.refuse(kind, "given twice", f"keep it under {many!r} only")
            own[kind] = read_device(fields.nested(kind), kind == "projector")
    if both := found["camera"].keys() & found["projector"].keys():
        raise fields.refuse("projectors", sorted(both)[0], "give every device a name of its own")
    rig = Rig(found["camera"], found["projector"])
    joined = ["-".join(pair) for pair in rig.pairs]
    if twice := sorted(name for name in set(joined) if joined.count(name) > 1):
        raise InputError(fields.where, f"{twice[0]!r} means two pairs of camera and projector", "rename a device")
    return rig


def rig_to_dict(rig: Rig) -> dict[str, Any]:
    """Give a rig as project.json holds it: one camera called "camera" in the short form."""
    data: dict[str, Any] = {}
    for kind, devices in (("camera", rig.cameras), ("projector", rig.projectors)):
        if list(devices) == [kind]:
            data[kind] = device_to_dict(devices[kind])
        else:
            data[f"{kind}s"] = {name: device_to_dict(spec) for name, spec in devices.items()}
    return data


def rig_version(rig: Rig) -> int:
    """Version of the interchange format that a rig needs."""
    short = list(rig.cameras) == ["camera"] and list(rig.projectors) == ["projector"]
    plain = all(spec.interior is None and not spec.response and not spec.labels_only for spec in rig.devices.values())
    return 1 if short and plain else 2


def device_to_dict(spec: DeviceSpec) -> dict[str, Any]:
    """Give a device as project.json holds it."""
    data: dict[str, Any] = {"width": spec.width, "height": spec.height}
    if not spec.labels_only:
        data |= {"pitch_mm": list(spec.pitch_mm), "nominal_c_mm": spec.nominal_c_mm}
    if spec.r0_mm is not None:
        data["r0_mm"] = spec.r0_mm
    if spec.interior is not None:
        data["interior"] = _interior_to_dict(LENSES[spec.interior.model], spec.interior, spec.interior_sigma)
    if spec.response:
        data["response"] = [list(pair) for pair in spec.response]
    return data


def _interior_to_dict(lens: Lens, interior: Interior, sigma: tuple[float, ...]) -> dict[str, Any]:
    values = dict(zip(lens.keys, interior.vector.tolist(), strict=True))
    known = {k: s for k, s in zip(lens.keys, sigma, strict=False) if math.isfinite(s)}
    if len(known) == len(lens.keys) and not any(known.values()):
        return {"model": lens.name, **values, "r0_mm": interior.r0_mm, "hold": True}
    return {"model": lens.name, **values, "r0_mm": interior.r0_mm, **({"sigma": known} if known else {})}


def read_bar(bar: Fields) -> ScaleBar:
    """Read a measured distance between two targets."""
    ends = [_target(bar, key) for key in ("from", "to")]
    if ends[0] == ends[1]:
        raise bar.refuse("to", list(ends[1]), "name two different targets")
    return ScaleBar(ends[0], ends[1], *read_length(bar))


def _target(bar: Fields, key: str) -> tuple[int, int]:
    ends = bar.items(key)
    if len(ends) != 2:
        raise bar.refuse(key, ends, "give row and column of a target")
    target = Fields(dict(zip(("row", "col"), ends, strict=True)), f"{bar.where}: {key}")
    return target.integer("row"), target.integer("col")


def read_length(bar: Fields) -> tuple[float, float]:
    """Read a length and its sigma, mm."""
    length, sigma = bar.real("length_mm", 0.0), bar.real("sigma_mm", 0.0)
    if sigma > MOST_UNSURE * length:
        raise bar.refuse("sigma_mm", sigma, f"length_mm is {length:g}: give both in mm, or leave this length out")
    if sigma < LEAST_UNSURE * length:
        raise bar.refuse(
            "sigma_mm", sigma, f"no length of {length:g} mm is known so well: give what the certificate does"
        )
    return length, sigma


def bar_to_dict(bar: ScaleBar) -> dict[str, Any]:
    """Give a measured distance as project.json holds it."""
    ends = {"from": list(bar.start), "to": list(bar.stop)}
    return {**ends, "length_mm": bar.length_mm, "sigma_mm": bar.sigma_mm}
