"""Plots of the table of a sweep, with matplotlib."""
import itertools

import numpy as np

from supple._errors import Error

_MANY = 12  # lines with a legend
_FAR = 30.0  # ratio of largest to least from which an axis is logarithmic


def _matplotlib():
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError as error:
        raise Error("plot: expected the package matplotlib, found none; install it: pip install matplotlib", kind="usage") from error
    matplotlib.rcParams["svg.hashsalt"] = "supple"  # the same file for the same table
    return Figure


def _numbers(table, name, what):
    if name not in table:
        raise Error(f"{what}: expected a column of the table, found {name!r}; known: {', '.join(table)}")
    if table[name].dtype == object:
        raise Error(f"{what}: expected a column of numbers, found {name!r} of texts")
    return table[name]


def _is_far(values):
    good = values[np.isfinite(values)]
    return good.size > 0 and good.min() > 0 and good.max() >= _FAR * good.min()


def _keys(table, over):
    keys = list(table.parameters[:2]) if over is None else [over] if isinstance(over, str) else list(over)
    if len(keys) not in (1, 2):
        raise Error(f"over: expected one key or two, found {keys!r}")
    return keys


def _short(value):
    return value if isinstance(value, str) else f"{value:.4g}"


def _lines(axes, table, column, key):
    x, y = _numbers(table, key, "over"), _numbers(table, column, "column")
    others = [k for k in table.parameters if k != key]
    groups = sorted(set(zip(*(table[k] for k in others)))) if others else [()]
    for group in groups:
        rows = np.logical_and.reduce([table[k] == v for k, v in zip(others, group)]) if others else np.ones(len(x), bool)
        order = np.argsort(x[rows], kind="stable")
        axes.plot(x[rows][order], y[rows][order], ".-", label=", ".join(f"{k} = {_short(v)}" for k, v in zip(others, group)), linewidth=1, markersize=4)
    if others and len(groups) <= _MANY:
        axes.legend(fontsize="x-small")
    axes.set(xlabel=key, ylabel=column, xscale="log" if _is_far(x) else "linear", yscale="log" if _is_far(y) else "linear")
    axes.grid(True, color="#ddd", linewidth=0.5)


def _map(figure, axes, table, column, keys):
    x, y, z = (_numbers(table, name, what) for name, what in ((keys[0], "over"), (keys[1], "over"), (column, "column")))
    across, up = np.unique(x), np.unique(y)
    if len(set(zip(x, y))) < len(x):
        raise Error(f"over: expected one point for each pair of values, found several; the sweep has the keys {', '.join(table.parameters)}")
    if len(across) * len(up) > 4 * len(x):  # samples lie on no grid
        shown = axes.scatter(x, y, c=z, s=20)
    else:
        grid = np.full((len(up), len(across)), np.nan)
        for a, (i, j) in zip(z, itertools.zip_longest(np.searchsorted(up, y), np.searchsorted(across, x))):
            grid[i, j] = a
        shown = axes.pcolormesh(across, up, np.ma.masked_invalid(grid), shading="nearest", rasterized=False)
    figure.colorbar(shown, ax=axes, label=column)
    axes.set(xlabel=keys[0], ylabel=keys[1], xscale="log" if _is_far(x) else "linear", yscale="log" if _is_far(y) else "linear")


def draw(table, column, over=None, path=None):
    """See Table.plot."""
    keys = _keys(table, over)
    figure = _matplotlib()(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot()
    _lines(axes, table, column, keys[0]) if len(keys) == 1 else _map(figure, axes, table, column, keys)
    failed = int(np.sum(table["outcome"] != "done"))
    if failed:
        axes.set_title(f"{failed} of {table.rows} points have no value", fontsize="small")
    if path is not None:
        figure.savefig(path, metadata={"Date": None} if str(path).endswith(".svg") else None)
    return figure
