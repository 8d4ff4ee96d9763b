"""Time against PSNR and FLIP of Mitsuba 3 and render_bench, on the studio of render_bench at 640 x 360.

    pip install mitsuba numpy flip-evaluator pillow
    python3 render_mitsuba.py path/to/render_bench [SAMPLES OF THE REFERENCE] [--work FOLDER]

The reference is by Mitsuba (scalar variant, 1024 samples per pixel, multi-jittered: independent samples leave a noise of FLIP .02)
and is kept in the work folder. Both pictures pass the same tone curve to 8 bits; PSNR and
FLIP compare these. CPU seconds are those of the whole picture, hierarchies included, without files and the start of the programs.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import mitsuba as mi
import numpy as np
from PIL import Image

from render_studio import AT, COLOURS, DIRECTION, FROM, SKY, SOFTNESS, SUN, compare, developed, linear

mi.set_variant("llvm_ad_rgb" if "llvm_ad_rgb" in mi.variants() and "--llvm" in sys.argv else "scalar_rgb")


def scene(folder, sampler):
    to_light = -DIRECTION / np.linalg.norm(DIRECTION)
    distance, centre = 1e5, np.array(AT)  # so far that its light is parallel over the floor
    t = mi.ScalarTransform4f
    parts = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 8, "hide_emitters": True},
        "sensor": {"type": "perspective", "sampler": sampler, "fov": float(np.degrees(0.6)), "fov_axis": "y",
                   "to_world": t().look_at(origin=FROM, target=AT, up=[0, 0, 1]),
                   "film": {"type": "hdrfilm", "width": 640, "height": 360, "rfilter": {"type": "box"}, "pixel_format": "rgb"}},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": SKY}},
        "sun": {"type": "disk",
                "to_world": t().look_at(origin=(centre + distance * to_light).tolist(), target=AT, up=[0, 0, 1])
                @ t().scale(float(distance * np.tan(SOFTNESS))),
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": (SUN / np.sin(SOFTNESS) ** 2).tolist()}}},
    }
    for i, colour in enumerate(COLOURS):
        parts[f"body{i}"] = {"type": "ply", "filename": f"{folder}/{i}.ply",
                             "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(map(float, linear(colour)))}}}
    return mi.load_dict(parts)


def render(world, samples, seed):
    begin = time.process_time()
    image = np.array(mi.render(world, spp=samples, seed=seed))
    return image, time.process_time() - begin


def reference(folder, work, samples):
    path = work / f"reference_{samples}.npy"
    if not path.exists():
        np.save(path, render(scene(folder, {"type": "multijitter", "sample_count": samples}), samples, 1)[0])
    return developed(np.load(path))


def main():
    bench = sys.argv[1]
    samples = int(sys.argv[2]) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 1024
    work = pathlib.Path(sys.argv[sys.argv.index("--work") + 1] if "--work" in sys.argv else "render_mitsuba_work")
    work.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([bench, "studio", folder], check=True)
        truth = reference(folder, work, samples)
        Image.fromarray(truth).save(work / "reference.png")
        for noise in ["0.4", "0.2", "0.1", "0.05", "0.02"]:
            out = work / f"ours_{noise}.png"
            line = json.loads(subprocess.run([bench, "path", noise, out], check=True, capture_output=True, text=True).stdout)
            print(json.dumps({"renderer": "supple", "noise": noise, "cpu_s": round(line["cpu_ms"] / 1e3, 3),
                              **compare(truth, np.array(Image.open(out)))}), flush=True)
        world = scene(folder, {"type": "independent"})
        for count in [1, 4, 16, 64]:
            image, seconds = render(world, count, 2)
            print(json.dumps({"renderer": "mitsuba " + mi.__version__, "samples": count, "cpu_s": round(seconds, 3),
                              **compare(truth, developed(image))}), flush=True)


main()
