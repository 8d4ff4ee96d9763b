#!/usr/bin/env python3
"""Restitution and contact time of a soft ball over stiffness and speed, 200 runs, against the closed form.

    study.py FOLDER [IMAGES]     the sweep goes to FOLDER, plots (with matplotlib) to IMAGES; a second call goes on with what is missing

The pressure in the ball is g (a - r), a its radius and r the distance from its centre, so a rigid plane at depth D presses with
    F = pi g (a D^2 - 2 D^3 / 3) (1 + d D'),                                                        d the dissipation (Hunt & Crossley 1975).
For D << a the second term goes. With G(v) = v / d - log(1 + d v) / d^2 the motion m D'' = -F has the integral
    G(v0) - G(D') = pi g a D^3 / (3 m),
so the speed after the contact, e v0, follows from G(-e v0) = G(v0) whatever the stiffness, and the contact time is the integral of dv / D''.
Without dissipation: T = 2 sqrt(pi) Gamma(4/3) / Gamma(5/6) D_max / v0 = 2.8044 D_max / v0, D_max^3 = 3 m v0^2 / (2 pi g a).
"""
import pathlib
import sys

import numpy as np
import supple

HERE = pathlib.Path(__file__).resolve().parent
MASS, RADIUS, SLOPE, DISSIPATION = 0.2, 0.1, 5.0, 0.3  # of soft_ball.yaml: kg, m, 1/m, s/m
MODULUS, SPEED = "objects.ball.contact.modulus", "variables.speed"


def lost(v, d):
    """G(v): what a contact takes of m / 2 v^2, over m."""
    return v / d - np.log1p(d * v) / d**2


def restitution(v, d):
    """e with G(-e v) = G(v), by bisection."""
    low, high = np.zeros_like(v), np.ones_like(v)
    for _ in range(60):
        e = 0.5 * (low + high)
        more = lost(-e * v, d) < lost(v, d)
        low, high = np.where(more, e, low), np.where(more, high, e)
    return e


def contact_time(g, v, d, whole=False):
    """Integral of dv / D'' over the contact; `whole` keeps the term in D^3.

    v runs from -e v0 to v0 with a zero slope of order two at both ends, which takes away the singularities there.
    """
    nodes, weights = np.polynomial.legendre.leggauss(80)
    s = 0.5 * (nodes + 1)
    low = -restitution(v, d) * v
    at = low[:, None] + (v - low)[:, None] * s**3 * (10 - 15 * s + 6 * s**2)
    slope = (v - low)[:, None] * 30 * (s * (1 - s))**2
    energy = MASS / (np.pi * g)[:, None] * np.maximum(lost(v, d)[:, None] - lost(at, d), 0)
    depth = np.cbrt(3 * energy / RADIUS)
    for _ in range(40 if whole else 0):  # a D^3 / 3 - D^4 / 6 = energy
        depth = np.cbrt(3 * energy / (RADIUS - 0.5 * depth))
    force = np.pi * g[:, None] * (RADIUS * depth**2 - (2 / 3 * depth**3 if whole else 0)) * (1 + d * at)
    return np.sum(0.5 * weights * slope * MASS / force, axis=1)


def study(folder, modulus="1e4:1e6:log20", speed="0.1:1:log10"):
    """The table of the sweep, with the errors against the closed forms."""
    table = supple.sweep(HERE / "soft_ball.yaml", {MODULUS: modulus, SPEED: speed}, folder=folder, measures=HERE / "measures.yaml")
    g, v = SLOPE * table[MODULUS], table[SPEED]
    columns = {name: table[name] for name in table}
    columns["depth_over_radius"] = table["largest_depth_m"] / RADIUS
    columns["restitution_error"] = table["restitution"] / restitution(v, DISSIPATION) - 1
    columns["time_error_small_depth"] = table["contact_time_s"] / contact_time(g, v, DISSIPATION) - 1
    columns["time_error"] = table["contact_time_s"] / contact_time(g, v, DISSIPATION, whole=True) - 1
    columns["impulse_error"] = table["impulse_ns"] / (MASS * v * (1 + restitution(v, DISSIPATION))) - 1
    return supple.Table(columns, table.parameters)


def draw(table, images):
    """The runs with the closed forms for small depth, dashed."""
    figure = table.plot("contact_time_s", MODULUS)
    modulus = np.geomspace(1e4, 1e6, 60)
    for v in np.unique(table[SPEED]):
        figure.axes[0].plot(modulus, contact_time(SLOPE * modulus, np.full(60, v), DISSIPATION), "k--", linewidth=0.5)
    figure.savefig(images / "bounce_contact_time.svg", metadata={"Date": None})
    figure = table.plot("restitution", SPEED)
    v = np.geomspace(0.1, 1, 60)
    figure.axes[0].plot(v, restitution(v, DISSIPATION), "k--", linewidth=0.5)
    figure.axes[0].set_xscale("log")
    figure.savefig(images / "bounce_restitution.svg", metadata={"Date": None})


def main():
    if len(sys.argv) not in (2, 3):
        print(__doc__, file=sys.stderr)
        return 2
    table = study(sys.argv[1])
    print(f"{table.rows} runs, {int(np.sum(table['outcome'] == 'done'))} done")
    print("| depth / radius | runs | restitution | contact time, closed form of the cap | contact time, small depth |\n|---|---|---|---|---|")
    depth = table["depth_over_radius"]
    for low, high in ((0, 0.02), (0.02, 0.05), (0.05, 0.1), (0.1, 0.2), (0.2, 1)):
        rows = (depth >= low) & (depth < high)
        worst = [np.max(np.abs(table[name][rows]), initial=0) for name in ("restitution_error", "time_error", "time_error_small_depth")]
        print(f"| {low:g} to {high:g} | {np.sum(rows)} | " + " | ".join(f"{x:.1e}" for x in worst) + " |")
    if len(sys.argv) == 3:
        draw(table, pathlib.Path(sys.argv[2]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
