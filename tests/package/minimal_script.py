"""A minimal external script: the same as main.cpp, with the installed Python package."""
import sys

import supple

simulation = supple.Simulation(supple.read_scene(sys.argv[1]))
simulation.advance_to(simulation.scene.frame_count)
print(f"t = {simulation.time:g} s, particle 0 at {simulation.particles.position[0]} m, state {simulation.state_hash}")
