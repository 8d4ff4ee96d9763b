"""Time against PSNR and FLIP of Blender's Cycles on the CPU, on the studio of render_bench at 640 x 360.

    pip install bpy numpy flip-evaluator pillow
    python3 render_cycles.py path/to/render_bench [SAMPLES OF THE REFERENCE] [--work FOLDER] [--most SAMPLES]

Meshes, camera, sky, sun and matt colours are those of render_mitsuba.py, and so is the tone curve to 8 bits, applied to
scene-linear EXR files; PSNR and FLIP compare the 8-bit pictures. The reference is by Cycles itself (1024 samples per pixel, not denoised, other
seeds) and is kept in the work folder: the pictures of two renderers also differ systematically, so each is compared
with its own reference. The pictures of render_bench are compared with that of Cycles as well, to show that the scene is the same.
CPU seconds are those of a scene that Cycles has loaded, the least of two renderings below 16 samples; the additional time of the first
rendering (transfer of meshes, hierarchies) is printed separately; files and the start of the program are not included.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import bpy
import numpy as np
from mathutils import Vector
from PIL import Image

from render_studio import AT, COLOURS, DIRECTION, FROM, SKY, SOFTNESS, SUN, compare, developed, linear


def towards(thing, direction):
    thing.rotation_euler = Vector(direction).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(thing)


def matt(name, colour):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    diffuse, out = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (*map(float, linear(colour)), 1)
    diffuse.inputs["Roughness"].default_value = 0
    material.node_tree.links.new(diffuse.outputs["BSDF"], out.inputs["Surface"])
    return material


def build(folder):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for i, colour in enumerate(COLOURS):
        bpy.ops.wm.ply_import(filepath=f"{folder}/{i}.ply", forward_axis="Y", up_axis="Z")
        body = bpy.context.selected_objects[0]
        body.data.shade_smooth()
        body.data.materials.clear()
        body.data.materials.append(matt(f"matt{i}", colour))
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit, lens.angle_y = "VERTICAL", 0.6
    scene.camera = bpy.data.objects.new("camera", lens)
    scene.camera.location = FROM
    towards(scene.camera, np.array(AT) - FROM)
    sun = bpy.data.lights.new("sun", "SUN")
    sun.angle, sun.energy, sun.color = 2 * SOFTNESS, float(np.pi * SUN.max()), SUN / SUN.max()  # irradiance
    towards(bpy.data.objects.new("sun", sun), DIRECTION)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    nodes = scene.world.node_tree.nodes
    nodes.clear()
    sky, out = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    sky.inputs["Color"].default_value = (*SKY, 1)
    scene.world.node_tree.links.new(sky.outputs["Background"], out.inputs["Surface"])
    picture = scene.render
    picture.engine, picture.resolution_x, picture.resolution_y, picture.resolution_percentage = "CYCLES", 640, 360, 100
    picture.use_compositing = picture.use_sequencer = False
    picture.use_persistent_data = True
    picture.image_settings.file_format, picture.image_settings.color_depth = "OPEN_EXR", "32"
    cycles = scene.cycles
    cycles.device, cycles.pixel_filter_type, cycles.use_adaptive_sampling = "CPU", "BOX", False
    cycles.max_bounces = cycles.diffuse_bounces = 6  # seven places of scattering, as with Mitsuba's depth 8
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.denoiser, cycles.denoising_use_gpu = "OPENIMAGEDENOISE", False


def render(samples, seed, denoised, folder):
    cycles = bpy.context.scene.cycles
    cycles.samples, cycles.seed, cycles.use_denoising = samples, seed, denoised
    begin = time.process_time()
    bpy.ops.render.render()
    seconds = time.process_time() - begin
    path = str(pathlib.Path(folder) / "picture.exr")
    bpy.data.images["Render Result"].save_render(path)
    image = bpy.data.images.load(path)
    pixels = np.empty(640 * 360 * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(360, 640, -1)[::-1, :, :3].astype(float), seconds


def reference(folder, work, samples):
    """The mean of parts of 64 samples, each with a seed of its own and kept, so that a better one goes on from there."""
    parts = []
    for part in range((samples + 63) // 64):
        path = work / f"cycles_part_{part}.npy"
        if not path.exists():
            np.save(path, render(64, 1000 + part, False, folder)[0])
        parts.append(np.load(path))
    return developed(np.mean(parts, axis=0))


def main():
    bench = sys.argv[1]
    samples = int(sys.argv[2]) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 1024
    work = pathlib.Path(sys.argv[sys.argv.index("--work") + 1] if "--work" in sys.argv else "render_cycles_work")
    most = int(sys.argv[sys.argv.index("--most") + 1]) if "--most" in sys.argv else 64
    work.mkdir(parents=True, exist_ok=True)
    name = "cycles " + bpy.app.version_string
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([bench, "studio", folder], check=True)
        build(folder)
        first, again = (render(1, 1, False, folder)[1] for _ in range(2))
        print(json.dumps({"renderer": name, "what": "meshes handed over and hierarchies", "cpu_s": round(first - again, 3)}), flush=True)
        truth = reference(folder, work, samples)
        Image.fromarray(truth).save(work / "cycles.png")
        for count in [n for n in [1, 4, 16, 64] if n <= most]:
            for denoised in [False, True]:
                runs = [render(count, 2, denoised, folder) for _ in range(2 if count < 16 else 1)]
                image = developed(runs[0][0])
                Image.fromarray(image).save(work / f"cycles_{count}{'_denoised' * denoised}.png")
                print(json.dumps({"renderer": name, "samples": count, "denoised": denoised,
                                  "cpu_s": round(min(seconds for _, seconds in runs), 3), **compare(truth, image)}), flush=True)
        for noise in ["0.4", "0.2", "0.1"]:
            out = work / f"ours_{noise}.png"
            line = json.loads(subprocess.run([bench, "path", noise, out], check=True, capture_output=True, text=True).stdout)
            print(json.dumps({"renderer": "supple, against the reference of Cycles", "noise": noise,
                              "cpu_s": round(line["cpu_ms"] / 1e3, 3), **compare(truth, np.array(Image.open(out)))}), flush=True)


main()
