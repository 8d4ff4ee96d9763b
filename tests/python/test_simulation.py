import gc
import pathlib
import signal
import tempfile
import threading
import time
import unittest

import numpy as np
import supple
from support import TOOL, library, run_tool, two_drops


class Simulations(unittest.TestCase):
    def test_take_forces_in_each_step(self):
        simulation = supple.Simulation(two_drops())
        simulation.set_loads(force=[[0, 0, 1]] * len(simulation.particles))
        simulation.step()
        pushed = simulation.ledger().external_impulse
        simulation.set_loads()
        simulation.step()
        np.testing.assert_allclose(simulation.ledger().external_impulse - pushed, pushed - len(simulation.particles) * simulation.time_step * np.array([0, 0, 1]), atol=1e-9)
        with self.assertRaisesRegex(supple.Error, "one per particle"):
            simulation.set_loads(torque=[[0, 0, 1]])

    def test_count_frames_and_time(self):
        simulation = supple.Simulation(two_drops())
        self.assertEqual((simulation.frame, simulation.time), (1, 0.0))
        simulation.step()
        self.assertEqual((simulation.frame, simulation.time), (1, simulation.time_step))
        simulation.step_frame()
        self.assertEqual((simulation.frame, simulation.time), (2, 1 / 8))
        self.assertTrue(simulation.advance_to(4))
        self.assertEqual(simulation.frame, 4)
        self.assertEqual(list(simulation.frames()), [4, 5, 6, 7, 8, 9])
        self.assertEqual(list(simulation.frames()), [9])
        self.assertEqual(list(simulation.frames(last=11)), [9, 10, 11])

    @unittest.skipUnless(TOOL, "the command line tool is not built")
    def test_give_the_bits_of_the_tool(self):
        for name, overrides in {"contacts/two_balls": {"objects.left.particles.mass": 0.25, "duration": "1 s"},
                                "figures/ball_hits_spiral": {"duration": 0.25}}.items():
            with self.subTest(name):
                scene = library(name, overrides)
                simulation = supple.Simulation(scene)
                simulation.advance_to(scene.frame_count)
                result = run_tool(name, *(f"--set={key}={value}" for key, value in overrides.items()))
                self.assertEqual(result["outcome"], "done")
                self.assertEqual(simulation.state_hash, result["state_hash"])
                self.assertEqual(simulation.audits().energy_error, result["audits"]["energy_error"])

    def test_do_not_depend_on_threads_nor_on_how_they_are_stepped(self):
        hashes = set()
        for threads in 1, 2, 3:
            simulation = supple.Simulation(library("figures/ball_hits_spiral"), threads=threads)
            simulation.step(5)
            simulation.advance_to(3)
            hashes.add(simulation.state_hash)
        simulation = supple.Simulation(library("figures/ball_hits_spiral"))
        while simulation.frame < 3:
            simulation.step()
            simulation.energies()
        hashes.add(simulation.state_hash)
        self.assertEqual(len(hashes), 1)

    def test_continue_from_states_to_the_bit(self):
        first = supple.Simulation(two_drops())
        first.advance_to(3)
        first.step(3)
        state = first.state()
        self.assertEqual((state.frame, state.state_hash), (3, first.state_hash))
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "drops.state"
            first.save(path)
            first.advance_to(8)
            restored, loaded = supple.Simulation(two_drops()), supple.Simulation(two_drops({"duration": 2}))
            restored.restore(state)
            loaded.load(path)
            for simulation in restored, loaded:
                self.assertEqual(simulation.state_hash, state.state_hash)
                simulation.advance_to(8)
                self.assertEqual(simulation.state_hash, first.state_hash)
            path.write_bytes(path.read_bytes()[:-1])
            with self.assertRaises(supple.Error) as caught:
                loaded.load(path)
            self.assertEqual(caught.exception.kind, "corrupt")
        first.restore(state)
        self.assertEqual(first.state_hash, state.state_hash)

    def test_refuse_states_of_other_scenes(self):
        other = supple.Simulation(two_drops({"objects.left.particles.mass": 1}))
        with self.assertRaises(supple.Error) as caught:
            other.restore(supple.Simulation(two_drops()).state())
        self.assertEqual((caught.exception.kind, caught.exception.place), ("usage", "state"))
        self.assertIn("adopt()", caught.exception.hint)

    def test_adopt_states_of_scenes_with_other_numbers(self):
        first, other = supple.Simulation(two_drops()), supple.Simulation(two_drops({"objects.left.particles.mass": 1}))
        first.advance_to(2)
        other.adopt(first.state())
        self.assertEqual((other.frame, other.time), (2, first.time))
        np.testing.assert_array_equal(other.particles.velocity, first.particles.velocity)
        other.advance_to(9)
        self.assertLess(other.audits().momentum_error, 1e-13)
        np.testing.assert_allclose(other.motion().momentum, [1, 0, 0], atol=1e-13)  # 1 kg at 1 m/s, not touching yet
        with self.assertRaisesRegex(supple.Error, "expected 2 particles"):
            other.adopt(supple.Simulation(library("figures/ball_hits_spiral")).state())

    def test_tell_what_deforms_and_what_is_overloaded(self):
        simulation = supple.Simulation(two_drops({"objects.left.particles.velocity": [30, 0, 0]}))
        self.assertEqual((simulation.overloads(), simulation.shape_errors()), ([], {"left": (0, 0), "right": (0, 0)}))
        with self.assertRaisesRegex(supple.Error, "'left' and 'right' pass through each other"):
            simulation.advance_to(3)
        overload, = simulation.overloads()
        self.assertEqual((overload["a"], overload["b"]), ("left", "right"))
        self.assertGreater(overload["energy"], overload["capacity"] / 2)
        spiral = supple.Simulation(library("figures/ball_hits_spiral"))
        spiral.advance_to(12)
        now, largest = spiral.shape_errors()["spiral"]
        self.assertGreaterEqual(largest, now)

    def test_count_the_work_of_stages(self):
        simulation = supple.Simulation(two_drops(), profile=True)
        simulation.step(10)
        profile = simulation.profile()
        self.assertEqual(profile["advance"]["calls"], 10)
        self.assertEqual(set(profile["advance"]), {"calls", "cpu_s", "visited", "present"})

    def test_keep_energy_and_momentum(self):
        simulation = supple.Simulation(two_drops())
        before = simulation.energies()
        self.assertAlmostEqual(before.kinetic, 0.25, delta=1e-15)  # 0.5 kg at 1 m/s
        simulation.advance_to(9)
        after = simulation.energies()
        error = abs(after.total - before.total) / before.total
        self.assertLessEqual(error, simulation.audits().energy_error * (1 + 1e-9))
        # Round-off of a few hundred steps.
        np.testing.assert_allclose(simulation.motion().momentum, [0.5, 0, 0], atol=1e-13)
        self.assertEqual(simulation.ledger().external_work, 0.0)

    def test_go_back_to_the_last_frame_when_they_diverge(self):
        scene = supple.parse_scene("""
schema: 1
duration: 10 s
frame_rate: 10
time_step: {size: 0.1 s, substeps: 1}
objects:
  - name: chain
    particles: {arrange: line, count: 3, spacing: 0.2, spin: [0, 0, 3], mass: 0.01}
    interactions: [{law: bond_frame, stretch: 1e6, rotation: 10}]
""")
        simulation = supple.Simulation(scene)
        position = simulation.particles.position
        with self.assertRaises(supple.Error) as caught:
            simulation.advance_to(100)
        self.assertEqual((caught.exception.kind, caught.exception.exit_code), ("diverged", 5))
        self.assertTrue(np.isfinite(position).all())
        self.assertLess(np.abs(position).max(), 1e6)
        self.assertLess(simulation.frame, 100)


