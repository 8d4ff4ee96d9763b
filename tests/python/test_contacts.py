import gc
import unittest

import numpy as np
import supple
from support import library, two_drops


def pressed(overrides=None):
    """The two drops in the middle of their contact."""
    simulation = supple.Simulation(two_drops(overrides))
    while not len(simulation.contacts()):
        simulation.step()
    simulation.step(8)
    return simulation


class Contacts(unittest.TestCase):
    def test_are_there_when_bodies_touch(self):
        simulation = supple.Simulation(two_drops())
        contacts = simulation.contacts()
        self.assertEqual((len(contacts), contacts.pairs, contacts.energy), (0, [], 0.0))
        self.assertEqual(contacts.point.shape, (0, 3))
        self.assertEqual([(pair.a, pair.b) for pair in pressed().contacts()], [("left", "right")])

    def test_add_up(self):
        contacts = pressed(["contact.error=1e-4"]).contacts()
        pair = contacts[-1]
        self.assertEqual(pair.point.shape, pair.normal.shape)
        self.assertEqual((len(pair.point_area), len(pair.pressure)), (len(pair.point),) * 2)
        # Sums over the points are the integrals of the summary, to round-off of some tens of terms.
        weight = pair.pressure * pair.point_area
        np.testing.assert_allclose(-weight @ pair.normal, pair.elastic_force, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(np.cross(pair.point, -weight[:, None] * pair.normal).sum(axis=0), pair.moment, rtol=0, atol=1e-13)
        np.testing.assert_allclose(weight @ pair.point / weight.sum(), pair.centre_of_pressure, rtol=0, atol=1e-13)
        self.assertAlmostEqual(pair.point_area.sum(), pair.area, delta=1e-12 * pair.area)
        np.testing.assert_allclose(np.linalg.norm(pair.normal, axis=1), 1, rtol=1e-14)
        # Single particles: what the pair feels is what they feel.
        np.testing.assert_allclose(contacts.force, [pair.force, -pair.force], rtol=1e-12, atol=1e-14)
        np.testing.assert_array_equal(contacts.pair, 0)
        self.assertEqual(contacts.energy, pair.energy)
        self.assertLessEqual(pair.error_estimate, 1e-4)
        self.assertEqual(pair.rule, "polar")

    def test_stay_as_they_were(self):
        simulation = pressed()
        contacts = simulation.contacts()
        force, pressure = contacts.force, contacts[0].pressure
        before = force.copy(), pressure.copy()
        simulation.step(5)
        del contacts, simulation
        gc.collect()
        np.testing.assert_array_equal(force, before[0])
        np.testing.assert_array_equal(pressure, before[1])
        self.assertFalse(force.flags.writeable or pressure.flags.writeable)

    def test_index_like_a_list(self):
        contacts = pressed().contacts()
        self.assertEqual(contacts[0].area, contacts[-1].area)
        for index in 1, -2:
            with self.assertRaises(IndexError):
                contacts[index]

    def test_dissipate_what_the_ledger_says(self):
        simulation = pressed({"objects.left.contact.dissipation": 2, "objects.right.contact.dissipation": 2})
        contacts = simulation.contacts()
        self.assertGreater(contacts[0].dissipated_power, 0)
        self.assertEqual(contacts.dissipated_work, sum(pair.dissipated_work for pair in contacts))
        self.assertGreater(contacts.dissipated_work, 0)
        # The trapezoidal rule over the steps, and the exact work of the same loads in half steps: nothing else takes energy here.
        self.assertAlmostEqual(contacts.dissipated_work / simulation.ledger().dissipated, 1, delta=0.02)
        self.assertGreater(np.linalg.norm(contacts[0].force - contacts[0].elastic_force), 0)


class TwoBodies(unittest.TestCase):
    def test_are_solved_to_the_error_asked_for(self):
        simulation = pressed()
        exact = simulation.contact("left", "right", error=1e-10)
        for error in 1e-3, 1e-6:
            found = simulation.contact("left", "right", error=error)
            self.assertTrue(found.touching)
            self.assertLessEqual(found.error_estimate, error)
            distance = np.linalg.norm(found.elastic_force - exact.elastic_force) / np.linalg.norm(exact.elastic_force)
            self.assertLessEqual(distance, found.error_estimate + exact.error_estimate + 1e-14)
            self.assertAlmostEqual(found.point_area.sum(), found.area, delta=1e-12)

    def test_may_be_placed_by_hand(self):
        # The force of two like balls is normal to the plane between them, and the same from either side.
        simulation = supple.Simulation(two_drops())
        for angle in 0.0, 0.7, 2.0:
            across = 0.15 * np.array([np.cos(angle), np.sin(angle), 0])
            simulation.set_particles(position=[-across, across])
            contact = simulation.contact("left", "right", error=1e-8)
            np.testing.assert_allclose(contact.centre_of_pressure, 0, atol=1e-8)
            np.testing.assert_allclose(contact.elastic_force / np.linalg.norm(contact.elastic_force), -across / 0.15, atol=2e-8)

    def test_tell_what_their_energies_may_be_off_by(self):
        simulation = pressed()
        estimates, pairs = simulation.energy_estimates(), simulation.contacts()
        self.assertEqual(estimates.shape, (len(pairs),))
        self.assertTrue(all(0 < estimate < 1e-2 * pair.energy for estimate, pair in zip(estimates, pairs, strict=True)))
        self.assertEqual(supple.Simulation(two_drops()).energy_estimates().shape, (0,))

    def test_can_hold_so_much(self):
        simulation = pressed()
        capacity = simulation.contact_capacity("left", "right")
        self.assertGreater(capacity, simulation.contacts()[0].energy)
        with self.assertRaisesRegex(supple.Error, "expected a body that touches 'left'"):
            supple.Simulation(two_drops()).contact_capacity("left", "right")

    def test_need_not_touch(self):
        contact = supple.Simulation(two_drops()).contact("left", "right")
        self.assertFalse(contact.touching)
        self.assertEqual((contact.area, contact.rule, contact.point.shape), (0.0, "none", (0, 3)))

    def test_may_be_fixed(self):
        simulation = supple.Simulation(two_drops({"ground": {"height": -0.2}}))
        self.assertEqual((simulation.bodies, simulation.fixed_bodies), (["left", "right"], ["ground"]))
        contact = simulation.contact("ground", "left", error=1e-8)
        self.assertEqual((contact.a, contact.b), ("left", "ground"))
        # The ground is even, so the force points up, through the middle of the ball.
        self.assertGreater(contact.elastic_force[2], 0)
        np.testing.assert_allclose(contact.elastic_force[:2], 0, atol=1e-8 * contact.load)
        np.testing.assert_allclose(contact.centre_of_pressure[:2], [-0.3, 0], atol=1e-8)

    def test_are_named(self):
        with self.assertRaises(supple.Error) as caught:
            pressed().contact("left", "rigth")
        self.assertEqual((caught.exception.kind, caught.exception.place, caught.exception.found), ("usage", "body", "'rigth'"))
        self.assertIn("did you mean 'right'?", caught.exception.hint)


class Forces(unittest.TestCase):
    def test_are_told_law_by_law(self):
        simulation = supple.Simulation(library("figures/ball_hits_spiral"))
        simulation.advance_to(3)
        laws = simulation.forces()
        self.assertEqual(laws[-1].name, "contact")
        self.assertIn("spiral/bond_frame", [law.name for law in laws])
        n = len(simulation.particles)
        for law in laws:
            self.assertEqual((law.force.shape, law.torque.shape), ((n, 3), (n, 3)))
        energies = simulation.energies()
        # Ten particles' energies, in another order of summation.
        self.assertAlmostEqual(sum(law.energy for law in laws[:-1]), energies.interaction, delta=1e-12 * (1 + energies.interaction))
        self.assertEqual(laws[-1].energy, energies.contact)


class Experiments(unittest.TestCase):
    def test_book_what_is_done_by_hand(self):
        simulation = supple.Simulation(two_drops({"objects.left.contact.friction": 0.3}))
        simulation.advance_to(3)
        velocity = simulation.particles.velocity.copy()
        velocity[1] += [0, 0.5, 0]
        spin = np.array([[0, 0, 1.0], [2.0, 0, 0]])
        simulation.set_particles(velocity=velocity, angular_velocity=spin)
        np.testing.assert_array_equal(simulation.particles.velocity, velocity)
        np.testing.assert_allclose(simulation.particles.angular_velocity, spin, atol=1e-15)
        np.testing.assert_allclose(simulation.ledger().external_impulse, [0, 0.25, 0], atol=1e-15)  # 0.5 kg by 0.5 m/s
        simulation.advance_to(9)
        self.assertLess(simulation.audits().momentum_error, 1e-13)
        self.assertLess(simulation.audits().angular_momentum_error, 1e-13)

    def test_turn_bodies_by_quaternions_x_y_z_w(self):
        # A quarter turn about z, of any length: x becomes y.
        simulation = supple.Simulation(two_drops())
        half = np.sqrt(0.5)
        simulation.set_particles(orientation=[[0, 0, 3, 3], [0, 0, 0, 1]])
        np.testing.assert_allclose(simulation.particles.orientation, [[0, 0, half, half], [0, 0, 0, 1]], atol=1e-15)
        elongated = supple.Simulation(supple.parse_scene("""
schema: 1
duration: 1 s
objects:
  - name: egg
    particles: {arrange: single, mass: 1}
    skeleton: [{shape: ellipsoid, semi_axes: [0.4, 0.2, 0.2], kernel: {type: wyvill}}]
"""))
        points = np.array([[0.13, 0, 0], [0, 0.13, 0]])  # the surface is at 0.18 and 0.09
        before = elongated.field("egg", points)[0]
        self.assertTrue(before[0] > 0 > before[1])
        elongated.set_particles(orientation=[[0, 0, 1, 1]])
        np.testing.assert_allclose(elongated.field("egg", points)[0], before[::-1], atol=1e-12)

    def test_say_what_is_wrong_with_arrays(self):
        simulation = supple.Simulation(two_drops())
        for change, message in (
            ({"position": np.zeros((3, 3))}, r"position: expected 2 rows, found 3"),
            ({"velocity": np.zeros(3)}, r"velocity: expected an array of shape \(n, 3\), found shape \(3,\)"),
            ({"orientation": np.zeros((2, 4))}, r"orientation: expected finite quaternions of a length > 0, found others in row 0"),
            ({"position": "left"}, r"position: expected an array of shape \(n, 3\), found <class 'str'>"),
            ({"position": [[0, 0, 0], [0, float("nan"), 0]]}, r"position: expected finite numbers, found others in row 1"),
        ):
            with self.assertRaisesRegex(supple.Error, message):
                simulation.set_particles(**change)
        self.assertEqual(simulation.state_hash, supple.Simulation(two_drops()).state_hash)


if __name__ == "__main__":
    unittest.main()
