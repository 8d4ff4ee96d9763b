#!/usr/bin/env python3
"""Error of fits by number of primitives and by time, beside a sphere packing and equal blobs of the same number: a table and two plots (SVG).

Installs the data of scripts/data.sh, runs `supple bench fit` on it, prints the table of docs/fitting.md and writes FOLDER/fit_numbers.svg and
FOLDER/fit_times.svg. The benchmarks are a target of their own: cmake --build build/release --target benchmarks

Example: scripts/fit_curves.py --out docs/images bunny00.off
"""
import argparse
import json
import pathlib
import subprocess
import sys

from evidence import plots

ROOT = pathlib.Path(__file__).resolve().parent.parent
METHODS = {"fit": "fit", "spheres": "spheres", "equal": "equal blobs"}
DISTANCES = {"largest": "largest", "rms": "RMS"}


def rows_of(lines):
    return [json.loads(line) for line in lines if line.startswith("{")]


def curves(rows, key):
    """{name: points of (key, error)}, by method and kind of distance; errors in per cent of the diagonal."""
    out = {}
    for method, method_name in METHODS.items():
        own = sorted((row for row in rows if row["method"] == method), key=lambda row: row[key])
        for distance, distance_name in DISTANCES.items():
            if own:
                out[f"{method_name}, {distance_name}"] = [(row[key], 100.0 * row[distance]) for row in own]
    return out


def table(rows):
    """Lines of Markdown, one for each error that was asked; a method without a surface has dashes."""
    found = {(row["asked"], row["method"]): row for row in rows}
    lines = ["| asked | primitives | " + " | ".join(f"{name}: RMS, largest, seconds" for name in METHODS.values()) + " |", "|---" * (2 + len(METHODS)) + "|"]
    for asked in sorted({row["asked"] for row in rows}, reverse=True):
        cells = []
        for method in METHODS:
            row = found.get((asked, method))
            cells.append(f'{100 * row["rms"]:.2f} %, {100 * row["largest"]:.2f} %, {row["cpu_s"]:.1f}' if row else "-")
        lines.append(f'| {100 * asked:g} % | {found[(asked, "fit")]["primitives"]} | ' + " | ".join(cells) + " |")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="?", default="bunny00.off", help="a mesh or points of scripts/data.sh (default: bunny00.off)")
    parser.add_argument("--tool", type=pathlib.Path, default=ROOT / "build/release/bin/supple", help="the supple program")
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("out/data"), help="folder of the data (default: out/data)")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/data"), help="folder of the plots (default: out/data)")
    parser.add_argument("--errors", nargs="*", default=[], help="over the diagonal (default: 0.1 0.05 0.02 0.01)")
    arguments = parser.parse_args()
    subprocess.run([ROOT / "scripts/data.sh", arguments.folder], check=True, stdout=subprocess.DEVNULL)
    ended = subprocess.run([arguments.tool, "bench", "fit", arguments.folder / arguments.data, *arguments.errors], stdout=subprocess.PIPE, text=True)
    if ended.returncode != 0:
        return ended.returncode
    rows = rows_of(ended.stdout.splitlines())
    print("\n".join(table(rows)))
    error = "distance, % of the diagonal"
    (arguments.out / "fit_numbers.svg").write_text(plots.log_log(curves(rows, "primitives"), "primitives", error), encoding="utf-8")
    (arguments.out / "fit_times.svg").write_text(plots.log_log(curves(rows, "cpu_s"), "CPU s", error), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
