"""The Blender add-on, in Blender as a Python module (pip install bpy)."""
import importlib.util
import pathlib
import tempfile
import unittest

import numpy as np

import supple
from support import SOURCE, two_drops


def add_on():
    spec = importlib.util.spec_from_file_location("supple_import", SOURCE / "scenes/blender/supple_import.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def corners(mesh):
    values = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


@unittest.skipUnless(importlib.util.find_spec("bpy"), "no bpy")
class AddOn(unittest.TestCase):
    def test_shows_the_meshes_of_each_frame(self):
        import bpy

        scene = two_drops({"duration": 0.75, "objects.left.colour": [1, 0, 0]})
        module = add_on()
        module.register()
        with tempfile.TemporaryDirectory() as folder:
            supple.run(scene, folder, simulate_only=True, threads=1)
            path = supple.write_gltf(scene, folder)
            bpy.ops.wm.read_factory_settings(use_empty=True)
            self.assertEqual(bpy.ops.import_scene.supple_run(filepath=str(path)), {"FINISHED"})
            self.follow(bpy, scene)
            saved = pathlib.Path(folder) / "saved.blend"
            bpy.ops.wm.save_as_mainfile(filepath=str(saved))
            bpy.ops.wm.open_mainfile(filepath=str(saved))
            self.follow(bpy, scene)
            (pathlib.Path(folder) / "other.glb").write_bytes(b"something else, of more than twenty bytes")
            with self.assertRaises(RuntimeError):
                bpy.ops.import_scene.supple_run(filepath=str(pathlib.Path(folder) / "other.glb"))
        module.unregister()

    def follow(self, bpy, scene):
        import mathutils

        shown = bpy.context.scene
        self.assertEqual((shown.frame_start, shown.frame_end, shown.render.fps), (1, 7, 8))
        simulation = supple.Simulation(scene)
        for frame in simulation.frames():
            shown.frame_set(frame)
            for name, mesh in simulation.meshes().items():
                drawn = shown.objects[name].data
                np.testing.assert_allclose(corners(drawn), mesh.position, atol=1e-6)
                self.assertEqual(len(drawn.polygons), len(mesh.triangle))
        shader = next(n for n in shown.objects["left"].data.materials[0].node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        self.assertEqual(tuple(shader.inputs["Base Color"].default_value), (1, 0, 0, 1))
        camera = shown.camera
        np.testing.assert_allclose(camera.location, [0, -3, 1], atol=1e-6)
        towards = camera.rotation_quaternion.to_matrix() @ mathutils.Vector((0, 0, -1))
        np.testing.assert_allclose(towards, np.array([0, 3, -1]) / np.sqrt(10), atol=1e-6)


if __name__ == "__main__":
    unittest.main()
