#!/usr/bin/env python3
"""Every long command ends within a second of SIGINT or SIGTERM, with 130 or 143, and leaves no incomplete file under a final name.

usage: signals_test.py SUPPLE SCRATCH
"""
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import time
import unittest

SUPPLE, SCRATCH = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
# Minutes of work for one thread before the first step.
LARGE = """schema: 1
duration: 0.1
frame_rate: 10
objects:
  - name: ball
    particles: {arrange: geodesic, frequency: 300, radius: 1}
    skeleton: [{shape: point, kernel: {radius: 0.5}}]
"""
# Minutes of steps, and of pictures.
LONG = """schema: 1
duration: 100 s
frame_rate: 100
gravity: [0, 0, -9.81]
ground: {height: -0.5}
objects:
  - name: ball
    particles: {arrange: ball, radius: 0.3, spacing: 0.1, mass: 1}
    interactions: [{law: bond_frame, neighbours: 6, stretch: 1e3, rotation: 0.1}]
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.15}}]
output: {images: {size: [640, 480]}}
"""
MEMORY = ["--memory", "100G"]


def processor_time():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def time_of(process):
    """Processor time so far [s]."""
    words = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


class Signals(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(SCRATCH, ignore_errors=True)
        SCRATCH.mkdir(parents=True)
        (SCRATCH / "large.yaml").write_text(LARGE)
        (SCRATCH / "long.yaml").write_text(LONG)

    def ends_soon(self, *words):
        for number in (signal.SIGINT, signal.SIGTERM):
            for worked in (0.3, 0.8):
                with self.subTest(words=words, signal=number, after=worked):
                    before = processor_time()
                    process = subprocess.Popen([SUPPLE, *words], cwd=SCRATCH, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
                    while process.poll() is None and time_of(process) < worked:
                        time.sleep(0.01)
                    self.assertIsNone(process.poll(), "ended before the signal")
                    began, used = time.monotonic(), time_of(process)
                    process.send_signal(number)
                    message = process.communicate(timeout=60)[1]
                    waited, used = time.monotonic() - began, processor_time() - before - used
                    self.assertEqual(process.returncode, 128 + number, message)
                    self.assertIn(b"interrupted", message)
                    # A second of the clock, or on a busy machine of processor time.
                    self.assertLess(min(waited, used), 1.1)

    def test_while_a_large_scene_is_read(self):
        self.ends_soon("check", "large.yaml", "--time-limit", "1000", *MEMORY)
        self.ends_soon("explain", "large.yaml", *MEMORY)
        self.ends_soon("query", "forces", "large.yaml", *MEMORY)
        self.ends_soon("run", "large.yaml", "--dry-run", *MEMORY)
        self.ends_soon("run", "large.yaml", "--overwrite", "--simulate-only", *MEMORY)

    def test_in_a_run(self):
        self.ends_soon("run", "long.yaml", "--overwrite")
        self.ends_soon("run", "long.yaml", "--overwrite", "--set", "render.renderer=path")

    def test_in_a_mesh(self):
        self.ends_soon("query", "mesh", "long.yaml", "--cells", "768", "--out", "mesh.ply", *MEMORY)
        self.assertFalse((SCRATCH / "mesh.ply").exists())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
