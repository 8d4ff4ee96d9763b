"""Where things are, and scenes that several tests use."""
import json
import os
import pathlib
import subprocess
import tempfile

import supple

SOURCE = pathlib.Path(__file__).resolve().parents[2]
LIBRARY = SOURCE / "scenes/library"
TOOL = os.environ.get("SUPPLE_TOOL")  #: the command line program, where it is built

TWO_DROPS = """
schema: 1
duration: 1 s
frame_rate: 8
objects:
  - name: left
    particles: {arrange: single, at: [-0.3, 0, 0], velocity: [1, 0, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 2e3}
  - name: right
    particles: {arrange: single, at: [0.3, 0, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 2e3}
camera: {from: [0, -3, 1], look_at: [0, 0, 0]}
output: {images: {size: [64, 48]}}
"""


def two_drops(overrides=None):
    return supple.parse_scene(TWO_DROPS, overrides, name="two_drops.yaml")


def library(name, overrides=None):
    return supple.read_scene(LIBRARY / f"{name}.yaml", overrides)


def run_tool(name, *arguments):
    """result.json of `supple run` on a scene that we ship."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([TOOL, "run", LIBRARY / f"{name}.yaml", "--out", folder, "--simulate-only", "--quiet",
                        "--progress", "none", *arguments], check=True)
        return json.loads((pathlib.Path(folder) / "result.json").read_text())
