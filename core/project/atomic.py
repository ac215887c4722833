"""Where `core.atomic` was found before."""

from core.atomic import atomic_write, write_json

__all__ = ["atomic_write", "write_json"]
