"""A seal at the end of a report: who signed it, and a digest of all before, by which any change shows.

The seal is a comment, in HTML as in PDF. It finds changes by accident and by hand; it does not stop somebody who knows
how it is made from sealing another report. For that keep the digests that `stripe-core verify-report` prints elsewhere.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from core.errors import InputError
from core.lazy import dataclass
from core.report.data import SignOff

LARGEST = 1 << 30  # bytes
_KINDS = {".html": (b"<!-- stripe-report ", b" -->\n"), ".pdf": (b"%stripe-report ", b"\n")}
_SIGNED = ("operator", "date", "instrument")


@dataclass(frozen=True)
class Seal:
    """What the seal of a report says, and whether it holds.

    `operator` is empty where nobody had signed; `digest` is the SHA-256 of what stands in the file before its seal.
    """

    intact: bool
    operator: str
    date: str
    instrument: str
    digest: str

    @property
    def words(self) -> str:
        """Say it in one line."""
        who = (
            f"signed by {self.operator}" + (f" on {self.date}" if self.date else "") if self.operator else "not signed"
        )
        return f"{who}, {'unchanged since it was written' if self.intact else 'CHANGED since it was written'}"


def sealed(content: bytes, ending: str, sign_off: SignOff | None) -> bytes:
    """Put the seal at the end of a report's bytes; `ending` is ".html" or ".pdf"."""
    begin, end = _KINDS[ending]
    content = content if content.endswith(b"\n") else content + b"\n"
    signed = {key: getattr(sign_off, key) if sign_off is not None else "" for key in _SIGNED}
    signed["sha256"] = _digest(content, signed)
    # neither comment may hold what could end it
    text = json.dumps(signed).replace("-", "\\u002d").replace(">", "\\u003e").encode("ascii")
    return content + begin + text + end


def verify(path: Path) -> Seal:
    """Read a report and its seal.

    Raises
    ------
    InputError
        If the file cannot be read, or has no seal.
    """
    try:
        if not path.is_file() or path.stat().st_size > LARGEST:
            raise InputError(path, "no report", "give the report.html or report.pdf that the program wrote")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(path, error.strerror or str(error), "give a report that can be read") from error
    at, begin, end = max((content.rfind(b"\n" + begin), begin, end) for begin, end in _KINDS.values())
    if at < 0:
        raise InputError(path, "has no seal: not a report of this version, or cut off", "write the report again")
    body, text = content[: at + 1], content[at + 1 + len(begin) :]
    try:
        signed = json.loads(text.split(end.rstrip(b"\n") or b"\n")[0])
        told = {key: str(signed[key]) for key in (*_SIGNED, "sha256")}
    except (ValueError, KeyError, TypeError, RecursionError):
        return Seal(False, "", "", "", hashlib.sha256(body).hexdigest())
    digest = told.pop("sha256")
    whole = text.endswith(end) and text.count(end.strip() or b"\n") == 1
    return Seal(whole and digest == _digest(body, told), **told, digest=hashlib.sha256(body).hexdigest())


def _digest(content: bytes, signed: dict[str, str]) -> str:
    digest = hashlib.sha256(content)
    digest.update(json.dumps([signed[key] for key in _SIGNED]).encode())
    return digest.hexdigest()