class Views(unittest.TestCase):
    def test_show_the_state_without_copies(self):
        simulation = supple.Simulation(two_drops())
        particles = simulation.particles
        position, velocity, orientation = particles.position, particles.velocity, particles.orientation
        self.assertEqual((position.shape, velocity.shape, orientation.shape), ((2, 3), (2, 3), (2, 4)))
        np.testing.assert_array_equal(orientation, [[0, 0, 0, 1]] * 2)
        self.assertEqual(position.__array_interface__["data"], simulation.particles.position.__array_interface__["data"])
        before = position.copy()
        simulation.advance_to(3)
        self.assertGreater(position[0, 0], before[0, 0])
        np.testing.assert_array_equal(position, simulation.particles.position)
        simulation.restore(supple.Simulation(two_drops()).state())
        np.testing.assert_array_equal(position, before)

    def test_stay_in_place_with_every_integrator(self):
        for method in "symplectic", "rk4", "adaptive", "backward_euler", "implicit_midpoint":
            with self.subTest(method):
                simulation = supple.Simulation(two_drops({"integrator": {"method": method}}))
                position = simulation.particles.position
                simulation.step(3)
                self.assertEqual(position.__array_interface__["data"], simulation.particles.position.__array_interface__["data"])
                np.testing.assert_array_equal(position, simulation.particles.position)
                self.assertGreater(position[0, 0], -0.3)

    def test_cannot_be_written_to(self):
        particles = supple.Simulation(two_drops()).particles
        for name in "position", "orientation", "velocity", "angular_momentum", "mass", "inertia", "normal", "object", "pinned":
            array = getattr(particles, name)
            self.assertFalse(array.flags.writeable, name)
            self.assertFalse(array.flags.owndata, name)
            with self.assertRaises(ValueError):
                array.flags.writeable = True

    def test_keep_their_simulation_alive(self):
        position = supple.Simulation(two_drops()).particles.position
        gc.collect()
        junk = [supple.Simulation(two_drops({"objects.left.particles.at": [9, 9, 9]})) for _ in range(3)]
        np.testing.assert_array_equal(position, [[-0.3, 0, 0], [0.3, 0, 0]])
        del junk

    def test_are_divided_by_objects(self):
        simulation = supple.Simulation(library("figures/ball_hits_spiral"))
        self.assertEqual(list(simulation.objects), simulation.scene.objects)
        spiral = simulation.objects["spiral"]
        self.assertEqual(simulation.particles.position[spiral].shape, (10, 3))
        self.assertEqual(set(simulation.particles.object[spiral]), {simulation.scene.objects.index("spiral")})

    def test_derive_angular_velocities(self):
        simulation = supple.Simulation(two_drops({"objects.left.particles.spin": [0, 1, 2]}))
        # omega = L / I of a ball, to round-off.
        np.testing.assert_allclose(simulation.particles.angular_velocity, [[0, 1, 2], [0, 0, 0]], rtol=1e-14)
        np.testing.assert_allclose(simulation.particles.angular_momentum[0], simulation.particles.inertia[0] * [0, 1, 2], rtol=1e-14)


