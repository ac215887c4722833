"""What a format is: a name, what it holds, how it is written and read."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from core.atomic import write_together
from core.errors import InputError
from core.fields import LARGEST as FARTHEST
from core.fields import regular
from core.lazy import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator
    from xml.etree import ElementTree

    from core.exchange.pinhole import Pair

METRE_MM = 1000.0
LARGEST = 4 << 20  # bytes; calibrations have a few thousand
LARGEST_YAML = 1 << 20  # characters, two seconds
DEEPEST = 20  # lists within lists; libyaml takes quadratic time for thousands, and the stack for tens of thousands


@dataclass(frozen=True)
class Format:
    """A format of calibrations."""

    name: str
    free: tuple[str, ...]  #: the distortion parameters it has
    write: Callable[[Pair, Path], list[Path]]  #: ``(pair, path) -> files``
    #: ``(path, names) -> pair``; what is missing or no number is an `InputError`. `names` are the devices wanted, for
    #: formats with one device a file
    read: Callable[[Path, Sequence[str]], Pair]
    endings: tuple[str, ...]  #: of file names, the usual one first; any other is taken as that


def second_file(path: Path, name: str = "projector") -> Path:
    """Where a further device stands in formats that have one a file."""
    return path.with_name(f"{path.stem}-{name}{path.suffix}")


def further_files(path: Path, names: Sequence[str]) -> list[Path]:
    """Where devices of these names stand, the first one in `path`; of two the other may be called the projector."""
    if len(names) <= 2 and not any(second_file(path, name).exists() for name in names[1:]):
        return [second_file(path)]
    return [second_file(path, name) for name in names[1:]]


def from_first(
    first: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Give the pose R, t of a device from another, from those of both from a third frame."""
    R = other[0] @ first[0].T
    return R, other[1] - R @ first[1]


def write_texts(texts: Mapping[Path, str]) -> list[Path]:
    """Write text files, all of them or none."""
    return write_together({path: text.encode() for path, text in texts.items()})


def read_text(path: Path) -> str:
    """Read a text file of sensible size."""
    try:
        return read_bytes(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(path, "no text", "give the file of a calibration") from error


def read_bytes(path: Path) -> bytes:
    """Read a file of sensible size."""
    try:
        if regular(path).stat().st_size > LARGEST:
            raise InputError(path, f"{path.stat().st_size} bytes", "give the file of a calibration")
        return path.read_bytes()
    except OSError as error:
        raise InputError(path, error.strerror or str(error), "give the file of a calibration") from error


@contextmanager
def reading(path: Path, form: str) -> Iterator[None]:
    """Turn what goes wrong with foreign contents into one line."""
    try:
        yield
    except InputError:
        raise
    except KeyError as error:
        raise InputError(
            path, f"{error.args[0]!r} is missing", f"give a file of camera and projector in the {form} format"
        ) from error
    except ValueError as error:
        raise InputError(path, f"not the {form} format ({error})", "choose its format with --from") from error
    except (TypeError, IndexError, AttributeError, RecursionError, OverflowError) as error:  # Python's own words
        raise InputError(path, f"not laid out as the {form} format", "choose its format with --from") from error


def numbers(values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Give finite numbers of a shape; a dimension of -1 takes any length."""
    try:
        found = np.asarray(values, dtype=np.float64)
    except ValueError:
        raise ValueError("a matrix of other entries than numbers, or of unequal rows") from None
    if len(shape) == 1:
        found = found.ravel()
    elif found.size == np.prod(shape):
        found = found.reshape(shape)
    if found.ndim != len(shape) or any(w not in (-1, s) for w, s in zip(shape, found.shape, strict=True)):
        raise ValueError(f"numbers of shape {found.shape} in place of {shape}")
    if not (np.abs(found) <= FARTHEST).all():
        raise ValueError("a number is not finite, or far beyond any of a rig")
    return found


def matrix(stored: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Give the numbers of a matrix: rows, cols and data as OpenCV and ROS write them, or plain lists."""
    return numbers(stored["data"] if isinstance(stored, Mapping) else stored, shape)


def yaml_mapping(path: Path, form: str, text: str | None = None) -> Mapping[str, Any]:
    """Read a YAML file that holds a mapping, or its text; OpenCV's directive and tags are passed over."""
    import yaml

    text = re.sub(r"\A%YAML.*|!!opencv-matrix\b", "", read_text(path) if text is None else text)
    if len(text) > LARGEST_YAML:
        raise InputError(path, f"{len(text)} characters", "give the file of a calibration")
    nested = np.cumsum([(c in "[{") - (c in "]}") for c in re.findall(r"[][{}]", text)])
    if nested.max(initial=0) > DEEPEST or re.search(rf"(?:[-?:][ \t]+){{{DEEPEST}}}", text):
        raise InputError(path, f"nested more than {DEEPEST} deep", f"export it as {form} again")
    try:
        data = yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # six times as fast
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(path, "no YAML", f"export it as {form} again") from error
    if not isinstance(data, dict):
        raise InputError(path, "no mapping", f"export it as {form} again")
    return data


def xml_root(text: str) -> ElementTree.Element:
    """Read XML without a document type, which calibrations do not have."""
    from xml.etree import ElementTree

    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("a document type, which calibrations do not have")
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError("no XML") from error


def flow(values: Any) -> str:
    """Numbers as a YAML list on one line."""
    return "[" + ", ".join(repr(float(v)) for v in np.asarray(values).ravel()) + "]"


def coefficients(values: Any) -> tuple[float, ...]:
    """OpenCV's distortion coefficients, 4, 5 or 8 of them, as eight."""
    found = numbers(values, (-1,))
    if len(found) > 8 and np.any(found[8:] != 0):
        raise ValueError("thin prisms or a tilted sensor, which this program does not have")
    found = np.concatenate([found[:8], np.zeros(max(0, 8 - len(found)))])
    return tuple(found.tolist())


NOTE = "# parameter_covariance: "


def noted(pair: Pair) -> str:
    """Give the covariance of a pair as a comment, for formats whose readers know no further entries."""
    return "" if pair.covariance is None else f"{NOTE}{' '.join(repr(float(v)) for v in pair.covariance.ravel())}\n"


def noted_covariance(text: str) -> np.ndarray | None:
    """Read what `noted` wrote."""
    line = next((line for line in text.splitlines() if line.startswith(NOTE)), None)
    return None if line is None else covariance([float(v) for v in line[len(NOTE) :].split()])


def covariance(values: Any) -> np.ndarray:
    """Give the covariance of a `Pair`, which all formats carry as an entry or a comment of this program's own."""
    found = numbers(values, (30, 30))
    if np.abs(found - found.T).max() > 1e-6 * np.abs(found).max() or np.diagonal(found).min() < 0:
        raise ValueError("parameter_covariance is none")
    return found
