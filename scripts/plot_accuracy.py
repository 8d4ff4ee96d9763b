#!/usr/bin/env python3
"""Draws CPU time against error of whole scenes, one curve a scene, as SVG.

    supple bench scenes --accuracy 1e-2 --accuracy 3e-3 --accuracy 1e-3 > rows.jsonl
    scripts/plot_accuracy.py rows.jsonl docs/images/accuracy.svg

Points are the rows of `supple bench scenes`: the largest error of positions over the size of their object, and CPU seconds per simulated second. A
dashed line leads from each point to the accuracy that was asked for.
"""
import json
import math
import sys

WIDTH, HEIGHT = 760, 460
LEFT, RIGHT, TOP, BOTTOM = 70, 180, 20, 50
COLOURS = ("#1b9e77", "#d95f02", "#7570b3", "#e7298a", "#66a61e", "#e6ab02", "#a6761d", "#386cb0", "#f0027f", "#bf5b17", "#444444", "#80b1d3")


def rows_of(path):
    """Rows by scene, coarsest first; failed scenes and errors of zero are left out."""
    scenes = {}
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            if not line.startswith("{"):
                continue
            row = json.loads(line)
            if row.get("largest_error", 0.0) > 0.0:
                scenes.setdefault(row["scene"], []).append(row)
    for rows in scenes.values():
        rows.sort(key=lambda row: -row["accuracy"])
    return scenes


class Axis:
    """A logarithmic axis over whole decades."""

    def __init__(self, values, begin, end):
        self.low, self.high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
        self.high = max(self.high, self.low + 1)
        self.begin, self.end = begin, end

    def at(self, value):
        return self.begin + (math.log10(value) - self.low) / (self.high - self.low) * (self.end - self.begin)

    def decades(self):
        return [10.0**k for k in range(self.low, self.high + 1)]


def draw(scenes):
    everything = [row for rows in scenes.values() for row in rows]
    x = Axis([row["largest_error"] for row in everything] + [row["accuracy"] for row in everything], LEFT, WIDTH - RIGHT)
    y = Axis([row["cpu_s_per_s"] for row in everything], HEIGHT - BOTTOM, TOP)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" font-size="12">',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>']
    for value in x.decades():
        out.append(f'<path d="M{x.at(value):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>'
                   f'<text x="{x.at(value):.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{value:g}</text>')
    for value in y.decades():
        out.append(f'<path d="M{LEFT} {y.at(value):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                   f'<text x="{LEFT - 8}" y="{y.at(value) + 4:.1f}" text-anchor="end">{value:g}</text>')
    for k, (scene, rows) in enumerate(scenes.items()):
        colour = COLOURS[k % len(COLOURS)]
        points = [(x.at(row["largest_error"]), y.at(row["cpu_s_per_s"])) for row in rows]
        out.append(f'<polyline points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in points)}" fill="none" stroke="{colour}"/>')
        for (a, b), row in zip(points, rows):
            out.append(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3.5" fill="{colour}"/>'
                       f'<path d="M{a:.1f} {b:.1f}H{x.at(row["accuracy"]):.1f}" stroke="{colour}" stroke-dasharray="2 3" stroke-width="0.7"/>')
        out.append(f'<text x="{WIDTH - RIGHT + 12}" y="{TOP + 16 + 18 * k}" fill="{colour}">{scene}</text>')
    out.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 10}" text-anchor="middle">largest error, of the size of the object</text>')
    out.append(f'<text transform="translate(16 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)" text-anchor="middle">CPU s per simulated s</text></svg>')
    return "\n".join(out) + "\n"


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    scenes = rows_of(sys.argv[1])
    if not scenes:
        print(f"{sys.argv[1]}: expected rows of `supple bench scenes`, found none", file=sys.stderr)
        return 2
    with open(sys.argv[2], "w", encoding="utf-8") as file:
        file.write(draw(scenes))
    return 0


if __name__ == "__main__":
    sys.exit(main())
