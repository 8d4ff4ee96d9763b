#!/usr/bin/env python3
"""Hydroelastic contact of Drake and the contact query of supple: force error against CPU time.

    python3 -m venv venv && venv/bin/pip install drake
    venv/bin/python tests/benchmarks/peers/contact_drake.py build/release/bin/contact_rules

Two compliant spheres (R = 0.1 m, E = 1 MPa, overlap 0.1 R) and one on a rigid plane, polygon contact surfaces, at several
resolution hints. All programs run on one thread, one after the other; times are CPU time, the least of several. The closed
forms: F = pi E d^2 (1 - 2 d / 3 R) on the plane, the same with d = R - D / 2 between equal spheres. contact_poses, which is
in the folder of contact_rules, then gives errors in a thousand poses, with all rays and with a single one.
"""
import subprocess
import sys
import time

from math import pi
from pathlib import Path

import numpy
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddRigidHydroelasticProperties,
    HalfSpace,
    HydroelasticContactRepresentation,
    ProximityProperties,
    SceneGraph,
    Sphere,
    GeometryFrame,
    GeometryInstance,
    FramePoseVector,
)
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from importlib.metadata import version

RADIUS, MODULUS, DEPTH = 0.1, 1e6, 0.01
REPEATS = 5


def sphere_properties(resolution):
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(
        resolution_hint=resolution, hydroelastic_modulus=MODULUS, properties=properties)
    return properties


def make_scene(resolution, other):
    """A sphere at the origin, and below it another sphere or a rigid half-space; a context with the poses."""
    graph = SceneGraph()
    source = graph.RegisterSource("bodies")
    frames = [graph.RegisterFrame(source, GeometryFrame(name)) for name in ("a", "b")]

    def add(frame, shape, name, properties):
        instance = GeometryInstance(RigidTransform(), shape, name)
        instance.set_proximity_properties(properties)
        graph.RegisterGeometry(source, frame, instance)

    add(frames[0], Sphere(RADIUS), "ball", sphere_properties(resolution))
    if other == "sphere":
        add(frames[1], Sphere(RADIUS), "other", sphere_properties(resolution))
        below = 2.0 * RADIUS - DEPTH
    else:
        properties = ProximityProperties()
        AddRigidHydroelasticProperties(properties=properties)
        add(frames[1], HalfSpace(), "plane", properties)
        below = RADIUS - DEPTH
    context = graph.CreateDefaultContext()
    poses = FramePoseVector()
    poses.set_value(frames[0], RigidTransform())
    poses.set_value(frames[1], RigidTransform([0.0, 0.0, -below]))
    graph.get_source_pose_port(source).FixValue(context, Value(poses))
    return graph, context, frames, poses, source, below


def query(resolution, other):
    graph, context, frames, poses, source, below = make_scene(resolution, other)
    port = graph.get_query_output_port()
    best, force, faces = 1e9, 0.0, 0
    for repeat in range(REPEATS):
        # A new pose each time, or Drake would answer from its cache.
        poses.set_value(frames[1], RigidTransform([1e-9 * repeat, 0.0, -below]))
        graph.get_source_pose_port(source).FixValue(context, Value(poses))
        answer = port.Eval(context)
        begin = time.process_time()
        surfaces = answer.ComputeContactSurfaces(HydroelasticContactRepresentation.kPolygon)
        best = min(best, time.process_time() - begin)
        total = numpy.zeros(3)
        for s in surfaces:
            faces, field = s.num_faces(), s.poly_e_MN()
            for f in range(faces):
                total += s.area(f) * field.EvaluateCartesian(f, s.centroid(f)) * s.face_normal(f)
        force = numpy.linalg.norm(total)
    return force, best, faces


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    print(f"Drake {version('drake')}\n\n| bodies | resolution / R | faces | force error | CPU ms |\n|---|---|---|---|---|")
    for other, exact, resolutions in (
        ("sphere", pi / 3 * MODULUS / RADIUS * (DEPTH / 2) ** 2 * (3 * RADIUS - DEPTH), (0.25, 0.125, 0.0625, 0.03125, 0.015625)),
        ("plane", pi * MODULUS * DEPTH ** 2 * (1 - 2 * DEPTH / (3 * RADIUS)), (0.25, 0.125, 0.0625, 0.03125)),
    ):
        for share in resolutions:
            force, seconds, faces = query(share * RADIUS, other)
            print(f"| {other} | {share:g} | {faces} | {abs(force / exact - 1):.2e} | {1e3 * seconds:.3f} |", flush=True)
    print("\nsupple\n", flush=True)
    subprocess.run([sys.argv[1]], check=True)
    poses = str(Path(sys.argv[1]).resolve().with_name("contact_poses"))
    for options in (["--all-rays"], []):
        for case in ("equal", "plane"):
            print(f"\ncontact_poses 1000 {case} {' '.join(options)}", flush=True)
            subprocess.run([poses, "1000", case, *options], check=True)


if __name__ == "__main__":
    main()
