#!/usr/bin/env python3
"""The pile of `supple bench scenes/pile_rests` in MuJoCo and Drake: CPU time and error of their steps, one JSON object a line.

    python3 -m venv venv && venv/bin/pip install mujoco drake
    venv/bin/python tests/benchmarks/peers/pile_peers.py build/release/bin/supple [--seconds 0.5] [--steps 4e-3,2e-3,1e-3,5e-4]

The same hundred balls in the same places (from the particle table of `supple`), masses, bin and friction. The balls are rigid with a soft contact: the linear spring
that gives the force of `supple query contact` for two balls that overlap by a tenth of their diameter, 1.466 N at 10 mm. Contact damps a bounce as much in both: a tenth of the critical damping.
Each step is compared with a 16 times finer one than the finest, up to the first frame at which one 8 times finer is away from that by more than a thousandth of
the diameter: what follows is chaos.
"""
import argparse
import csv
import json
import pathlib
import subprocess
import tempfile
import time

import numpy as np

RADIUS, MASS, FRICTION, STIFFNESS, RATIO = 0.05, 0.05, 0.3, 146.6, 0.1  # m, kg, 1, N/m, 1
RATE = 24.0                                                            # frames per second
BOXES = (([0, 0, -0.05], [0.36, 0.36, 0.05]), ([-0.34, 0, 0.25], [0.02, 0.36, 0.25]), ([0.34, 0, 0.25], [0.02, 0.36, 0.25]),
         ([0, 0.34, 0.25], [0.32, 0.02, 0.25]), ([0, -0.34, 0.25], [0.32, 0.02, 0.25]))  # centre and half sizes, m


def places(supple):
    """Centres of the balls at the start."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([supple, "run", "pile_rests", "--out", folder + "/run", "--frames", "1-1", "--no-pictures", "--progress", "none", "--set", "output.particles=csv"],
                       check=True, stdout=subprocess.DEVNULL)
        with open(next(pathlib.Path(folder).glob("run/**/*.csv"))) as table:
            return np.array([[float(row[k]) for k in ("x_m", "y_m", "z_m")] for row in csv.DictReader(table)])


class MuJoCo:
    def __init__(self, step, centres):
        import mujoco
        self.api, self.name = mujoco, f"MuJoCo {mujoco.__version__}"
        share = 0.9  # MuJoCo's impedance d: a spring of K needs a reference stiffness of K (1 - d) / (m d), m the mass of one ball against another
        mass = 0.5 * MASS
        reference = STIFFNESS * (1.0 - share) / (mass * share)
        damping = 2.0 * RATIO * np.sqrt(STIFFNESS * mass) * (1.0 - share) / (mass * share)
        geom = f'friction="{FRICTION} 0 0" condim="3" solref="{-reference} {-damping}" solimp="{share} {share} 0.001"'
        boxes = "".join(f'<geom type="box" pos="{" ".join(map(str, c))}" size="{" ".join(map(str, h))}" {geom}/>' for c, h in BOXES)
        balls = "".join(f'<body pos="{x} {y} {z}"><freejoint/><geom type="sphere" size="{RADIUS}" mass="{MASS}" {geom}/></body>' for x, y, z in centres)
        self.model = mujoco.MjModel.from_xml_string(f'<mujoco><option timestep="{step!r}" gravity="0 0 -9.81" cone="elliptic"/><worldbody>{boxes}{balls}</worldbody></mujoco>')
        self.data = mujoco.MjData(self.model)
        self.steps = round(1.0 / (RATE * step))

    def frame(self):
        for _ in range(self.steps):
            self.api.mj_step(self.model, self.data)

    def positions(self):
        return self.data.qpos.reshape(-1, 7)[:, :3].copy()


class Drake:
    def __init__(self, step, centres):
        from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
        from pydrake.math import RigidTransform
        from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
        from pydrake.multibody.tree import SpatialInertia
        from pydrake.systems.analysis import Simulator
        from pydrake.systems.framework import DiagramBuilder
        self.name = "Drake"
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlant(MultibodyPlantConfig(time_step=step, contact_model="point", discrete_contact_approximation="lagged"), builder)

        def surface(stiffness):
            properties = ProximityProperties()
            # Hunt & Crossley's dissipation d with d v = the share of critical damping at 1 cm of depth and 1 m/s.
            AddContactMaterial(dissipation=2.0 * RATIO * np.sqrt(0.5 * MASS / STIFFNESS) / 0.01, point_stiffness=stiffness, friction=CoulombFriction(FRICTION, FRICTION), properties=properties)
            return properties

        for k, (centre, half) in enumerate(BOXES):
            self.plant.RegisterCollisionGeometry(self.plant.world_body(), RigidTransform(centre), Box(*(2.0 * np.array(half))), f"box{k}", surface(2.0 * STIFFNESS))
        self.bodies = []
        for k in range(len(centres)):
            body = self.plant.AddRigidBody(f"ball{k}", SpatialInertia.SolidSphereWithMass(MASS, RADIUS))
            self.plant.RegisterCollisionGeometry(body, RigidTransform(), Sphere(RADIUS), f"ball{k}", surface(2.0 * STIFFNESS))
            self.bodies.append(body)
        self.plant.Finalize()
        diagram = builder.Build()
        self.simulator = Simulator(diagram)
        self.context = self.plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        for body, centre in zip(self.bodies, centres):
            self.plant.SetFreeBodyPose(self.context, body, RigidTransform(centre))
        self.simulator.Initialize()
        self.frames = 0

    def frame(self):
        self.frames += 1
        self.simulator.AdvanceTo(self.frames / RATE)

    def positions(self):
        return np.array([self.plant.EvalBodyPoseInWorld(self.context, body).translation() for body in self.bodies])


def run(program, step, seconds, centres):
    """Centres by frame, CPU seconds and the program's name."""
    scene = program(step, centres)
    frames, spent = [scene.positions()], 0.0
    for _ in range(int(seconds * RATE)):
        begin = time.process_time()
        scene.frame()
        spent += time.process_time() - begin
        frames.append(scene.positions())
    return np.array(frames), spent, scene.name


def apart(a, b):
    return np.linalg.norm(a - b, axis=2).max(axis=1) / (2.0 * RADIUS)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("supple")
    parser.add_argument("--seconds", type=float, default=0.5)
    parser.add_argument("--steps", default="4e-3,2e-3,1e-3,5e-4", help="in seconds, coarsest first; each becomes a whole part of a frame")
    arguments = parser.parse_args()
    steps = [1.0 / (RATE * round(1.0 / (RATE * float(text)))) for text in arguments.steps.split(",")]
    centres = places(arguments.supple)
    for program in (MuJoCo, Drake):
        finest, _, _ = run(program, steps[-1] / 16, arguments.seconds, centres)
        second, _, _ = run(program, steps[-1] / 8, arguments.seconds, centres)
        parted = apart(second, finest) > 1e-3
        last = int(np.argmax(parted)) - 1 if parted.any() else len(finest) - 1
        for step in steps:
            frames, spent, name = run(program, step, arguments.seconds, centres)
            print(json.dumps({"scene": "pile_rests", "program": name, "step_s": step, "cpu_s_per_s": spent / arguments.seconds,
                              "largest_error": float(apart(frames, finest)[: last + 1].max()), "compared_s": last / RATE, "of_s": arguments.seconds,
                              "finite": bool(np.isfinite(frames).all())}), flush=True)


if __name__ == "__main__":
    main()
