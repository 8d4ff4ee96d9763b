#!/usr/bin/env python3
"""Draws CPU time against error of whole scenes, one curve a scene, as SVG.

    supple bench scenes --accuracy 1e-2 --accuracy 3e-3 --accuracy 1e-3 > rows.jsonl
    scripts/plot_accuracy.py rows.jsonl accuracy.svg

Points are the rows of `supple bench scenes`: the largest error of positions over the size of their object, and CPU seconds per simulated second. A
dashed line leads from each point to the accuracy that was asked for.
"""
import json
import sys

from evidence import plots


def rows_of(lines):
    """Rows by scene, coarsest first; failed scenes and errors of zero are left out."""
    scenes = {}
    for line in lines:
        if not line.startswith("{"):
            continue
        row = json.loads(line)
        if row.get("largest_error", 0.0) > 0.0:
            scenes.setdefault(row["scene"], []).append(row)
    for rows in scenes.values():
        rows.sort(key=lambda row: -row["accuracy"])
    return scenes


def draw(scenes):
    """SVG of what `rows_of` gives."""
    return plots.log_log({name: [(row["largest_error"], row["cpu_s_per_s"]) for row in rows] for name, rows in scenes.items()},
                         "largest error, of the size of the object", "CPU s per simulated s",
                         {name: [row["accuracy"] for row in rows] for name, rows in scenes.items()})


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    with open(sys.argv[1], encoding="utf-8") as lines:
        scenes = rows_of(lines)
    if not scenes:
        print(f"{sys.argv[1]}: expected rows of `supple bench scenes`, found none", file=sys.stderr)
        return 2
    with open(sys.argv[2], "w", encoding="utf-8") as file:
        file.write(draw(scenes))
    return 0


if __name__ == "__main__":
    sys.exit(main())