class Threads(unittest.TestCase):
    def test_run_beside_a_long_call(self):
        # More steps than there is time for; the thread that takes them lets this one look and cancel.
        simulation = supple.Simulation(two_drops({"time_step": {"substeps": 4096}}))
        reached = []
        stepper = threading.Thread(target=lambda: reached.append(simulation.advance_to(10**6)))
        stepper.start()
        seen = set()
        begin = time.monotonic()
        while len(seen) < 3 and time.monotonic() - begin < 20:
            seen.add(simulation.time)
        simulation.cancel()
        stepper.join(20)
        self.assertFalse(stepper.is_alive())
        self.assertEqual(reached, [False])
        self.assertEqual(len(seen), 3)

    def test_share_a_simulation_step_by_step(self):
        shared, alone = supple.Simulation(two_drops()), supple.Simulation(two_drops())
        threads = [threading.Thread(target=lambda: [shared.step() for _ in range(25)]) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        alone.step(100)
        self.assertEqual(shared.state_hash, alone.state_hash)

    def test_interrupts_end_a_call_at_a_step(self):
        simulation = supple.Simulation(two_drops({"time_step": {"substeps": 4096}}))
        timer = threading.Timer(0.1, lambda: signal.raise_signal(signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            simulation.advance_to(10**6)
        timer.join()
        other = supple.Simulation(two_drops({"time_step": {"substeps": 4096}}))
        other.step(round(simulation.time / simulation.time_step))
        self.assertEqual(simulation.state_hash, other.state_hash)


if __name__ == "__main__":
    unittest.main()
