"""Sweeps and fits: a scene at many values of its keys, and values that reproduce a measurement.

    import supple

    table = supple.sweep("two_balls", {"objects.left.contact.modulus": "1e3:1e6:log9", "objects.left.contact.friction": [0, 0.3]},
                         measures={"peak": {"pair": ["left", "right"], "take": "peak_force"}})
    print(table["objects.left.contact.modulus"], table["peak"])

Points run in processes of the command line tool, as `supple sweep` runs them. Tables need NumPy only; pandas, pyarrow, matplotlib and SciPy are
used where a call names them.
"""
import collections.abc
import csv
import json
import os
import pathlib
import tempfile
from typing import NamedTuple

import numpy as np

from supple import _tool
from supple._errors import Error
from supple._library import library, library_scenes
from supple._overrides import _plain
from supple._scenes import scene_text
from supple._supple import Scene, parse_scene, read_scene

__all__ = ["Fit", "Table", "fit_parameters", "read_table", "sweep"]


def _need(module, what, package):
    """A module that only some calls use."""
    import importlib
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise Error(f"{what}: expected the package {package}, found none; install it: pip install {package}", kind="usage") from error


class Table(collections.abc.Mapping):
    """Rows of a sweep, by columns: NumPy arrays of numbers (NaN where a row has no value), or of texts.

    Columns are "point", the keys with several values, "outcome", the measures, and "reason". Rows are in the order of the points; those of points that
    failed have their outcome and no measures.
    """

    def __init__(self, columns, parameters=()):
        self._columns = dict(columns)
        self._parameters = tuple(parameters)

    @property
    def parameters(self):
        """Keys with several values."""
        return self._parameters

    def __getitem__(self, name):
        try:
            return self._columns[name]
        except KeyError:
            raise KeyError(f"{name!r}; columns: {', '.join(self._columns)}") from None

    def __iter__(self):
        return iter(self._columns)

    def __len__(self):
        """Number of columns; of rows: table.rows."""
        return len(self._columns)

    @property
    def rows(self):
        """Number of rows."""
        return len(next(iter(self._columns.values()), ()))

    def done(self):
        """The rows whose outcome is "done"."""
        good = self["outcome"] == "done"
        return Table({name: values[good] for name, values in self._columns.items()}, self._parameters)

    def to_pandas(self):
        """As a pandas DataFrame. Needs pandas."""
        return _need("pandas", "to_pandas", "pandas").DataFrame(dict(self._columns))

    def write_parquet(self, path):
        """Writes a Parquet file. Needs pyarrow."""
        arrow = _need("pyarrow", "write_parquet", "pyarrow")
        _need("pyarrow.parquet", "write_parquet", "pyarrow").write_table(arrow.table(dict(self._columns)), os.fspath(path))

    def plot(self, column, over=None, path=None):
        """Draws a column over one key (lines, one for each combination of the other keys) or over two keys (a map of colours). Needs matplotlib.

        over   a key, or two; default: the first one or two of the sweep
        path   file to write: .svg, .png or .pdf

        Returns the matplotlib figure.
        """
        from supple import _plots
        return _plots.draw(self, column, over, path)

    def __repr__(self):
        return f"<supple.Table of {self.rows} rows: {', '.join(self._columns)}>"


def _column(cells):
    """Numbers where all cells that hold something are numbers; else texts."""
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return np.array(cells, dtype=object)


def read_table(folder) -> Table:
    """The table of a sweep, from its folder.

    Raises Error where there is none.
    """
    folder = pathlib.Path(folder)
    try:
        with open(folder / "table.csv", newline="", encoding="utf-8") as file:
            names, *rows = csv.reader(file)
        plan = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise Error(f"{folder}: expected the folder of a sweep with its table.csv, found {error.strerror}; supple sweep FOLDER --collect makes it", kind="io", exit_code=4) from error
    columns = {}
    for name, *cells in zip(names, *rows):
        texts = name in ("outcome", "reason")
        columns[name] = np.array(cells, dtype=object) if texts else _column(cells)
    columns["point"] = columns["point"].astype(int)
    return Table(columns, plan["parameters"])


