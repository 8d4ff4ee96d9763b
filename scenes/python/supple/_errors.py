"""What the package raises."""
from typing import NamedTuple


class Fault(NamedTuple):
    """One thing that the user can correct. Parts that do not apply are empty."""

    place: str = ""  #: "file:line:column", a path, or an argument
    key: str = ""  #: dotted key path, e.g. "objects[0].skeleton[0].radius"
    expected: str = ""  #: e.g. "expected a length > 0 [m]", or the whole statement
    found: str = ""  #: e.g. "-0.2"
    hint: str = ""  #: e.g. "did you mean 'radius'?"


class Error(ValueError):
    """Something that the user can correct: a faulty scene, a file, a wrong argument, a simulation that diverged.

    kind       "usage", "scene", "io", "diverged", "limit", "corrupt" or "internal"
    exit_code  exit code of the command line tool for this kind
    faults     every fault, as `Fault`
    place, key, expected, found, hint   those of the first fault
    """

    def __init__(self, message, kind="usage", exit_code=2, faults=()):
        super().__init__(message)
        self.kind = kind
        self.exit_code = exit_code
        self.faults = [Fault(*fault) for fault in faults] or [Fault(expected=message)]
        self.place, self.key, self.expected, self.found, self.hint = self.faults[0]


class ContractViolation(RuntimeError):
    """The calling code broke a condition of the library, such as a number of threads below 0."""


for _type in (Fault, Error, ContractViolation):
    _type.__module__ = "supple"
