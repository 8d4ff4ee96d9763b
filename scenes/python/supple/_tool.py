"""The command line tool that belongs to this package."""
import os
import pathlib
import shutil
import subprocess

from supple._errors import Error

_HERE = pathlib.Path(__file__).resolve().parent
_KINDS = {1: "internal", 2: "usage", 3: "scene", 4: "io", 5: "diverged", 6: "limit", 7: "corrupt"}


def path():
    """Where it is: named by SUPPLE_TOOL, in the wheel, in the build tree or installation that holds the package, or on the PATH."""
    named = os.environ.get("SUPPLE_TOOL")
    places = [pathlib.Path(named)] if named else []
    places += [_HERE / "bin/supple"] + [above / "bin/supple" for above in _HERE.parents]
    for place in places:
        if place.is_file() and os.access(place, os.X_OK):
            return str(place)
    found = shutil.which("supple")
    if found:
        return found
    raise Error("the command line tool `supple` is not installed beside the package; SUPPLE_TOOL names it", kind="io", exit_code=4)


def call(*words):
    """Runs it without output. Raises Error with what it says where it fails, KeyboardInterrupt where it was interrupted."""
    done = subprocess.run([path(), *map(str, words)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace")
    if done.returncode == 130:
        raise KeyboardInterrupt
    if done.returncode != 0:
        raise Error(done.stderr.strip() or f"supple ended with exit code {done.returncode}", kind=_KINDS.get(done.returncode, "internal"), exit_code=done.returncode)
