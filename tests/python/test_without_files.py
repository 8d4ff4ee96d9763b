"""Scenes from mappings, fields and contacts without scenes, copies and pickles."""
import copy
import pickle
import unittest

import numpy as np

import supple
from support import TWO_DROPS, two_drops

POINT = {"particles": {"arrange": "single", "mass": 1}, "skeleton": [{"shape": "point", "kernel": {"type": "wyvill", "radius": 0.5}}],
         "contact": {"modulus": 2e3}}


class SceneFromMapping(unittest.TestCase):
    def test_is_that_of_the_same_text(self):
        keys = {"duration": "1 s", "frame_rate": 8, "camera": {"from": [0, -3, 1], "look_at": [0, 0, 0]}, "output": {"images": {"size": (64, 48)}},
                "objects": [{"name": "left", **POINT, "particles": {"arrange": "single", "at": np.array([-0.3, 0, 0]), "velocity": [1, 0, 0], "mass": np.float64(0.5)}},
                            {"name": "right", **POINT, "particles": {"arrange": "single", "at": (0.3, 0, 0), "mass": 0.5}}]}
        self.assertEqual(supple.Scene(keys).content_hash, two_drops().content_hash)
        self.assertEqual(supple.Scene(keys, {"duration": 0.5}, name="short.yaml").name, "short")
        self.assertIn("duration: 1 s", TWO_DROPS)

    def test_says_what_is_wrong_with_a_key(self):
        with self.assertRaises(supple.Error) as refused:
            supple.Scene({"duration": 1, "objects": [{"name": "ball", "colur": [1, 0, 0]}]})
        self.assertIn("did you mean 'colour'", str(refused.exception))
        with self.assertRaises(TypeError):
            supple.Scene({"duration": object()})
        with self.assertRaises(TypeError):
            supple.Scene("duration: 1 s")

    def test_takes_every_letter(self):
        title = 'Ünïcode 𝄞 "quotes" \\ \n tab\t'
        self.assertEqual(supple.Scene({"duration": 1, "title": title, "objects": [{"name": "ball", **POINT}]}).title, title)


class Fields(unittest.TestCase):
    def test_are_those_of_a_scene(self):
        simulation = supple.Simulation(two_drops())
        field = supple.Field(POINT, position=[[-0.3, 0, 0]])
        points = np.random.default_rng(3).uniform(-0.7, 0.2, (50, 3))
        for own, theirs in zip(field.evaluate(points), simulation.field("left", points)):
            np.testing.assert_array_equal(own, theirs)

    def test_follow_their_parts(self):
        field = supple.Field({**POINT, "skeleton": [{"shape": "box", "half_sizes": [0.3, 0.1, 0.1], "kernel": {"type": "wyvill", "radius": 0.2}}]})
        inside, _ = field.evaluate([[0.35, 0, 0]])
        self.assertGreater(inside[0], 0)
        field.move(orientation=[[0, 0, np.sqrt(0.5), np.sqrt(0.5)]])
        turned, _ = field.evaluate([[0.35, 0, 0], [0, 0.35, 0]])
        self.assertLess(turned[0], 0)
        self.assertAlmostEqual(turned[1], inside[0], places=12)
        with self.assertRaises(supple.Error):
            field.move(position=[[0, 0, 0], [1, 0, 0]])

    def test_have_closed_meshes(self):
        report = supple.Field(POINT).mesh(cells=48).inspect()
        self.assertTrue(report.closed and report.oriented)
        radius = np.cbrt(report.volume * 3 / (4 * np.pi))
        value, _ = supple.Field(POINT).evaluate([[radius, 0, 0]])
        self.assertLess(abs(value[0]), 0.01)

    def test_touch_as_in_a_scene(self):
        simulation = supple.Simulation(two_drops())
        simulation.set_particles(position=[[-0.2, 0, 0], [0.2, 0, 0]])
        expected = simulation.contact("left", "right", error=1e-6)
        left, right = supple.Field(POINT, position=[[-0.2, 0, 0]]), supple.Field(POINT, position=[[0.2, 0, 0]])
        found = supple.contact(left, right, error=1e-6)
        self.assertTrue(found.touching)
        np.testing.assert_allclose(found.elastic_force, expected.elastic_force, rtol=2e-6, atol=1e-9)
        np.testing.assert_allclose(found.elastic_force, -supple.contact(right, left, error=1e-6).elastic_force, rtol=2e-6, atol=1e-9)
        right.move(position=[[3, 0, 0]])
        self.assertFalse(supple.contact(left, right).touching)

    def test_touch_where_they_are_not_convex(self):
        """Force on a ball over a ring is along the axis, and minus the slope of the energy."""
        ring = supple.Field({**POINT, "skeleton": [{"shape": "ring", "radius": 0.4, "kernel": {"type": "wyvill", "radius": 0.25}}]})
        ball = supple.Field({**POINT, "skeleton": [{"shape": "point", "kernel": {"type": "wyvill", "radius": 0.8}}]})
        step, height = 2.5e-4, 0.25
        contacts = []
        for z in (height - step, height, height + step):
            ball.move(position=[[0, 0, z]])
            contacts.append(supple.contact(ball, ring, error=1e-6))
        slope = (contacts[2].energy - contacts[0].energy) / (2 * step)
        force = contacts[1].elastic_force
        self.assertGreater(force[2], 0)
        self.assertLess(np.hypot(force[0], force[1]), 1e-9 * force[2])
        self.assertLess(abs(force[2] / -slope - 1), 1e-4)  # the central difference is off by 6.6e-5, and by a quarter of that at half the step

    def test_refuse_what_is_no_body(self):
        for keys in ({"particles": {"arrange": "single", "mass": 1}},
                     {**POINT, "particles": {"arrange": "line", "count": 2, "spacing": 3, "mass": 1}, "separate": True}):
            with self.assertRaises(supple.Error):
                supple.Field(keys)
        with self.assertRaises(ValueError):
            supple.contact(supple.Field(POINT), supple.Field(POINT), error=1.0)


