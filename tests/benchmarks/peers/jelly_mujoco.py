#!/usr/bin/env python3
"""The jelly of `supple bench scenes/jelly` as a flex of MuJoCo: CPU time and error of its steps, one JSON object a line.

    python3 -m venv venv && venv/bin/pip install mujoco
    venv/bin/python tests/benchmarks/peers/jelly_mujoco.py [--seconds 2] [--steps 2e-3,1e-3,5e-4]

The same 4 x 4 x 4 nodes, mass, place, stairs and friction. Bond frames of stiffness k between nodes of the grid store k |e d|^2 / 2 under a strain e, d the
vector of a bond, so the body has Young's modulus k sum d_x^2 / V and no lateral contraction; that modulus goes to MuJoCo. Its nodes collide as balls of nearly
half the spacing, the most that it takes; the surface here lies 0.04 m about a particle. Damping is that of the bonds over their stiffness. Each step is compared with a 16 times finer one than the
finest, up to the first frame at which one 8 times finer is away from that by more than a thousandth of the body's size: what follows is chaos.
"""
import argparse
import json
import time

import mujoco
import numpy as np

SIDE, SPACING, MASS, RANGE = 4, 0.05, 0.01, 0.09  # nodes a side, m, kg, m
STRETCH, RUBBING, RADIUS = 40.0, 0.05, 0.024     # N/m, N s/m, m
RATE = 24.0                                      # frames per second
BODY = (SIDE - 1) * SPACING * np.sqrt(3.0)       # diagonal, m
STAIRS = ((0.0, 0.2), (0.3, 0.125), (0.6, 0.05))  # x and half of the height, m


def modulus():
    """Young's modulus of the grid of bonds [Pa]."""
    index = np.indices((SIDE,) * 3).reshape(3, -1).T * SPACING
    d = index[:, None] - index[None]
    bonds = (np.linalg.norm(d, axis=2) < RANGE) & np.triu(np.ones(d.shape[:2], bool), 1)
    return STRETCH * np.sum(d[bonds][:, 0] ** 2) / ((SIDE - 1) * SPACING) ** 3


def turn(axis):
    """Quaternion (w, x, y, z) of the shortest rotation from z to an axis."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    q = np.array([1.0 + z, -y, x, 0.0])
    return q / np.linalg.norm(q)


def model(step):
    boxes = "".join(f'<geom type="box" pos="{x} 0 {h}" size="0.15 0.4 {h}" friction="0.4 0 0"/>' for x, h in STAIRS)
    quat = " ".join(f"{value:.9f}" for value in turn((0.3, 0.1, 1.0)))
    return mujoco.MjModel.from_xml_string(f"""
<mujoco><option timestep="{step!r}" integrator="discrete" gravity="0 0 -9.81"/><size memory="64M"/>
<worldbody><geom type="plane" size="5 5 1" friction="0.4 0 0"/>{boxes}
<flexcomp name="jelly" type="grid" dim="3" count="{SIDE} {SIDE} {SIDE}" spacing="{SPACING} {SPACING} {SPACING}" pos="0.02 0 0.75" quat="{quat}"
  mass="{SIDE ** 3 * MASS}" radius="{RADIUS}">
<contact selfcollide="none" friction="0.4 0 0"/><elasticity young="{modulus():.9g}" poisson="0" damping="{RUBBING / STRETCH}"/></flexcomp>
</worldbody></mujoco>""")


def run(step, seconds):
    """Positions of the nodes by frame and CPU seconds."""
    scene = model(step)
    data = mujoco.MjData(scene)
    mujoco.mj_forward(scene, data)
    frames, spent = [data.flexvert_xpos.copy()], 0.0
    per_frame = round(1.0 / (RATE * step))
    for _ in range(int(seconds * RATE)):
        begin = time.process_time()
        for _ in range(per_frame):
            mujoco.mj_step(scene, data)
        spent += time.process_time() - begin
        frames.append(data.flexvert_xpos.copy())
    return np.array(frames), spent


def apart(a, b):
    return np.linalg.norm(a - b, axis=2).max(axis=1) / BODY


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--steps", default="2e-3,1e-3,5e-4,2.5e-4", help="in seconds, coarsest first; each becomes a whole part of a frame")
    arguments = parser.parse_args()
    steps = [1.0 / (RATE * round(1.0 / (RATE * float(text)))) for text in arguments.steps.split(",")]
    finest, _ = run(steps[-1] / 16, arguments.seconds)
    second, _ = run(steps[-1] / 8, arguments.seconds)
    parted = apart(second, finest) > 1e-3
    last = int(np.argmax(parted)) - 1 if parted.any() else len(finest) - 1
    for step in steps:
        frames, spent = run(step, arguments.seconds)
        print(json.dumps({"scene": "jelly", "program": f"MuJoCo {mujoco.__version__}", "step_s": step, "cpu_s_per_s": spent / arguments.seconds,
                          "largest_error": float(apart(frames, finest)[: last + 1].max()), "compared_s": last / RATE, "of_s": arguments.seconds,
                          "modulus_pa": modulus(), "finite": bool(np.isfinite(frames).all())}), flush=True)


if __name__ == "__main__":
    main()
