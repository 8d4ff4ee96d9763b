import json
import pathlib
import struct
import tempfile
import unittest

import numpy as np

import supple
from support import two_drops

KINDS = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


class Model:
    """A .glb by the specification of glTF 2.0."""

    def __init__(self, data):
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.json = json.loads(data[20:20 + size])
        length, kind = struct.unpack_from("<I4s", data, 20 + size)
        assert kind == b"BIN\0" and length == self.json["buffers"][0]["byteLength"]
        self.binary = data[28 + size:]

    def array(self, number):
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        width = WIDTHS[accessor["type"]]
        values = np.frombuffer(self.binary, KINDS[accessor["componentType"]], accessor["count"] * width, view["byteOffset"]).reshape(-1, width)
        for bound, extreme in (("min", values.min), ("max", values.max)):
            if bound in accessor:
                np.testing.assert_array_equal(accessor[bound], extreme(axis=0))
        return values

    def scale(self, node, time):
        """By the animation; the node's own without one."""
        for channel in self.json["animations"][0]["channels"]:
            if channel["target"] == {"node": node, "path": "scale"}:
                sampler = self.json["animations"][0]["samplers"][channel["sampler"]]
                assert sampler["interpolation"] == "STEP"
                times, values = self.array(sampler["input"])[:, 0], self.array(sampler["output"])
                return values[max(0, np.searchsorted(times, time + 1e-6, side="right") - 1)][0]
        return self.json["nodes"][node].get("scale", [1])[0]

    def shown(self, time):
        """Meshes by name at a time."""
        return {self.json["meshes"][node["mesh"]]["name"]: self.json["meshes"][node["mesh"]]["primitives"][0]
                for number, node in enumerate(self.json["nodes"]) if "mesh" in node and self.scale(number, time) == 1}


class GltfFile(unittest.TestCase):
    def test_shows_each_frame_at_its_time(self):
        scene = two_drops({"duration": 0.75})
        with tempfile.TemporaryDirectory() as folder:
            supple.run(scene, folder, simulate_only=True, threads=1)
            path = supple.write_gltf(scene, folder)
            self.assertEqual(path, pathlib.Path(folder) / "two_drops.glb")
            model = Model(path.read_bytes())
        simulation = supple.Simulation(scene)
        for frame in simulation.frames():
            shown = model.shown((frame - 1) / scene.frame_rate)
            self.assertEqual(set(shown), {"left", "right"})
            for name, mesh in simulation.meshes().items():
                np.testing.assert_allclose(model.array(shown[name]["attributes"]["POSITION"]), mesh.position, atol=1e-7)
                np.testing.assert_allclose(model.array(shown[name]["attributes"]["NORMAL"]), mesh.normal, atol=1e-6)
                np.testing.assert_array_equal(model.array(shown[name]["indices"]).reshape(-1, 3), mesh.triangle)
        self.assertEqual(len(model.json["cameras"]), 1)
        self.assertEqual(model.json["asset"]["extras"], {"frame_rate": 8.0, "first_frame": 1, "last_frame": 7})

    def test_shares_meshes_that_stay(self):
        """A body at rest has one mesh for all frames."""
        scene = two_drops({"objects.left.particles.velocity": [0, 0, 0], "objects.right.particles.at": [3, 0, 0], "duration": 0.5})
        with tempfile.TemporaryDirectory() as folder:
            supple.run(scene, folder, simulate_only=True, threads=1)
            model = Model(supple.write_gltf(scene, folder).read_bytes())
        self.assertEqual(len(model.json["meshes"]), 2)
        self.assertNotIn("animations", model.json)


if __name__ == "__main__":
    unittest.main()
