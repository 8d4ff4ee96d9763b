"""Objects from data."""
import pathlib
import tempfile
import unittest

import numpy as np
import supple
from support import TOOL

BOX = """OFF
8 12 0
0 0 0
2 0 0
2 1 0
0 1 0
0 0 1
2 0 1
2 1 1
0 1 1
""" + "".join(f"3 {a} {b} {c}\n" for a, b, c in [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)])


@unittest.skipUnless(TOOL, "the command line tool is not built")
class FitData(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        (self.path / "box.off").write_text(BOX)

    def fit(self, **words):
        try:
            return supple.fit(self.path / "box.off", self.path / "box.yaml", error=0.05, particles=8, **words)
        except supple.Error as error:
            if "expected the program of fits" in str(error):
                self.skipTest("the program of fits is not built")
            raise

    def test_gives_a_report_and_an_object_of_scenes(self):
        report = self.fit()
        self.assertEqual(report["particles"], 8)
        self.assertAlmostEqual(report["volume"], 2.0)
        self.assertLess(abs(report["volume_error"]), 0.05)
        self.assertTrue(report["rigid"])
        scene = self.path / "scene.yaml"
        scene.write_text("schema: 1\nduration: 0.1\nframe_rate: 10\nobjects: [{name: box, include: box.yaml, particles: {at: [3, 0, 0]}, scale: 0.5}]\n")
        simulation = supple.Simulation(supple.read_scene(scene))
        np.testing.assert_allclose(simulation.particles.position.mean(axis=0), [3, 0, 0], atol=0.01)
        np.testing.assert_allclose(np.ptp(simulation.particles.position[:, 0]), 0.75, atol=0.15)

    def test_refuses_bad_data(self):
        self.fit()
        with self.assertRaisesRegex(supple.Error, "replace it by --overwrite"):
            self.fit()
        (self.path / "box.off").write_text("OFF\n0 0 0\n")
        with self.assertRaisesRegex(supple.Error, "expected triangles, found none"):
            self.fit(overwrite=True)


if __name__ == "__main__":
    unittest.main()
