"""Soft objects that touch exactly: scenes, simulations and their results as NumPy arrays.

    import supple

    scene = supple.read_scene("two_balls.yaml", {"objects.left.particles.mass": 0.3})
    simulation = supple.Simulation(scene)
    for frame in simulation.frames():
        print(frame, simulation.time, simulation.particles.position[0])
    print(simulation.audits(), simulation.state_hash)

Units are SI. Vectors are rows of arrays of shape (n, 3), quaternions rows x, y, z, w that map body axes to world axes.
Without files: Scene({...}) takes a scene as a mapping, Field({...}) and contact(a, b) need no scene. supple.notebook shows pictures and
films in Jupyter, supple.usd makes USD crates. sweep(...) runs a scene at many values of its keys, fit_parameters(...) finds values that reproduce a
measurement. fit(...) makes an object from a mesh.

Arrays that are called views show the library's own memory: they follow the simulation and cannot be written to.
"""
from supple._errors import ContractViolation, Error, Fault
from supple._library import library, library_scenes
from supple._supple import *
from supple._supple import __version__
from supple._experiments import Fit, Table, fit_parameters, read_table, sweep
from supple._fit import fit

__all__ = sorted(name for name in dir() if not name.startswith("_"))