class Copies(unittest.TestCase):
    def test_of_scenes_have_their_overrides(self):
        scene = two_drops({"objects.left.particles.mass": 0.7})
        again = pickle.loads(pickle.dumps(scene))
        self.assertEqual((again.content_hash, again.name, again.source), (scene.content_hash, scene.name, scene.source))
        self.assertNotEqual(again.content_hash, two_drops().content_hash)
        self.assertEqual(copy.deepcopy(scene).content_hash, scene.content_hash)

    def test_of_states_and_simulations_go_on_with_the_same_bits(self):
        simulation = supple.Simulation(two_drops())
        simulation.advance_to(3)
        simulation.step(2)
        kept = [simulation.state(), pickle.loads(pickle.dumps(simulation.state())), copy.deepcopy(simulation.state())]
        others = [copy.copy(simulation), copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))]
        simulation.advance_to(6)
        for other in others:
            self.assertNotEqual(other.state_hash, simulation.state_hash)
            other.advance_to(6)
            self.assertEqual(other.state_hash, simulation.state_hash)
        for state in kept:
            simulation.restore(state)
            simulation.advance_to(6)
            self.assertEqual(simulation.state_hash, others[0].state_hash)

    def test_of_damaged_states_are_refused(self):
        simulation = supple.Simulation(two_drops())
        parts = simulation.state().__getstate__()
        spoilt = bytearray(parts[2])
        spoilt[len(spoilt) // 2] ^= 1
        state = type(simulation.state()).__new__(type(simulation.state()))
        with self.assertRaises(supple.Error) as refused:
            state.__setstate__((parts[0], parts[1], bytes(spoilt)))
        self.assertEqual(refused.exception.kind, "corrupt")


class Library(unittest.TestCase):
    def test_is_read_by_name(self):
        self.assertIn("contacts/two_balls", supple.library_scenes())
        self.assertEqual(supple.library("two_balls").content_hash, supple.library("contacts/two_balls").content_hash)
        with self.assertRaises(supple.Error) as refused:
            supple.library("two_bals")
        self.assertIn("two_balls", str(refused.exception))


if __name__ == "__main__":
    unittest.main()
