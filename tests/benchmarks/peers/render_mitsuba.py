"""Time against PSNR and FLIP beside Mitsuba 3, on the studio of render_bench at 640 x 360.

    pip install mitsuba numpy flip-evaluator pillow
    python3 render_mitsuba.py path/to/render_bench [SAMPLES OF THE REFERENCE] [--work FOLDER]

The reference is Mitsuba's (scalar variant, 1024 samples a pixel, multi-jittered: independent ones leave a noise of FLIP .02
themselves), kept in the work folder for the next time. Both go through the same tone curve to 8 bits; PSNR and
FLIP are of those. CPU seconds are of the whole picture, hierarchies included, files and start of the programs not.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import flip_evaluator
import mitsuba as mi
import numpy as np
from PIL import Image

mi.set_variant("llvm_ad_rgb" if "llvm_ad_rgb" in mi.variants() and "--llvm" in sys.argv else "scalar_rgb")
SUN, SKY, EXPOSURE, SOFTNESS = 3.0 * np.array([1.0, 0.965, 0.91]), [0.93, 1.0, 1.10], 0.42, 0.03
COLOURS = [[0.80, 0.30, 0.20], [0.25, 0.45, 0.75], [0.85, 0.70, 0.25], [0.80, 0.80, 0.78]]
FROM, AT, DIRECTION = [0.4, -4.2, 3.0], [0, 0, 0.3], np.array([-0.45, 0.35, -1.0])


def linear(c):
    c = np.asarray(c)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def developed(radiance):
    x = np.maximum(radiance, 0) * EXPOSURE
    v = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)
    return np.round(255 * np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)).astype(np.uint8)


def scene(folder, sampler):
    to_light = -DIRECTION / np.linalg.norm(DIRECTION)
    distance, centre = 1000.0, np.array(AT)
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


def compare(reference, image):
    error = np.mean((reference.astype(float) - image.astype(float)) ** 2)
    _, flip, _ = flip_evaluator.evaluate(reference.astype(np.float32) / 255, image.astype(np.float32) / 255, "LDR")
    return {"psnr_db": round(float(10 * np.log10(255 ** 2 / error)), 2), "flip": round(float(flip), 4)}


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
