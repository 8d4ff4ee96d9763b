"""Sweeps, their tables and plots, and fits."""
import importlib.util
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import supple
from support import SOURCE, TOOL, TWO_DROPS, two_drops

MASS = "objects.left.particles.mass"
MODULUS = "objects.left.contact.modulus"


def has(module):
    return importlib.util.find_spec(module) is not None


@unittest.skipUnless(TOOL, "the command line tool is not built")
class Sweep(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        self.scene = self.path / "drops.yaml"
        self.scene.write_text(TWO_DROPS)

    def test_gives_a_row_for_every_point(self):
        table = supple.sweep(self.scene, {MASS: np.array([0.25, 0.5]), MODULUS: "1e3:4e3:log2"},
                             measures={"x": {"frames": "objects", "of": "right", "column": "x_m", "reduce": "final"}}, folder=self.path / "sweep")
        self.assertEqual(list(table), ["point", MASS, MODULUS, "outcome", "x", "reason"])
        self.assertEqual(table.parameters, (MASS, MODULUS))
        self.assertEqual(table.rows, 4)
        np.testing.assert_array_equal(table[MASS], [0.25, 0.25, 0.5, 0.5])
        np.testing.assert_array_equal(table[MODULUS], [1000, 4000, 1000, 4000])
        for mass, modulus, x in zip(table[MASS], table[MODULUS], table["x"]):
            simulation = supple.Simulation(two_drops({MASS: mass, MODULUS: modulus}))
            simulation.advance_to(9)
            self.assertEqual(x, simulation.particles.position[1, 0])
        again = supple.read_table(self.path / "sweep")
        np.testing.assert_array_equal(again["x"], table["x"])

    def test_takes_scenes_of_any_kind(self):
        mapping = {"duration": 0.2, "frame_rate": 10, "gravity": [0, 0, 0],
                   "objects": [{"name": "ball", "particles": {"arrange": "single", "mass": 1, "inertia_radius": 1, "velocity": [1, 0, 0]}}]}
        measure = {"x": {"frames": "objects", "column": "x_m", "reduce": "final"}}
        key = "objects.ball.particles.velocity"
        expected = [0.4, 0.6]
        values = [[2, 0, 0], [3, 0, 0]]
        np.testing.assert_allclose(supple.sweep(mapping, {key: values}, measures=measure)["x"], expected)
        np.testing.assert_allclose(supple.sweep(supple.Scene(mapping), {key: values}, measures=measure)["x"], expected)
        read = supple.read_scene(self.scene, {"objects.right.particles.at": [5, 0, 0]})
        table = supple.sweep(read, {MASS: [1, 2]}, measures={"x": {"frames": "objects", "of": "right", "column": "x_m", "reduce": "final"}})
        np.testing.assert_allclose(table["x"], [5, 5])

    def test_keeps_failed_points(self):
        chain = {"duration": 10, "frame_rate": 10, "time_step": {"size": 0.1, "substeps": 1},
                 "objects": [{"name": "chain", "particles": {"arrange": "line", "count": 3, "spacing": 0.2, "spin": [0, 0, 3], "mass": 0.01},
                              "interactions": [{"law": "bond_frame", "stretch": 1e6, "rotation": 10}]}]}
        loose = {"law": "bond_frame", "stretch": 1e-3, "rotation": 1e-9}
        table = supple.sweep(chain, {"objects.chain.interactions[0]": [chain["objects"][0]["interactions"][0], loose]}, measures={"e": {"frames": "energies", "column": "total_j", "reduce": "max"}})
        self.assertEqual(list(table["outcome"]), ["diverged", "done"])
        self.assertTrue(np.isnan(table["e"][0]) and np.isfinite(table["e"][1]))
        self.assertIn("diverged at step", table["reason"][0])
        self.assertEqual(table.done().rows, 1)

    def test_says_what_is_wrong(self):
        with self.assertRaisesRegex(supple.Error, "did you mean 'mass'") as raised:
            supple.sweep(self.scene, {"objects.left.particles.mas": [1, 2]})
        self.assertEqual(raised.exception.kind, "scene")
        with self.assertRaisesRegex(supple.Error, "expected the folder of a sweep"):
            supple.read_table(self.path)
        with self.assertRaisesRegex(KeyError, "columns: point"):
            supple.sweep(self.scene, {MASS: [1]}, folder=self.path / "one")["none"]

    @unittest.skipUnless(has("pandas"), "pandas is not installed")
    def test_is_a_data_frame(self):
        table = supple.Table({"point": np.array([1, 2]), "outcome": np.array(["done", "limit"], dtype=object), "x": np.array([0.5, np.nan])})
        frame = table.to_pandas()
        self.assertEqual(list(frame.columns), ["point", "outcome", "x"])
        self.assertEqual(frame["x"][0], 0.5)

    @unittest.skipUnless(has("pyarrow"), "pyarrow is not installed")
    def test_is_written_as_parquet(self):
        import pyarrow.parquet
        table = supple.Table({"point": np.array([1, 2]), "outcome": np.array(["done", "limit"], dtype=object), "x": np.array([0.5, np.nan])})
        table.write_parquet(self.path / "table.parquet")
        self.assertEqual(pyarrow.parquet.read_table(self.path / "table.parquet").column_names, ["point", "outcome", "x"])

    @unittest.skipUnless(has("matplotlib"), "matplotlib is not installed")
    def test_is_drawn(self):
        folder = self.path / "sweep"
        supple.sweep(self.scene, {MASS: "0.25:1:3", MODULUS: "1e3:1e5:log3"}, folder=folder)
        for over in ([MASS], [MASS, MODULUS]):
            file = self.path / f"{len(over)}.svg"
            words = [word for key in over for word in ("--over", key)]
            environment = os.environ | {"SUPPLE_PYTHON": sys.executable}
            subprocess.run([TOOL, "sweep", folder, "--plot", "left-right.peak_force_n", *words, "--svg", file], check=True, env=environment, stdout=subprocess.DEVNULL)
            text = file.read_text()
            self.assertIn("<svg", text)
            subprocess.run([TOOL, "sweep", folder, "--plot", "left-right.peak_force_n", *words, "--svg", file], check=True, env=environment, stdout=subprocess.DEVNULL)
            self.assertEqual(file.read_text(), text)
        with self.assertRaisesRegex(supple.Error, "expected a column of the table, found 'none'"):
            supple.read_table(folder).plot("none")
        with self.assertRaisesRegex(supple.Error, "expected a column of numbers"):
            supple.read_table(folder).plot("outcome")

    @unittest.skipIf(has("matplotlib"), "matplotlib is installed")
    def test_says_that_matplotlib_is_needed(self):
        table = supple.Table({"x": np.array([1.0, 2.0]), "outcome": np.array(["done", "done"], dtype=object)}, ["x"])
        with self.assertRaisesRegex(supple.Error, "expected the package matplotlib, found none"):
            table.plot("x")


def force_over_distance(scene):
    """Of the two drops, pressed together."""
    simulation = supple.Simulation(scene)
    forces = []
    for distance in np.linspace(0.5, 0.3, 8):
        simulation.set_particles(position=[[-distance / 2, 0, 0], [distance / 2, 0, 0]])
        contact = simulation.contact("left", "right", error=1e-8)
        forces.append(np.linalg.norm(contact.elastic_force))
    return forces


@unittest.skipUnless(has("scipy"), "SciPy is not installed")
class Fit(unittest.TestCase):
    def test_finds_the_modulus_of_a_force_curve(self):
        target = force_over_distance(two_drops({MODULUS: 7300.0}))
        fit = supple.fit_parameters(two_drops(), {MODULUS: (1e3, 1e5)}, force_over_distance, target)
        self.assertAlmostEqual(fit.values[MODULUS] / 7300.0, 1.0, delta=1e-4)
        self.assertLess(fit.residual, 1e-4 * max(target))

    def test_states_the_error_that_noise_makes(self):
        noise = 1 + 0.01 * np.random.default_rng(5).standard_normal(8)
        target = np.array(force_over_distance(two_drops({MODULUS: 7300.0}))) * noise
        fit = supple.fit_parameters(two_drops(), {MODULUS: (1e3, 5e3, 1e5)}, force_over_distance, target)
        self.assertLess(abs(fit.values[MODULUS] - 7300.0), 4 * fit.errors[MODULUS])
        self.assertLess(fit.errors[MODULUS], 0.1 * 7300.0)
        self.assertEqual(fit.measured.shape, target.shape)

    @unittest.skipUnless(TOOL, "the command line tool is not built")
    def test_takes_measures(self):
        measure = {"speed": {"frames": "objects", "of": "right", "column": "vx_m_s", "reduce": "final"}}
        key = "objects.right.particles.mass"
        target = supple.sweep(two_drops(), {key: [0.8]}, measures=measure)["speed"]
        fit = supple.fit_parameters(two_drops(), {key: (0.3, 2.0)}, measure, target)
        self.assertAlmostEqual(fit.values[key], 0.8, delta=1e-3)

    def test_says_what_is_wrong(self):
        for given in ((1.0,), (2.0, 1.0), (1.0, float("nan"))):
            with self.assertRaisesRegex(supple.Error, "expected \\(low, high\\)"):
                supple.fit_parameters(two_drops(), {MODULUS: given}, force_over_distance, [1.0])
        with self.assertRaisesRegex(supple.Error, "expected 2 finite numbers"):
            supple.fit_parameters(two_drops(), {MODULUS: (1e3, 1e5)}, force_over_distance, [1.0, 2.0])


@unittest.skipIf(has("scipy"), "SciPy is installed")
class FitWithoutSciPy(unittest.TestCase):
    def test_says_that_it_is_needed(self):
        with self.assertRaisesRegex(supple.Error, "expected the package scipy, found none"):
            supple.fit_parameters(two_drops(), {MODULUS: (1e3, 1e5)}, force_over_distance, [1.0])


class ExperimentsPage(unittest.TestCase):
    @unittest.skipUnless(TOOL and has("scipy"), "the command line tool or SciPy is missing")
    def test_has_examples_that_run(self):
        examples = re.findall(r"```python\n(.*?)```", (SOURCE / "docs/experiments.md").read_text(), re.DOTALL)
        self.assertEqual(len(examples), 2)
        here = os.getcwd()
        os.chdir(SOURCE)
        try:
            for example in examples:
                exec(compile(example, "docs/experiments.md", "exec"), {})
        finally:
            os.chdir(here)

    @unittest.skipUnless(TOOL, "the command line tool is not built")
    def test_states_what_the_study_finds(self):
        """A few points of it: the closed form of the cap, within the figures of the page."""
        sys.path.insert(0, str(SOURCE / "examples/bounce"))
        self.addCleanup(sys.path.remove, str(SOURCE / "examples/bounce"))
        import study
        with tempfile.TemporaryDirectory() as folder:
            table = study.study(folder, modulus="1e4:1e6:log2", speed="0.1:1:log2")
        self.assertEqual(table.rows, 4)
        self.assertLess(np.max(np.abs(table["restitution_error"])), 1e-3)
        self.assertLess(np.max(np.abs(table["time_error"])), 1e-3)
        self.assertLess(np.max(np.abs(table["impulse_error"])), 1e-3)
        deep = table["depth_over_radius"] > 0.1
        self.assertTrue(np.all(np.abs(table["time_error_small_depth"])[deep] > 10 * np.abs(table["time_error"])[deep]))


if __name__ == "__main__":
    unittest.main()
