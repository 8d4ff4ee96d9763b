"""Blender add-on: imports a run of supple, `supple export SCENE --gltf`, as one object per body whose mesh follows the frame.

Install it in Edit > Preferences > Add-ons > Install from Disk, then use File > Import > supple run (.glb). Blender's own importer of glTF makes an
object for each frame instead. Meshes are read from the .glb when a frame needs them; the file must stay where it is.
"""
import json
import math
import pathlib
import struct

import bpy
import numpy as np
from bpy.app.handlers import persistent
from bpy.props import StringProperty
from bpy.types import Operator
from bpy_extras.io_utils import ImportHelper
from mathutils import Quaternion

bl_info = {
    "name": "supple run",
    "author": "supple",
    "version": (0, 1, 0),
    "blender": (3, 6, 0),
    "location": "File > Import > supple run (.glb)",
    "description": "Meshes, materials and cameras of a simulated run, one mesh per frame",
    "category": "Import-Export",
}

_PATH = "supple_file"    # custom property of objects: the .glb
_BODY = "supple_body"    # and the name of the body in it
_TYPES = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_runs = {}               # by path: Run


class Run:
    """A .glb that supple wrote: arrays are views of the file."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        data = np.memmap(self.path, dtype=np.uint8, mode="r")
        magic, version, _, length, kind = struct.unpack("<IIIII", data[:20].tobytes())
        if magic != 0x46546C67 or version != 2 or kind != 0x4E4F534A:
            raise ValueError(f"{path}: expected a binary glTF 2.0 file")
        self.json = json.loads(data[20:20 + length].tobytes())
        if self.json["asset"].get("generator") != "supple":
            raise ValueError(f"{path}: expected a file of `supple export --gltf`; Blender's importer of glTF reads others")
        self.binary = data[28 + length:]
        self.scales = self._channels("scale")
        self.meshes = self._meshes()

    def array(self, number):
        """The values of an accessor, shape (count, width)."""
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        width = _WIDTHS[accessor["type"]]
        begin, kind = view.get("byteOffset", 0), np.dtype(_TYPES[accessor["componentType"]])
        end = begin + accessor["count"] * width * kind.itemsize
        return self.binary[begin:end].view(kind).reshape(-1, width)

    def _channels(self, what):
        found = {}
        for animation in self.json.get("animations", []):
            for channel in animation["channels"]:
                if channel["target"]["path"] == what:
                    sampler = animation["samplers"][channel["sampler"]]
                    found[channel["target"]["node"]] = (self.array(sampler["input"])[:, 0], self.array(sampler["output"]))
        return found

    def _meshes(self):
        """By body: times at which a mesh begins to show, and its number (None: nothing shows), ascending."""
        bodies = {}
        for number, node in enumerate(self.json["nodes"]):
            if "mesh" not in node:
                continue
            changes = bodies.setdefault(self.json["meshes"][node["mesh"]]["name"], [])
            times, scales = self.scales.get(number, (np.zeros(1), np.ones((1, 3))))
            for time, scale in zip(times, scales):
                changes.append((float(time), node["mesh"] if scale[0] > 0 else None))
        for changes in bodies.values():
            changes.sort(key=lambda c: (c[0], c[1] is not None))  # of two at a time the mesh that begins
        return bodies

    def mesh_at(self, body, time):
        """Number of the mesh of a body at a time [s]; None where it has none."""
        shown = None
        for begin, number in self.meshes[body]:
            if begin > time + 1e-4:
                break
            shown = number
        return shown

    def fill(self, mesh, number):
        """Replaces the content of a mesh of Blender."""
        mesh.clear_geometry()
        if number is None:
            return
        part = self.json["meshes"][number]["primitives"][0]
        position = self.array(part["attributes"]["POSITION"])
        corner = self.array(part["indices"])[:, 0].astype(np.int32)
        mesh.vertices.add(len(position))
        mesh.vertices.foreach_set("co", np.ascontiguousarray(position, dtype=np.float32).ravel())
        mesh.loops.add(len(corner))
        mesh.loops.foreach_set("vertex_index", corner)
        mesh.polygons.add(len(corner) // 3)
        mesh.polygons.foreach_set("loop_start", np.arange(0, len(corner), 3, dtype=np.int32))
        mesh.polygons.foreach_set("use_smooth", np.ones(len(corner) // 3, dtype=bool))
        mesh.update(calc_edges=True)
        normal = np.array(self.array(part["attributes"]["NORMAL"]))
        mesh.normals_split_custom_set_from_vertices(normal)


def _run_of(path):
    if path not in _runs:
        _runs[path] = Run(bpy.path.abspath(path))
    return _runs[path]


def _material(run, number):
    look = run.json["materials"][number]
    material = bpy.data.materials.new(look["name"])
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True  # as materials of later versions always do
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    values = look["pbrMetallicRoughness"]
    shader.inputs["Base Color"].default_value = values["baseColorFactor"]
    shader.inputs["Roughness"].default_value = values["roughnessFactor"]
    shader.inputs["Metallic"].default_value = values["metallicFactor"]
    material.diffuse_color = values["baseColorFactor"]
    return material


def _add_camera(run, number, node, scene, collection):
    look = run.json["cameras"][node["camera"]]["perspective"]
    data = bpy.data.cameras.new(node["name"])
    data.sensor_fit = "VERTICAL"
    data.angle = look["yfov"]
    camera = bpy.data.objects.new(node["name"], data)
    camera.rotation_mode = "QUATERNION"
    collection.objects.link(camera)
    rate = scene.render.fps / scene.render.fps_base
    camera.location = node["translation"]
    x, y, z, w = node["rotation"]
    camera.rotation_quaternion = Quaternion((w, x, y, z))
    for path, what in (("location", "translation"), ("rotation_quaternion", "rotation")):
        times, values = run._channels(what).get(number, ((), ()))
        for time, value in zip(times, values):
            setattr(camera, path, value if what == "translation" else Quaternion((value[3], *value[:3])))
            camera.keyframe_insert(path, frame=run.json["asset"]["extras"]["first_frame"] + float(time) * rate)
    return camera


@persistent
def follow(scene, _graph=None):
    """Shows the meshes of the scene's frame."""
    for thing in scene.objects:
        if _PATH not in thing:
            continue
        try:
            run = _run_of(thing[_PATH])
        except (OSError, ValueError) as failure:
            print(f"supple: {failure}")
            continue
        frames = scene.frame_current_final - run.json["asset"]["extras"]["first_frame"]
        number = run.mesh_at(thing[_BODY], frames * scene.render.fps_base / scene.render.fps)
        if thing.get("supple_shown", -2) != (-1 if number is None else number):
            run.fill(thing.data, number)
            thing["supple_shown"] = -1 if number is None else number


