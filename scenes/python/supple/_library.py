"""The scenes that come with the package."""
import pathlib

from supple._errors import Error
from supple._supple import read_scene

_HERE = pathlib.Path(__file__).resolve().parent


def _folder():
    places = [_HERE / "scenes/library"]  # of a wheel
    places += [above / "share/supple/scenes/library" for above in _HERE.parents]  # of an installation
    places += [above / "scenes/library" for above in _HERE.parents]  # of a source tree
    for place in places:
        if place.is_dir():
            return place
    raise Error("the library of scenes is not installed beside the package", kind="io", exit_code=4)


def library_scenes() -> list:
    """Names of the scenes that come with the package, for library(): ["contacts/ball_in_ring", ...]."""
    folder = _folder()
    return sorted(str(path.relative_to(folder).with_suffix("")) for path in folder.rglob("*.yaml"))


def library(name: str, overrides=None):
    """Reads a scene of the library by its name, with or without its folder: library("two_balls").

    overrides  as in read_scene

    Raises Error for a name that is not in library_scenes().
    """
    known = library_scenes()
    for scene in known:
        if name in (scene, scene.rsplit("/")[-1]):
            return read_scene(_folder() / f"{scene}.yaml", overrides)
    raise Error(f"name: expected a scene of the library, found {name!r}; known: {', '.join(known)}")
