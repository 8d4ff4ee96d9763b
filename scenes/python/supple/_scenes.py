"""Scenes from mappings: as the text that the reader takes (JSON is valid YAML)."""
import collections.abc
import json
import os


def _plain(value):
    """Mappings, arrays, numbers and paths of other packages as those of Python."""
    if isinstance(value, collections.abc.Mapping):
        return {str(key): entry for key, entry in value.items()}
    if hasattr(value, "tolist"):  # NumPy
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, collections.abc.Iterable):
        return list(value)
    raise TypeError(f"expected numbers, texts, lists, arrays and mappings in a scene, found {value!r}")


def scene_text(description):
    if not isinstance(description, collections.abc.Mapping):
        raise TypeError(f"description: expected a mapping with the keys of a scene file, found {description!r}")
    keys = dict(description)
    keys.setdefault("schema", 1)
    # The reader takes U+FEFF and others as they are, but not the pairs of escapes that stand for far characters in JSON.
    return json.dumps(keys, default=_plain, ensure_ascii=False)


def scene_of_object(description):
    """A scene with one object, for the field of that object."""
    if not isinstance(description, collections.abc.Mapping):
        raise TypeError(f"object: expected a mapping with the keys of an object, found {description!r}")
    return scene_text({"duration": 1.0, "objects": [{"name": "object", **description}]})
