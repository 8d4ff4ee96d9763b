#!/usr/bin/env python3
"""The jelly of `supple bench scenes/jelly` as a deformable body of Drake: CPU time and error of its steps, one JSON object a line.

    python3 -m venv venv && venv/bin/pip install drake
    venv/bin/python tests/benchmarks/peers/jelly_drake.py [--seconds 2] [--steps 4e-3,2e-3,1e-3]

The same 4 x 4 x 4 nodes, mass, place, stairs and friction, with the modulus, the damping and the comparison of `jelly_mujoco.py`. Each cell of the grid is six
linear tetrahedra; the surface is that of the grid, as Drake's bodies have no thickness about their mesh.
"""
import argparse
import json
import pathlib
import tempfile
import time

import numpy as np
import pydrake
from pydrake.geometry import (AddRigidHydroelasticProperties, AddContactMaterial, Box, GeometryInstance, Mesh, ProximityProperties)
from pydrake.math import RigidTransform
from pydrake.multibody.fem import DeformableBodyConfig
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.analysis import Simulator
from pydrake.common.eigen_geometry import Quaternion

SIDE, SPACING, MASS, RANGE = 4, 0.05, 0.01, 0.09  # nodes a side, m, kg, m
STRETCH, RUBBING = 40.0, 0.05                    # N/m, N s/m
RATE = 24.0                                      # frames per second
BODY = (SIDE - 1) * SPACING * np.sqrt(3.0)       # diagonal, m
STAIRS = ((0.0, 0.2), (0.3, 0.125), (0.6, 0.05))  # x and half of the height, m
FRICTION = 0.4


def modulus():
    """Young's modulus of the grid of bonds [Pa]."""
    index = np.indices((SIDE,) * 3).reshape(3, -1).T * SPACING
    d = index[:, None] - index[None]
    bonds = (np.linalg.norm(d, axis=2) < RANGE) & np.triu(np.ones(d.shape[:2], bool), 1)
    return STRETCH * np.sum(d[bonds][:, 0] ** 2) / ((SIDE - 1) * SPACING) ** 3


def turn(axis):
    """Shortest rotation from z to an axis."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    q = np.array([1.0 + z, -y, x, 0.0])
    return Quaternion(q / np.linalg.norm(q))


def write_grid(path):
    """The grid about its middle, as a VTK file of tetrahedra."""
    nodes = (np.indices((SIDE,) * 3).reshape(3, -1).T - 0.5 * (SIDE - 1)) * SPACING
    number = lambda c: int((c[0] * SIDE + c[1]) * SIDE + c[2])
    tetrahedra = []
    for cell in np.indices((SIDE - 1,) * 3).reshape(3, -1).T:
        for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
            corners = [cell]
            for axis in order:
                corners.append(corners[-1] + np.eye(3, dtype=int)[axis])
            volume = np.linalg.det([(corners[k] - cell) for k in (1, 2, 3)])
            if volume < 0:
                corners[1], corners[2] = corners[2], corners[1]
            tetrahedra.append([number(c) for c in corners])
    lines = ["# vtk DataFile Version 3.0", "jelly", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {len(nodes)} double"]
    lines += [" ".join(f"{v:.9g}" for v in node) for node in nodes]
    lines += [f"CELLS {len(tetrahedra)} {5 * len(tetrahedra)}"] + ["4 " + " ".join(map(str, t)) for t in tetrahedra]
    lines += [f"CELL_TYPES {len(tetrahedra)}"] + ["10"] * len(tetrahedra)
    path.write_text("\n".join(lines) + "\n")


def surface():
    properties = ProximityProperties()
    AddContactMaterial(properties=properties, friction=CoulombFriction(FRICTION, FRICTION))
    return properties


def run(step, seconds, mesh):
    """Positions of the nodes by frame and CPU seconds."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlant(MultibodyPlantConfig(time_step=step, discrete_contact_approximation="lagged"), builder)
    for k, (x, half) in enumerate(STAIRS):
        properties = surface()
        AddRigidHydroelasticProperties(0.05, properties)
        plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform([x, 0.0, half]), Box(0.3, 0.8, 2.0 * half), f"step{k}", properties)
    properties = surface()
    AddRigidHydroelasticProperties(0.05, properties)
    plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform([0.0, 0.0, -0.5]), Box(4.0, 4.0, 1.0), "floor", properties)
    config = DeformableBodyConfig()
    config.set_youngs_modulus(modulus())
    config.set_poissons_ratio(0.0)
    config.set_mass_density(SIDE ** 3 * MASS / ((SIDE - 1) * SPACING) ** 3)
    config.set_stiffness_damping_coefficient(RUBBING / STRETCH)
    instance = GeometryInstance(RigidTransform(turn((0.3, 0.1, 1.0)), [0.02, 0.0, 0.75]), Mesh(str(mesh), 1.0), "jelly")
    instance.set_proximity_properties(surface())
    model = plant.mutable_deformable_model()
    body = model.RegisterDeformableBody(instance, config, 1.0)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -9.81])
    plant.Finalize()
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    positions = lambda: np.array(model.GetPositions(context, body)).T.copy()
    simulator.Initialize()
    frames, spent = [positions()], 0.0
    for frame in range(1, int(seconds * RATE) + 1):
        begin = time.process_time()
        simulator.AdvanceTo(frame / RATE)
        spent += time.process_time() - begin
        frames.append(positions())
    return np.array(frames), spent


def apart(a, b):
    return np.linalg.norm(a - b, axis=2).max(axis=1) / BODY


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--steps", default="4e-3,2e-3,1e-3", help="in seconds, coarsest first; each becomes a whole part of a frame")
    arguments = parser.parse_args()
    steps = [1.0 / (RATE * round(1.0 / (RATE * float(text)))) for text in arguments.steps.split(",")]
    with tempfile.TemporaryDirectory() as folder:
        mesh = pathlib.Path(folder) / "jelly.vtk"
        write_grid(mesh)
        finest, _ = run(steps[-1] / 16, arguments.seconds, mesh)
        second, _ = run(steps[-1] / 8, arguments.seconds, mesh)
        parted = apart(second, finest) > 1e-3
        last = int(np.argmax(parted)) - 1 if parted.any() else len(finest) - 1
        for step in steps:
            frames, spent = run(step, arguments.seconds, mesh)
            print(json.dumps({"scene": "jelly", "program": f"Drake {pydrake.__version__ if hasattr(pydrake, '__version__') else ''}".strip(), "step_s": step,
                              "cpu_s_per_s": spent / arguments.seconds, "largest_error": float(apart(frames, finest)[: last + 1].max()),
                              "compared_s": last / RATE, "of_s": arguments.seconds, "modulus_pa": modulus(), "finite": bool(np.isfinite(frames).all())}), flush=True)


if __name__ == "__main__":
    main()
