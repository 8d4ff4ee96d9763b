#!/usr/bin/env python3
"""Every long command ends within a second of SIGINT or SIGTERM, with 130 or 143, and leaves no incomplete or temporary file and no process.

usage: signals_test.py SUPPLE SCRATCH ENDLESS_SYNC

ENDLESS_SYNC: a library to load first, in which writing a file to the disk never ends.
"""
import json
import math
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import time
import unittest

SUPPLE, SCRATCH, ENDLESS_SYNC = (pathlib.Path(word).resolve() for word in sys.argv[1:])
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
# The address sanitizer looks for leaks at the end, with a process of its own.
WITHOUT_LEAK_CHECK = {**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}


def bumpy_ball(across):
    """A closed mesh (OBJ), so fine that a fit of it takes minutes."""
    rings = [(math.pi * i / across, 2 * math.pi * j / across) for i in range(1, across) for j in range(across)]
    places = [(math.sin(t) * math.cos(p) * (1 + 0.2 * math.sin(5 * p)), math.sin(t) * math.sin(p), math.cos(t)) for t, p in rings] + [(0, 0, 1), (0, 0, -1)]
    top, bottom, faces = len(rings) + 1, len(rings) + 2, []
    for i in range(across - 1):
        for j in range(across):
            a, b = i * across + j + 1, i * across + (j + 1) % across + 1
            if i == 0:
                faces.append((top, a, b))
            if i == across - 2:
                faces.append((bottom, b, a))
            else:
                faces += [(a, a + across, b), (b, a + across, b + across)]
    return "".join("v %.9g %.9g %.9g\n" % place for place in places) + "".join("f %d %d %d\n" % face for face in faces)


def processor_time():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def time_of(process):
    """Processor time so far [s]."""
    words = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def alive(session):
    """Processes of a session that have not ended."""
    left = []
    for path in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            words = path.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(words[3]) == session and words[0] not in "ZX":
            left.append(path.parent.name)
    return left


class Signals(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(SCRATCH, ignore_errors=True)
        SCRATCH.mkdir(parents=True)
        (SCRATCH / "large.yaml").write_text(LARGE)
        (SCRATCH / "long.yaml").write_text(LONG)
        # A finished run, whose outputs take minutes.
        (SCRATCH / "some.yaml").write_text(LONG.replace("duration: 100 s", "duration: 0.5 s"))
        subprocess.run([SUPPLE, "run", "some.yaml", "--out", "some", "--simulate-only", "--quiet"], cwd=SCRATCH, check=True)

    def ends_soon(self, *words, after=(0.3, 0.8), by_clock=False, ends=None, message=b"interrupted", preload=None):
        """`after`: processor time of the command, or seconds of the clock, before each of the two signals. `ends`: exit codes by signal, where others than 128 + its number."""
        for number, worked in zip((signal.SIGINT, signal.SIGTERM), after, strict=True):
            with self.subTest(words=words, signal=number, after=worked):
                before = processor_time()
                environment = WITHOUT_LEAK_CHECK | ({"LD_PRELOAD": str(preload)} if preload else {})
                process = subprocess.Popen([SUPPLE, *words], cwd=SCRATCH, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)
                began = time.monotonic()
                while process.poll() is None and (time.monotonic() - began if by_clock else time_of(process)) < worked:
                    time.sleep(0.01)
                self.assertIsNone(process.poll(), "ended before the signal")
                began, used = time.monotonic(), time_of(process)
                process.send_signal(number)
                told = process.communicate(timeout=60)[1]
                waited, used = time.monotonic() - began, processor_time() - before - used
                self.assertEqual(process.returncode, ends(number) if ends else 128 + number, told)
                self.assertIn(message, told)
                # A second of the clock, or on a busy machine of processor time.
                self.assertLess(min(waited, used), 1.1)
                self.assertEqual(alive(process.pid), [])
                left = list(SCRATCH.rglob("*.tmp"))
                for path in left:  # the next commands leave none of their own
                    path.unlink()
                self.assertEqual(left, [])

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
        self.ends_soon("query", "mesh", "long.yaml", "--cells", "768", "--out", "mesh.ply", *MEMORY, after=(0.3, 0.6))
        self.assertFalse((SCRATCH / "mesh.ply").exists())

    def test_in_a_file_that_is_never_written(self):
        """The program ends in the middle of a call, and its temporary file goes."""
        self.ends_soon("query", "mesh", "long.yaml", "--cells", "16", "--out", "mesh.ply", after=(1.0, 1.0), message=b"in the middle of a calculation", preload=ENDLESS_SYNC)
        self.assertFalse((SCRATCH / "mesh.ply").exists())

    def test_in_outputs_of_a_run(self):
        fine = ["--out", "some", "--set", "output.cell=0.004", "--progress", "none"]
        files = {path: path.stat().st_size for path in (SCRATCH / "some").rglob("*")}
        self.ends_soon("export", "some.yaml", *fine, "--mesh", "usd", after=(0.5, 0.5))
        self.ends_soon("export", "some.yaml", *fine, "--gltf", after=(0.5, 0.5))
        self.ends_soon("export", "some.yaml", *fine, "--grid", "vdb", after=(0.5, 0.5))
        self.assertFalse((SCRATCH / "some/some.usda").exists())
        self.assertFalse((SCRATCH / "some/some.glb").exists())
        self.ends_soon("render", "some.yaml", *fine, "--set", "render.renderer=path", "--set", "render.noise=0.001", after=(0.5, 0.5))
        self.ends_soon("run", "long.yaml", "--dry-run", "--set", "render.renderer=path", after=(0.5, 0.5))
        for path, size in files.items():
            if path.suffix == ".state":
                self.assertEqual(path.stat().st_size, size)

    def test_in_a_view(self):
        self.ends_soon("view", "some", "--cells", "512", "--size", "900M", after=(0.5, 0.5))
        self.assertFalse((SCRATCH / "some/some_view.html").exists())
        self.ends_soon("run", "long.yaml", "--out", "viewed", "--overwrite", "--view", after=(0.5, 0.5))
        # A signal is the way to end it.
        self.ends_soon("view", "some", "--serve", after=(1.0, 1.0), by_clock=True, ends=lambda _: 0, message=b"")

    def test_in_a_sweep(self):
        self.ends_soon("sweep", "long.yaml", "--set", "objects.ball.particles.mass=1:2:8", "--out", "swept", "--overwrite", "--jobs", "2", after=(1.0, 1.0), by_clock=True)
        self.assertFalse((SCRATCH / "swept/table.csv").exists())
        for report in (SCRATCH / "swept").rglob("result.json"):
            self.assertEqual(json.loads(report.read_text())["outcome"], "interrupted")

    @unittest.skipUnless((SUPPLE.parent / "supple_fit").exists(), "built without the program of fits")
    def test_in_a_fit(self):
        (SCRATCH / "ball.obj").write_text(bumpy_ball(150))
        # Where its program is still being loaded the signal itself ends it.
        self.ends_soon("fit", "ball.obj", "-o", "fitted.yaml", "--particles", "3000", "--error", "0.2%", after=(0.8, 1.5))
        self.assertEqual(list(SCRATCH.glob("fitted.*")), [])

    @unittest.skipUnless((SUPPLE.parent / "supple_bench").exists(), "built without the program of benchmarks")
    def test_in_a_benchmark(self):
        self.ends_soon("bench", "collision/pile", "3000", after=(0.5, 0.5), ends=lambda number: -number, message=b"")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
