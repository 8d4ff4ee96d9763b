import pickle
import tempfile
import pathlib
import unittest

import numpy as np
import supple
from support import LIBRARY, TWO_DROPS, library, two_drops


class Scenes(unittest.TestCase):
    def test_say_what_the_file_says(self):
        scene = library("contacts/two_balls")
        self.assertEqual((scene.name, scene.title), ("two_balls", "Two deformable balls collide"))
        self.assertEqual((scene.duration, scene.frame_rate, scene.frame_count), (2.0, 24.0, 49))
        self.assertEqual(scene.objects, ["left", "right"])
        self.assertEqual(scene.source, LIBRARY / "contacts/two_balls.yaml")
        np.testing.assert_array_equal(scene.gravity, [0, 0, 0])

    def test_take_overrides_as_mapping_and_as_texts(self):
        at = np.array([-0.25, 0.125, 0.0])
        one = two_drops({"objects.left.particles.at": at, "objects.left.particles.mass": np.float64(2.0),
                         "objects.right.particles.mass": "250 g", "gravity": [0, 0, -9.81], "objects.left.contact.friction": 0.5})
        other = two_drops(["objects.left.particles.at=[-0.25, 0.125, 0]", "objects.left.particles.mass=2",
                           "objects.right.particles.mass=0.25", "gravity=[0, 0, -9.81]", "objects.left.contact.friction=0.5"])
        self.assertEqual(supple.Simulation(one).state_hash, supple.Simulation(other).state_hash)
        particles = supple.Simulation(one).particles
        np.testing.assert_array_equal(particles.mass, [2.0, 0.25])
        np.testing.assert_array_equal(particles.position[0], at)

    def test_refuse_overrides_that_are_one_text(self):
        with self.assertRaisesRegex(TypeError, "expected a mapping"):
            two_drops("gravity=[0, 0, 0]")

    def test_refuse_overrides_that_are_no_data(self):
        with self.assertRaisesRegex(TypeError, "expected numbers, texts, lists"):
            two_drops({"gravity": object()})

    def test_look_for_files_in_their_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            (pathlib.Path(folder) / "points.csv").write_text("x,y,z\n0,0,0\n0.1,0,0\n")
            text = TWO_DROPS.replace("arrange: single, at: [-0.3, 0, 0], velocity: [1, 0, 0]", "arrange: file, file: points.csv")
            scene = supple.parse_scene(text, folder=folder)
            self.assertEqual(len(supple.Simulation(scene).particles), 3)

    def test_are_checked(self):
        self.assertEqual(supple.check(library("contacts/two_balls")), [])
        inside = two_drops({"objects.left.particles.at": [0.29, 0, 0]})
        self.assertTrue(supple.check(inside))
        with self.assertRaises(supple.Error) as caught:
            supple.check(two_drops({"ground": {"height": -1, "texture": {"pattern": "picture", "file": "absent.png"}}}))
        self.assertEqual((caught.exception.kind, caught.exception.exit_code), ("io", 4))

    def test_are_explained(self):
        text = supple.explain(two_drops())
        self.assertIn("solve_contact_surface", text)
        self.assertEqual(text, supple.Simulation(two_drops()).explain())

    def test_have_a_reference(self):
        self.assertIn("frame_rate", supple.scene_reference())
        self.assertIn('"$schema"', supple.scene_json_schema())


class Errors(unittest.TestCase):
    def test_name_every_fault(self):
        text = TWO_DROPS.replace("radius: 0.5", "raduis: 0.5", 1).replace("mass: 0.5}", "mass: -1}", 1)
        with self.assertRaises(supple.Error) as caught:
            supple.parse_scene(text, name="two_drops.yaml")
        error = caught.exception
        self.assertIsInstance(error, ValueError)
        self.assertEqual((error.kind, error.exit_code), ("scene", 3))
        # The first by place, which is line 7, the mass of `left`.
        self.assertEqual(error.place, "two_drops.yaml:7:79")
        self.assertEqual(error.key, "objects[0].particles.mass")
        self.assertEqual((error.expected, error.found), ("expected a mass > 0 [kg], or auto", "-1"))
        hints = [fault.hint for fault in error.faults if fault.key.endswith("raduis")]
        self.assertEqual(len(hints), 1)
        self.assertIn("did you mean 'radius'?", hints[0])
        for fault in error.faults:
            self.assertIn(fault.place, str(error))

    def test_of_files_have_a_kind(self):
        with self.assertRaises(supple.Error) as caught:
            supple.read_scene("absent.yaml")
        self.assertEqual((caught.exception.kind, caught.exception.exit_code, caught.exception.place), ("io", 4, "absent.yaml"))

    def test_of_calling_code_are_exceptions_too(self):
        with self.assertRaisesRegex(supple.ContractViolation, "threads >= 0"):
            supple.Simulation(two_drops(), threads=-1)

    def test_survive_pickling(self):
        with self.assertRaises(supple.Error) as caught:
            supple.read_scene("absent.yaml")
        copy = pickle.loads(pickle.dumps(caught.exception))
        self.assertEqual(vars(copy), vars(caught.exception))
        self.assertEqual(str(copy), str(caught.exception))


if __name__ == "__main__":
    unittest.main()
