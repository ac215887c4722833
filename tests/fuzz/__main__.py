"""Mutated files for all readers, guided by the lines of the program that they reach: ``make fuzz``.

Every input must end as a sound file or in one line (a `StripeError`), within 5 s and 1 GB. What reaches new lines is
mutated further; what fails is kept in tests/fuzz/corpus, which the tests read again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import resource
import signal
import sys
import tempfile
import time
import warnings
import zlib
from pathlib import Path
from types import FrameType
from typing import Any

from core.errors import StripeError
from tests.fuzz.readers import Reader, readers

CORPUS = Path(__file__).parent / "corpus"
PATIENCE_S, MEMORY = 5, 1 << 30
ROOT = str(Path(__file__).parents[2] / "core")
WORDS = (
    b'-1 0 1e308 1e-320 NaN Infinity 99999999999999999999 null true "" [] {} 0.1 2147483648 -0.0 \xff\xfe \x00 , ;'
    b" \n # ../.. white gray phase A1..A6 brown x y"
).split(b" ")
VALUES: list[Any] = [None, True, -1, 0, 1e308, 10**20, "", "x" * 5000, "../../etc", "\x00", [], {}, [[]], {"": {}}, 0.1]


def mutated(data: bytes, other: bytes, rng: random.Random) -> bytes:
    """Change a file a little: by its structure if it is JSON, otherwise by bytes and words."""
    if rng.random() < 0.6:
        try:
            return json.dumps(_other_node(json.loads(data), rng)).encode()
        except (ValueError, RecursionError):
            pass
    found = bytearray(data)
    for _ in range(1 << rng.randrange(5)):
        at, span = rng.randrange(len(found) + 1), 1 << rng.randrange(8)
        match rng.randrange(6):
            case 0 if found:
                found[at % len(found)] = rng.randrange(256)
            case 1 if found:
                found[at % len(found)] ^= 1 << rng.randrange(8)
            case 2:
                del found[at : at + span]
            case 3:
                found[at:at] = rng.choice(WORDS)
            case 4:
                start = rng.randrange(len(other) + 1)
                found[at : at + rng.choice((0, span))] = other[start : start + span]
            case _:
                found[at:at] = found[at : at + span] * rng.choice((1, 2, 50))
    del found[1 << 20 :]
    return checksummed(found) if found.startswith(b"\x89PNG") and rng.random() < 0.8 else bytes(found)


def checksummed(data: bytearray) -> bytes:
    """Give a PNG whose chunks have right checksums, so that its pixels are decoded."""
    at = 8
    while at + 12 <= len(data):
        stop = at + 12 + int.from_bytes(data[at : at + 4], "big")
        if stop > len(data):
            break
        data[stop - 4 : stop] = zlib.crc32(data[at + 4 : stop - 4]).to_bytes(4, "big")
        at = stop
    return bytes(data)


def _other_node(node: Any, rng: random.Random) -> Any:
    """Give a document with one node exchanged, taken out or twice there."""
    if isinstance(node, dict) and node and rng.random() < 0.85:
        key = rng.choice(list(node))
        if rng.random() < 0.1:
            return {k: v for k, v in node.items() if k != key}
        if rng.random() < 0.1:
            return {
                (rng.choice(["", "x" * 300, "version", "a/b", "\u202e"]) if k == key else k): v for k, v in node.items()
            }
        return {**node, key: _other_node(node[key], rng)}
    if isinstance(node, list) and node and rng.random() < 0.85:
        at = rng.randrange(len(node))
        if rng.random() < 0.2:
            return node[:at] + node[at + 1 :] if rng.random() < 0.5 else node + node[at:] * rng.choice((1, 3))
        return [*node[:at], _other_node(node[at], rng), *node[at + 1 :]]
    if isinstance(node, int | float) and rng.random() < 0.5:
        return node * rng.choice((-1, 0, 0.5, 2, 1e9, 1e-9)) + rng.choice((0, 1, -1))
    return rng.choice(VALUES)


class Lines:
    """The lines of the program that were ever reached."""

    def __init__(self) -> None:
        self.seen: set[tuple[str, int]] = set()
        self.new = 0

    def trace(self, frame: FrameType, event: str, argument: object) -> Any:
        name = frame.f_code.co_filename
        if not name.startswith(ROOT):
            return None
        if event == "line" and (name, frame.f_lineno) not in self.seen:
            self.seen.add((name, frame.f_lineno))
            self.new += 1
        return self.trace


def fails(reader: Reader, folder: Path, data: bytes) -> str:
    """Read one input; say what is wrong with how that ends, nothing where all is well."""
    (folder / reader.file).write_bytes(data)

    def late(number: int, frame: FrameType | None) -> None:
        raise TimeoutError

    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE_S)  # of its own time: the machine may be busy
    try:
        reader.read(folder)
    except StripeError as error:
        return "several lines" if len(str(error).splitlines()) != 1 else ""
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return f"{type(error).__name__}: {error}"[:200]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return ""


def search(known: dict[str, Reader], folder: Path, options: argparse.Namespace, began: float) -> dict[str, int]:
    """Fuzz for a number of inputs; keep what failed, and give how often each kind did."""
    rng, lines, done = random.Random(options.seed), Lines(), 0
    failed: dict[str, int] = {}
    pools = {name: [r.seed, *(p.read_bytes() for p in sorted(CORPUS.glob(f"{name}-*")))] for name, r in known.items()}
    while done < options.inputs and time.monotonic() - began < options.seconds:
        name = rng.choice(list(known))
        reader, pool = known[name], pools[name]
        data = mutated(rng.choice(pool), rng.choice(pool), rng)
        traced, lines.new = done % 10 == 0, 0  # tracing costs time
        sys.settrace(lines.trace if traced else None)
        try:
            wrong = fails(reader, folder, data)
        finally:
            sys.settrace(None)
        (folder / reader.file).write_bytes(reader.seed)
        done += 1
        if lines.new:
            pool.append(data)
        if wrong:
            kind = f"{name}: {wrong.split(':')[0]}"
            failed[kind] = failed.get(kind, 0) + 1
            if failed[kind] == 1:
                keep(name, data, wrong)
    reached = f"{len(lines.seen)} lines reached, {sum(map(len, pools.values()))} inputs in the pools"
    took, count = time.monotonic() - began, sum(failed.values())
    print(f"{done} inputs, seed {options.seed}, {took:.0f} s: {reached}, {count} failed", flush=True)
    return failed


def keep(name: str, data: bytes, wrong: str) -> None:
    file = CORPUS / f"{name}-{hashlib.blake2b(data, digest_size=6).hexdigest()}"
    file.write_bytes(data)
    print(f"{name}: {wrong}\n  kept as {file.name}", flush=True)


def main() -> int:
    """Fuzz in a process of its own; the exit code is 1 if an input failed or ended that process."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--reader", default="", help="only readers whose names begin so")
    options, began = parser.parse_args(), time.monotonic()
    warnings.simplefilter("error")
    memory = Path("/dev/shm")  # a file system that no disk slows down
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as place:
        folder = Path(place)
        known = {name: r for name, r in readers(folder).items() if name.startswith(options.reader)}
        if (child := os.fork()) == 0:
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))
            os._exit(1 if search(known, folder, options, began) else 0)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        for name, reader in known.items() if code < 0 else ():
            if (data := (folder / reader.file).read_bytes()) != reader.seed:
                keep(name, data, f"ended the process ({signal.Signals(-code).name})")
        return int(code != 0)


if __name__ == "__main__":
    sys.exit(main())
