"""Scenes and states are pickled: processes share the work of a sweep, and a state goes on in another process."""
import multiprocessing

import supple


def final_energy(scene):
    simulation = supple.Simulation(scene)
    simulation.advance_to(8)
    return simulation.energies().kinetic


def go_on(simulation):
    simulation.step_frame()
    return simulation.state_hash


if __name__ == "__main__":
    scenes = [supple.library("two_balls", {"objects.left.particles.mass": mass}) for mass in (0.2, 0.4, 0.8)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for scene, energy in zip(scenes, pool.map(final_energy, scenes)):
            print(f"{scene.name}: {energy:.6f} J at frame 8")
        simulation = supple.Simulation(scenes[0])
        simulation.advance_to(4)
        elsewhere = pool.apply(go_on, (simulation,))
    assert elsewhere == go_on(simulation)
    print("the state is the same in both processes:", elsewhere)
