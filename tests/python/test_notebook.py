import importlib.util
import pathlib
import tempfile
import unittest

import numpy as np

import supple
from supple import notebook, usd
from support import two_drops


class Notebook(unittest.TestCase):
    def test_shows_pictures_as_png(self):
        pixels = (np.arange(6 * 4 * 3) % 256).astype(np.uint8).reshape(6, 4, 3)
        data = notebook.Picture(pixels)._repr_png_()
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "picture.png"
            path.write_bytes(data)
            self.assertEqual(data[:8], b"\x89PNG\r\n\x1a\n")
            self.assertEqual(data[16:24], bytes([0, 0, 0, 4, 0, 0, 0, 6]))
        simulation = supple.Simulation(two_drops())
        shown = notebook.picture(simulation, size=(64, 48))
        np.testing.assert_array_equal(shown.pixels, simulation.picture(size=(64, 48)))

    def test_shows_a_run_with_its_viewer(self):
        with tempfile.TemporaryDirectory() as folder:
            done = notebook.run(two_drops({"duration": 0.25}), folder, simulate_only=True)
            self.assertEqual(done.result.outcome, "done")
            text = done._repr_html_()
            self.assertTrue(text.startswith("<iframe srcdoc="))
            self.assertNotIn("<script", text)  # it is escaped
            self.assertTrue(done.viewer.page.exists())


@unittest.skipUnless(importlib.util.find_spec("pxr"), "no usd-core")
class UsdCrates(unittest.TestCase):
    def test_have_the_values_of_the_text(self):
        from pxr import Usd

        scene = two_drops({"duration": 0.5, "output.mesh": ["usd"]})
        with tempfile.TemporaryDirectory() as folder:
            supple.run(scene, folder, threads=1)
            text = pathlib.Path(folder) / "two_drops.usda"
            stages = [Usd.Stage.Open(str(path)) for path in (text, usd.crate(text), usd.clips(text))]
            self.assertLess(text.with_suffix(".usdc").stat().st_size, 0.5 * text.stat().st_size)
            for prim in stages[0].Traverse():
                for attribute in prim.GetAttributes():
                    for time in range(1, scene.frame_count + 1):
                        values = [stage.GetPrimAtPath(prim.GetPath()).GetAttribute(attribute.GetName()).Get(time) for stage in stages]
                        self.assertEqual(values[0], values[1], attribute.GetPath())
                        self.assertEqual(values[0], values[2], attribute.GetPath())


if __name__ == "__main__":
    unittest.main()