def load(path, scene):
    """Adds the bodies and cameras of a run to a scene, which gets the frames and the frame rate of the run.

    path  the .glb of `supple export --gltf`
    """
    run = _runs[str(path)] = Run(path)
    timing = run.json["asset"]["extras"]
    scene.render.fps = math.ceil(timing["frame_rate"])
    scene.render.fps_base = scene.render.fps / timing["frame_rate"]
    collection = bpy.data.collections.new(pathlib.Path(path).stem)
    scene.collection.children.link(collection)
    for body in run.meshes:
        mesh = bpy.data.meshes.new(body)
        thing = bpy.data.objects.new(body, mesh)
        thing[_PATH], thing[_BODY] = str(path), body
        number = next(k for _, k in run.meshes[body] if k is not None)
        mesh.materials.append(_material(run, run.json["meshes"][number]["primitives"][0]["material"]))
        collection.objects.link(thing)
    for number, node in enumerate(run.json["nodes"]):
        if "camera" in node:
            camera = _add_camera(run, number, node, scene, collection)
            scene.camera = scene.camera or camera
    scene.frame_start, scene.frame_end = timing["first_frame"], timing["last_frame"]
    follow(scene)
    return collection


class ImportSuppleRun(Operator, ImportHelper):
    """Imports a run of supple: meshes, materials and cameras"""

    bl_idname = "import_scene.supple_run"
    bl_label = "Import supple run"
    filename_ext = ".glb"
    filter_glob: StringProperty(default="*.glb", options={"HIDDEN"})

    def execute(self, context):
        try:
            load(self.filepath, context.scene)
        except (OSError, ValueError, KeyError) as failure:
            self.report({"ERROR"}, str(failure))
            return {"CANCELLED"}
        return {"FINISHED"}


def _menu(self, _context):
    self.layout.operator(ImportSuppleRun.bl_idname, text="supple run (.glb)")


def register():
    bpy.utils.register_class(ImportSuppleRun)
    bpy.types.TOPBAR_MT_file_import.append(_menu)
    bpy.app.handlers.frame_change_post.append(follow)
    bpy.app.handlers.load_post.append(_forget)


def unregister():
    bpy.app.handlers.load_post.remove(_forget)
    bpy.app.handlers.frame_change_post.remove(follow)
    bpy.types.TOPBAR_MT_file_import.remove(_menu)
    bpy.utils.unregister_class(ImportSuppleRun)


@persistent
def _forget(_path=None, _unused=None):
    _runs.clear()


if __name__ == "__main__":
    register()
