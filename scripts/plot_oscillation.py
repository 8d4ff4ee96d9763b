#!/usr/bin/env python3
"""Figure 4 of Lombardo & Puech 1995: oscillation of three particles after their release, under two laws.

Runs scenes/library/figures/oscillation_{lennard_jones,cohesion}.yaml once for every release ratio and draws
sqrt(sum |v_i - mean v|^2), the oscillation measure O(t) per time, as SVG. Python's standard library only.

Example: scripts/plot_oscillation.py --tool build/release/bin/supple --out docs/images/oscillation.svg
"""
import argparse
import csv
import math
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
LAWS = [("lennard_jones", "Lennard-Jones, n = 4"), ("cohesion", "cohesion, a = 12")]
RATIOS = [0.95, 0.85, 0.80, 0.60, 0.55]
COLOURS = ["#1f77b4", "#2ca02c", "#ff7f0e", "#9467bd", "#d62728"]
TOP, BOTTOM, LEFT, WIDTH, HEIGHT, GAP = 40, 50, 70, 380, 300, 60
LOWEST, HIGHEST = -4, 1  # powers of ten of the axis


def shaking(table):
    """O per time [m/s] and the longest side [m] of one particle table."""
    rows = list(csv.DictReader(table.open()))
    v = [[float(row[k]) for k in ("vx_m_s", "vy_m_s", "vz_m_s")] for row in rows]
    x = [[float(row[k]) for k in ("x_m", "y_m", "z_m")] for row in rows]
    mean = [sum(c) / len(v) for c in zip(*v)]
    o = math.sqrt(sum((a - m) ** 2 for p in v for a, m in zip(p, mean)))
    return o, max(math.dist(p, q) for p in x for q in x)


def run(tool, law, ratio, folder):
    """Times [s], O per time [m/s] and whether the particles ended apart."""
    scene = ROOT / "scenes/library/figures" / f"oscillation_{law}.yaml"
    rate = 10.0
    subprocess.run([tool, "run", scene, "--simulate-only", "--quiet", "--progress", "none", "--overwrite", "--out", folder,
                    "--set", f"objects.triangle.particles.radius={ratio / math.sqrt(3.0)!r}",
                    "--set", f"frame_rate={rate}", "--set", "output.particles=csv"], check=True)
    samples = [shaking(table) for table in sorted((folder / "particles").glob("*.csv"))]
    return [k / rate for k in range(len(samples))], [o for o, _ in samples], samples[-1][1] > 3.0


def panel(left, title, curves):
    """One law as a list of SVG elements; curves: (ratio, times, values, apart)."""
    end = max(times[-1] for _, times, _, _ in curves)

    def place(t, o):
        y = (math.log10(max(o, 10.0**LOWEST)) - LOWEST) / (HIGHEST - LOWEST)
        return left + WIDTH * t / end, TOP + HEIGHT * (1.0 - y)

    out = [f'<rect x="{left}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#444"/>',
           f'<text x="{left + WIDTH / 2}" y="{TOP - 14}" text-anchor="middle" font-size="15">{title}</text>',
           f'<text x="{left + WIDTH / 2}" y="{TOP + HEIGHT + 38}" text-anchor="middle">t [s]</text>']
    for power in range(LOWEST, HIGHEST + 1):
        _, y = place(0.0, 10.0**power)
        out.append(f'<line x1="{left}" x2="{left + WIDTH}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>')
        out.append(f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">1e{power}</text>')
    for t in range(0, int(end) + 1, 20):
        x, _ = place(t, 1.0)
        out.append(f'<text x="{x:.1f}" y="{TOP + HEIGHT + 18}" text-anchor="middle">{t}</text>')
    for (ratio, times, values, apart), colour in zip(curves, COLOURS):
        points = " ".join("{:.1f},{:.1f}".format(*place(t, o)) for t, o in zip(times, values))
        dash = ' stroke-dasharray="5 3"' if apart else ""
        out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.2"{dash}/>')
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tool", default=ROOT / "build/release/bin/supple", help="the supple program")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("oscillation.svg"), help="the SVG to write")
    arguments = parser.parse_args()
    width = LEFT + len(LAWS) * (WIDTH + GAP) + 90
    height = TOP + HEIGHT + BOTTOM
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" '
           f'font-size="12"><rect width="100%" height="100%" fill="white"/>',
           f'<text transform="translate(18,{TOP + HEIGHT / 2}) rotate(-90)" text-anchor="middle">O / dt [m/s]</text>']
    with tempfile.TemporaryDirectory() as scratch:
        for column, (law, title) in enumerate(LAWS):
            curves = []
            for ratio in RATIOS:
                times, values, apart = run(arguments.tool, law, ratio, pathlib.Path(scratch) / f"{law}_{ratio}")
                curves.append((ratio, times, values, apart))
                print(f"{law} released at {ratio}: {'apart' if apart else 'back at rest'}", file=sys.stderr)
            out += panel(LEFT + column * (WIDTH + GAP), title, curves)
    for k, (ratio, colour) in enumerate(zip(RATIOS, COLOURS)):
        x, y = width - 105, TOP + 20 + 20 * k
        out.append(f'<line x1="{x}" x2="{x + 24}" y1="{y}" y2="{y}" stroke="{colour}" stroke-width="2"/>'
                   f'<text x="{x + 30}" y="{y + 4}">p = {ratio:.2f}</text>')
    out.append(f'<text x="{width - 105}" y="{TOP + 30 + 20 * len(RATIOS)}" font-size="11">dashed: flew apart</text></svg>')
    arguments.out.write_text("\n".join(out) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
