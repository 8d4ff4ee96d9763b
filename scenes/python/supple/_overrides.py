"""Overrides of scene keys as the reader takes them."""
import json
import os


def texts(overrides):
    """["key=value", ...] from a mapping or from such strings. Other values than strings are written as JSON, which is valid YAML."""
    if overrides is None:
        return []
    if isinstance(overrides, (str, bytes, os.PathLike)):
        raise TypeError(f"overrides: expected a mapping of keys to values, or a list of 'key=value', found {overrides!r}")
    if not hasattr(overrides, "items"):
        return [str(text) for text in overrides]
    return [f"{key}={value if isinstance(value, str) else json.dumps(value, default=_plain)}" for key, value in overrides.items()]


def _plain(value):
    """NumPy arrays and scalars as Python lists and numbers."""
    if not hasattr(value, "tolist"):
        raise TypeError(f"overrides: expected numbers, texts, lists and mappings, found {value!r}")
    return value.tolist()
