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

    def fit(self, data="box.off", **words):
        try:
            return supple.fit(self.path / data, self.path / "box.yaml", **{"error": 0.05, "particles": 8, **words})
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

    def test_reads_a_volume_and_draws_the_fit(self):
        z, y, x = np.mgrid[0:20, 0:20, 0:20] - 9.5
        header = "NDims = 3\nDimSize = 20 20 20\nElementType = MET_SHORT\nElementDataFile = LOCAL\n"
        values = np.round(-100 * np.sqrt(x * x + y * y + z * z)).astype("<i2")
        (self.path / "ball.mha").write_bytes(header.encode() + values.tobytes())
        report = self.fit("ball.mha", error=0.1, particles=1, iso=-800, picture=self.path / "ball.png")
        self.assertEqual(report["volume_data"]["voxels"], 8000)
        self.assertAlmostEqual(report["volume"], 4 / 3 * np.pi * 0.008**3, delta=0.02 * report["volume"])
        self.assertEqual((self.path / "ball.png").read_bytes()[:4], b"\x89PNG")
        with self.assertRaisesRegex(supple.Error, "expected voxels of values above 5, found none; values are -1645 to -87"):
            self.fit("ball.mha", iso=5, overwrite=True)
        with self.assertRaisesRegex(supple.Error, "expected voxels of label 3, found none"):
            self.fit("ball.mha", label=3, overwrite=True)
        with self.assertRaisesRegex(supple.Error, "expected two values, the smaller one first, found -10:-20"):
            self.fit("ball.mha", window=(-10, -20), overwrite=True)

    def test_refuses_bad_data(self):
        (self.path / "box.yaml").touch()
        with self.assertRaisesRegex(supple.Error, "replace it by --overwrite"):
            self.fit()
        (self.path / "box.off").write_text("OFF\n0 0 0\n")
        with self.assertRaisesRegex(supple.Error, "expected triangles, found none"):
            self.fit(overwrite=True)


if __name__ == "__main__":
    unittest.main()
