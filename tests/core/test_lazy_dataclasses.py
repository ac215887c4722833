"""The dataclasses of the program do what those of the standard library do."""

import dataclasses
import inspect
import pickle
from typing import Any, ClassVar

import numpy as np
import pytest

from core.lazy import dataclass


def classes(made: Any) -> tuple[Any, Any]:
    """A class with every kind of field that the program uses, and one that inherits from it."""

    @made(frozen=True)
    class Point:
        """A point."""

        kind: ClassVar[str] = "point"
        name: str
        places: tuple[float, ...] = (1.0, 2.0)
        notes: list[str] = dataclasses.field(default_factory=list)
        seen: int = dataclasses.field(default=3, compare=False, repr=False)
        double: str = dataclasses.field(init=False)

        def __post_init__(self) -> None:
            if not self.name:
                raise ValueError("a point has a name")
            object.__setattr__(self, "double", self.name * 2)

    @made(frozen=True)
    class Target(Point):
        """A point on a board."""

        radius: float = 2.5

        def __repr__(self) -> str:
            return f"<{self.name}>"

    return Point, Target


OURS, THEIRS = classes(dataclass), classes(dataclasses.dataclass)


@pytest.mark.parametrize("which", [0, 1])
def test_a_dataclass_equals_that_of_the_standard_library(which: int) -> None:
    ours, theirs = OURS[which], THEIRS[which]

    assert str(inspect.signature(ours)) == str(inspect.signature(theirs))
    assert ours.__match_args__ == theirs.__match_args__
    assert inspect.getdoc(ours) == inspect.getdoc(theirs)
    for arguments in [("a",), ("a", (0.5,)), ("a", (0.5,), ["x"], 4)]:
        one, other = ours(*arguments), theirs(*arguments)
        assert repr(one) == repr(other)
        assert vars(one) == vars(other)
        assert dataclasses.asdict(one) == dataclasses.asdict(other)
        assert vars(dataclasses.replace(one, name="b")) == vars(dataclasses.replace(other, name="b"))


@pytest.mark.parametrize("made", [OURS, THEIRS])
def test_what_is_compared_and_what_is_refused(made: tuple[Any, Any]) -> None:
    point, target = made

    assert point("a") == point("a", seen=5) != point("b")
    assert point("a") != target("a")
    assert hash(point("a", notes=())) == hash(point("a", notes=(), seen=5)) != hash(point("b", notes=()))
    assert point("a").notes is not point("a").notes
    for wrong in (lambda: setattr(point("a"), "name", "b"), lambda: delattr(target("a"), "radius")):
        with pytest.raises(dataclasses.FrozenInstanceError):
            wrong()
    for wrong in (point, lambda: point("a", nothing=1), lambda: target("a", name="b")):
        with pytest.raises(TypeError):
            wrong()
    with pytest.raises(ValueError, match="has a name"):
        target("")


@dataclass(frozen=True, eq=False)
class Held:
    """One with an array: compared by identity, and sent to another process."""

    values: np.ndarray


def test_one_of_no_equality_is_compared_by_identity_and_pickled() -> None:
    held = Held(np.arange(3))

    assert held == held
    assert held != Held(np.arange(3))
    assert len({held, held}) == 1
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(held)).values, held.values)


def test_one_that_is_not_frozen_is_refused() -> None:
    with pytest.raises(TypeError, match="not frozen"):
        dataclass(frozen=False)


@pytest.mark.parametrize(("made", "base"), [(dataclasses.dataclass, OURS[0]), (dataclass, THEIRS[0])])
def test_classes_of_either_kind_inherit_from_the_other(made: Any, base: Any) -> None:
    """A program that imports the core may make more of its classes."""

    @made(frozen=True)
    class Larger(base):
        size: int = 1

    assert repr(Larger("a", size=2)).endswith("Larger(name='a', places=(1.0, 2.0), notes=[], double='aa', size=2)")
    assert Larger("a") == Larger("a") != Larger("a", size=2)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Larger("a").size = 3
    with pytest.raises(TypeError, match="non-frozen"):
        dataclasses.dataclass(type("Loose", (base,), {}))
