"""Names imported and methods made when they are first asked for, so that nobody waits for what he does not use."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from operator import attrgetter
from typing import TYPE_CHECKING, Any


def attach(package: str, homes: dict[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Give a package its ``__getattr__``, which knows the package's modules too, ``__dir__`` and ``__all__``.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    homes : dict
        For each module the names that come from there, with spaces between them. Beside this a package has the same
        imports under ``if TYPE_CHECKING``, so that type checkers and editors know all of them.
    """
    home = {name: module for module, names in homes.items() for name in names.split()}

    def find(name: str) -> Any:
        if name in home:
            value = getattr(import_module(home[name]), name)
        elif find_spec(f"{package}.{name}"):
            value = import_module(f"{package}.{name}")
        else:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        setattr(sys.modules[package], name, value)
        return value

    def listed() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home})

    return find, listed, sorted(home)


if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:
    _PARAMS = "__dataclass_params__"  # by which the standard library knows frozen classes

    def dataclass(*, frozen, eq=True):
        """As `dataclasses.dataclass` makes frozen classes, in a tenth of its time.

        The standard library compiles six methods for each class that is imported: an eighth of the time that a short
        command takes. Here ``__init__`` is compiled when it is first asked for, and the others are the same functions
        for all classes.
        """
        if not frozen:
            raise TypeError("a class that is not frozen is made by dataclasses.dataclass")

        def of(cls):
            bases = [own for base in cls.__mro__[1:] if (own := vars(base).get(_PARAMS)) is not None and own.frozen]
            for each in bases:  # of frozen classes it makes no others
                each.frozen = False
            made = dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
            for each in (*bases, vars(made)[_PARAMS]):
                each.frozen = True
            methods = {"__init__": _Init(made), "__repr__": _repr, "__setattr__": _refuse, "__delattr__": _refuse}
            if eq:
                methods |= {"__eq__": _eq, "__hash__": _hash}
            for name, method in methods.items():
                if vars(cls).get(name) is None:
                    setattr(made, name, method)
            return made

        return of

    class _Unset:
        def __repr__(self):
            return "<factory>"

    _UNSET = _Unset()

    class _Init:
        """Stands for the ``__init__`` of a class until that is first asked for."""

        def __init__(self, cls):
            self.cls = cls

        def __get__(self, instance, owner):
            self.cls.__init__ = _init(self.cls)
            return self.cls.__init__ if instance is None else self.cls.__init__.__get__(instance)

    def _init(cls):
        """The ``__init__`` of a class from its fields, as the standard library would write it."""
        names = {"_set": object.__setattr__, "_unset": _UNSET}
        parameters, body = ["self"], []
        for at, field in enumerate(field for field in dataclasses.fields(cls) if field.init):
            value = field.name
            if field.default_factory is not dataclasses.MISSING:
                names[f"_{at}"] = field.default_factory
                parameters.append(f"{field.name}=_unset")
                value = f"_{at}() if {field.name} is _unset else {field.name}"
            elif field.default is not dataclasses.MISSING:
                names[f"_{at}"] = field.default
                parameters.append(f"{field.name}=_{at}")
            else:
                parameters.append(field.name)
            body.append(f"_set(self, {field.name!r}, {value})")
        if hasattr(cls, "__post_init__"):
            body.append("self.__post_init__()")
        exec("\n    ".join([f"def __init__({', '.join(parameters)}):", *body, "return"]), names)
        init = names["__init__"]
        init.__annotations__ = {field.name: field.type for field in dataclasses.fields(cls) if field.init} | {
            "return": None
        }
        init.__qualname__, init.__module__ = f"{cls.__qualname__}.__init__", cls.__module__
        return init

    @cache
    def _compared_of(cls):
        """Give what takes out of an instance the tuple of what is compared."""
        names = [field.name for field in dataclasses.fields(cls) if field.compare]
        if len(names) > 1:
            return attrgetter(*names)
        return lambda instance: tuple(getattr(instance, name) for name in names)

    def _repr(self):
        shown = (f"{field.name}={getattr(self, field.name)!r}" for field in dataclasses.fields(self) if field.repr)
        return f"{type(self).__qualname__}({', '.join(shown)})"

    def _eq(self, other):
        if other.__class__ is not self.__class__:
            return NotImplemented
        compared = _compared_of(self.__class__)
        return compared(self) == compared(other)

    def _hash(self):
        return hash(_compared_of(self.__class__)(self))

    def _refuse(self, name, *value):
        raise dataclasses.FrozenInstanceError(f"{type(self).__qualname__} is frozen: {name!r} cannot be changed")