def _scene_file(scene, folder):
    """The file of a scene, the settings that it was read with, and what it may read. A scene without a file gets one in the folder."""
    if isinstance(scene, (str, os.PathLike)):
        return os.fspath(scene), [], []
    if isinstance(scene, Scene):
        text, name, _, overrides, allowed = scene.__getstate__()
        if scene.source.is_file() and scene.source.read_text(encoding="utf-8") == text:
            return str(scene.source), list(overrides), list(allowed)
    else:
        text, name, overrides, allowed = scene_text(scene), "scene.yaml", [], []
    path = pathlib.Path(folder) / f"{pathlib.Path(name).stem}.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path), list(overrides), list(allowed)


def _setting(key, values):
    text = values if isinstance(values, str) else json.dumps(values, default=_plain)
    return f"{key}={text}"


def _measure_file(measures, folder):
    if isinstance(measures, (str, os.PathLike)):
        return os.fspath(measures)
    path = pathlib.Path(folder) / "measures.yaml"
    path.write_text(json.dumps(measures, default=_plain, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return str(path)


def sweep(scene, parameters, *, folder=None, measures=None, sample=None, seed=1, jobs=None, threads=1) -> Table:
    """Runs a scene at many values of its keys, as `supple sweep` does. Returns the Table of all points.

    scene       a file, the name of a library scene, a Scene, or a mapping with the keys of a scene file
    parameters  {key: values}: "a:b:N", "a:b:logN", a list or an array of values, one value for all points; with `sample` also "a:b" and "a:b:log"
    folder      of the sweep; the same call again goes on with what is missing there. Default: one that is removed afterwards
    measures    columns of the table by name, as a mapping or a file: {"peak": {"pair": ["ball", "floor"], "take": "peak_force"}}
    sample      "random:N" or "lhs:N": N points by chance instead of all combinations; seed of the choice
    jobs        points that run at the same time; default: one per processor
    threads     number of threads of each point; does not change results

    Raises Error for keys, values and measures that the scene does not have, before the first run. Points that fail are rows with their outcome.
    """
    if folder is None:
        with tempfile.TemporaryDirectory(prefix="supple_sweep_") as place:
            return sweep(scene, parameters, folder=place, measures=measures, sample=sample, seed=seed, jobs=jobs, threads=threads)
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path, settings, allowed = _scene_file(scene, folder)
    words = [path, "--out", folder, "--quiet", "--progress", "none", "--seed", seed, "--threads", threads]
    for setting in settings:
        words += ["--set", setting if "=[" not in setting else setting.replace("=[", "=[[", 1) + "]"]
    for key, values in parameters.items():
        words += ["--set", _setting(key, values)]
    for one in allowed:
        words += ["--allow-path", one]
    if measures is not None:
        words += ["--measure", _measure_file(measures, folder)]
    if sample is not None:
        words += ["--sample", sample]
    if jobs is not None:
        words += ["--jobs", jobs]
    _tool.call("sweep", *words)
    return read_table(folder)


class Fit(NamedTuple):
    """Values of keys that reproduce a measurement best."""

    values: dict  #: by key
    errors: dict  #: standard deviations of the values, by key; from the residuals, NaN with as many keys as numbers
    measured: np.ndarray  #: what the measure gives at these values
    residual: float  #: root mean square of measured - target
    evaluations: int  #: scenes that were measured
    message: str  #: how the search ended


class _Range:
    """One key: its bounds, in the logarithm where they are a factor of ten or more apart."""

    def __init__(self, key, given):
        values = [float(v) for v in np.atleast_1d(np.asarray(given, dtype=float))]
        if len(values) not in (2, 3) or not all(np.isfinite(values)) or sorted(values) != values or values[0] == values[-1]:
            raise Error(f"parameters: {key}: expected (low, high) or (low, start, high), ascending, found {given!r}")
        self.key, self.low, self.high = key, values[0], values[-1]
        self.log = self.low > 0 and self.high >= 10 * self.low
        self.start = self.share(values[1]) if len(values) == 3 else 0.5

    def share(self, value):
        return np.log(value / self.low) / np.log(self.high / self.low) if self.log else (value - self.low) / (self.high - self.low)

    def value(self, share):
        return float(self.low * (self.high / self.low) ** share if self.log else self.low + share * (self.high - self.low))

    def slope(self, share):
        """d value / d share."""
        return self.value(share) * np.log(self.high / self.low) if self.log else self.high - self.low


def _scene_with(scene, values):
    if isinstance(scene, (str, os.PathLike)):
        known = os.path.exists(scene)
        return read_scene(scene, values) if known or not isinstance(scene, str) or not _in_library(scene) else library(scene, values)
    if isinstance(scene, Scene):
        text, name, folder, overrides, allowed = scene.__getstate__()
        return parse_scene(text, list(overrides) + [_setting(k, v) for k, v in values.items()], name=name, folder=folder, allowed=allowed)
    return Scene(scene, values)


def _in_library(name):
    return any(name in (one, one.rsplit("/")[-1]) for one in library_scenes())


def _measured(scene, values, measure):
    if callable(measure):
        return np.atleast_1d(np.asarray(measure(_scene_with(scene, values)), dtype=float))
    row = sweep(scene, {key: [value] for key, value in values.items()}, measures=measure)
    names = list(row)[list(row).index("outcome") + 1:-1]
    return np.array([row[name][0] for name in names], dtype=float)


def fit_parameters(scene, parameters, measure, target, *, tolerance=1e-8, step=1e-3) -> Fit:
    """Finds values of keys with which a scene reproduces a measurement, by least squares (SciPy, trust region reflective). Needs SciPy.

    scene       as in sweep
    parameters  {key: (low, high)} or {key: (low, start, high)}; bounds a factor of ten or more apart are searched in the logarithm
    measure     called with a Scene: the numbers that are compared with `target`. Or measures as in sweep, whose values are compared in their order
    target      the numbers to reproduce
    tolerance   of the search: relative changes of residual and values that end it
    step        of differences, as a share of the range of a key; larger than the noise of the measure

    Returns a Fit. Raises Error for numbers that are not finite or not as many as those of `target`.
    """
    optimize = _need("scipy.optimize", "fit_parameters", "scipy")
    ranges = [_Range(key, given) for key, given in parameters.items()]
    target = np.atleast_1d(np.asarray(target, dtype=float))
    count = 0

    def values_at(shares):
        return {r.key: r.value(s) for r, s in zip(ranges, shares)}

    def residuals(shares):
        nonlocal count
        count += 1
        found = _measured(scene, values_at(shares), measure)
        if found.shape != target.shape or not np.all(np.isfinite(found)):
            raise Error(f"measure: expected {target.size} finite numbers, as target has, found {found!r} at {values_at(shares)}")
        return found - target

    scale = max(float(np.sqrt(np.mean(target**2))), np.finfo(float).tiny)
    found = optimize.least_squares(lambda s: residuals(s) / scale, [r.start for r in ranges], bounds=(0, 1), x_scale="jac", diff_step=step,
                                   xtol=tolerance, ftol=tolerance, gtol=None)
    free = target.size - len(ranges)
    spread = np.full(len(ranges), np.nan)
    if free > 0:
        spread = np.sqrt(np.abs(np.diag(np.linalg.pinv(found.jac.T @ found.jac))) * 2 * found.cost / free)
    return Fit(values=values_at(found.x), errors={r.key: float(s * r.slope(x)) for r, s, x in zip(ranges, spread, found.x)},
               measured=found.fun * scale + target, residual=float(scale * np.sqrt(np.mean(found.fun**2))), evaluations=count, message=found.message)
