import gc
import pathlib
import tempfile
import threading
import unittest

import numpy as np
import supple
from support import two_drops


def touching(overrides=None):
    simulation = supple.Simulation(two_drops({"objects.left.particles.at": [-0.15, 0, 0], "objects.right.particles.at": [0.15, 0, 0],
                                              "output.cell": 0.02, **(overrides or {})}))
    return simulation


class Meshes(unittest.TestCase):
    def test_are_closed_and_share_the_contact(self):
        meshes = touching().meshes()
        self.assertEqual(list(meshes), ["left", "right"])
        for mesh in meshes.values():
            self.assertEqual((mesh.position.shape, mesh.normal.shape), ((len(mesh.position), 3),) * 2)
            self.assertLess(mesh.triangle.max(), len(mesh.position))
            report = mesh.inspect()
            self.assertTrue(report.closed and report.oriented)
            self.assertEqual((report.euler_characteristic, report.components), (2, 1))
            # The divergence theorem again, with NumPy.
            a, b, c = (mesh.position[mesh.triangle[:, k]] for k in range(3))
            self.assertAlmostEqual(np.einsum("ij,ij->", a, np.cross(b, c)) / 6, report.volume, delta=1e-12)
        shared = [{tuple(p) for p in mesh.position[mesh.columns["contact"] > 0]} for mesh in meshes.values()]
        self.assertGreater(len(shared[0]), 20)
        self.assertEqual(shared[0], shared[1])

    def test_carry_what_looks_show(self):
        simulation = touching({"objects.left.look": {"colour_by": "pressure", "range": [0, 100]}})
        pressure = simulation.meshes()["left"].columns["pressure"]
        largest = simulation.contacts()[0].largest_pressure
        self.assertLessEqual(pressure.max(), largest * (1 + 1e-9))
        self.assertGreater(pressure.max(), 0.9 * largest)

    def test_have_cells_of_their_own(self):
        simulation = touching()
        self.assertEqual(simulation.cell, 0.02)
        coarse = simulation.meshes()["left"]
        simulation.cell = 0.01
        fine = simulation.meshes()["left"]
        # Areas of cells are a fourth.
        self.assertAlmostEqual(len(fine.triangle) / len(coarse.triangle), 4, delta=0.4)
        simulation.set_cells(30)
        self.assertAlmostEqual(simulation.cell, 0.3 / 30 + 0.5 * 0.454202019 * 2 / 30, delta=1e-3)
        for wrong in 0, -1, float("nan"):
            with self.assertRaises(ValueError):
                simulation.cell = wrong

    def test_outlive_their_simulation(self):
        position = touching().meshes()["left"].position
        gc.collect()
        self.assertTrue(np.isfinite(position).all())
        self.assertFalse(position.flags.owndata or position.flags.writeable)

    def test_are_written(self):
        mesh = touching().meshes()["left"]
        with tempfile.TemporaryDirectory() as folder:
            for name in "mesh.ply", "mesh.obj":
                mesh.write(pathlib.Path(folder) / name)
                self.assertGreater((pathlib.Path(folder) / name).stat().st_size, 1000)
            with self.assertRaisesRegex(supple.Error, "expected a .ply or .obj file"):
                mesh.write(pathlib.Path(folder) / "mesh.stl")


class Fields(unittest.TestCase):
    def test_are_those_of_the_kernels(self):
        simulation = touching()
        random = np.random.default_rng(1)
        points = random.uniform(-0.7, 0.7, (500, 3))
        values, gradients = simulation.field("left", points)
        # (1 - rho^2)^3 - 1/2 of a Wyvill point of radius 0.5 at (-0.15, 0, 0).
        arm = points - [-0.15, 0, 0]
        inside = np.maximum(0, 1 - (arm**2).sum(axis=1) / 0.25)
        np.testing.assert_allclose(values, inside**3 - 0.5, atol=1e-14)
        np.testing.assert_allclose(gradients, (-6 * inside**2 / 0.25)[:, None] * arm, atol=1e-13)
        self.assertEqual([a.shape for a in simulation.field("left", np.zeros((0, 3)))], [(0,), (0, 3)])

    def test_need_points_in_rows(self):
        with self.assertRaisesRegex(supple.Error, r"points: expected an array of shape \(n, 3\), found shape \(2, 2\)"):
            touching().field("left", [[0, 0], [1, 1]])


class Pictures(unittest.TestCase):
    def test_are_arrays_and_files(self):
        simulation, other = touching(), touching()
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "picture.png"
            picture = simulation.picture(path)
            self.assertEqual((picture.shape, picture.dtype), ((48, 64, 3), np.uint8))
            self.assertEqual(path.read_bytes()[:4], b"\x89PNG")
        self.assertGreater(len(np.unique(picture.reshape(-1, 3), axis=0)), 100)
        self.assertEqual(simulation.picture(size=(40, 30)).shape, (30, 40, 3))
        self.assertEqual(simulation.state_hash, other.state_hash)
        np.testing.assert_array_equal(simulation.meshes()["left"].position, other.meshes()["left"].position)

    def test_are_the_same_from_every_thread(self):
        simulation, other = touching(), touching()
        here = simulation.picture()
        drawn = []
        threads = [threading.Thread(target=lambda s=s: drawn.append(s.picture())) for s in (simulation, other, simulation)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(drawn), 3)
        for picture in drawn:
            np.testing.assert_array_equal(picture, here)

    def test_refuse_what_is_no_camera_and_no_size(self):
        for arguments in {"camera": "side"}, {"size": (-1, 5)}:
            with self.assertRaises(supple.Error) as caught:
                touching().picture(**arguments)
            self.assertEqual(caught.exception.kind, "usage")


if __name__ == "__main__":
    unittest.main()
