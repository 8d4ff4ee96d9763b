#!/usr/bin/env python3
"""Several processes that draw frames of one run: the same bytes as of one process, one film, one look.

usage: shards_test.py SUPPLE SCRATCH
"""
import hashlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time
import unittest

SUPPLE, SCRATCH = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
FRAMES = 24
SCENE = """schema: 1
duration: 2.3 s
frame_rate: 10
objects:
  - name: ball
    particles: {arrange: single, at: [-1, 0, 0], velocity: [0.5, 0, 0], mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
camera: {from: [0, -3, 1], look_at: [0, 0, 0]}
output: {images: {size: [48, 36], samples: 1}, film: true}
"""
REPORTS = {"result.json", "render.json", ".lock"}  # hold times, and who draws
LOOK = ["--set", "output.images.size=[64, 48]"]


def contents(folder):
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name not in REPORTS:
            found[str(path.relative_to(folder))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


class Shards(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(SCRATCH, ignore_errors=True)
        SCRATCH.mkdir(parents=True)
        cls.scene = SCRATCH / "ball.yaml"
        cls.scene.write_text(SCENE)
        # A film program that counts its calls.
        cls.films = SCRATCH / "films"
        program = SCRATCH / "film program"
        program.write_text(f'#!/bin/sh\necho "$$" >> "{cls.films}"\nexec ffmpeg "$@"\n')
        program.chmod(0o755)
        cls.environment = {**os.environ, "SUPPLE_FFMPEG": str(program)}
        cls.simulated = SCRATCH / "simulated"
        cls.call_of(cls, "run", cls.simulated, "--no-pictures")
        cls.alone = SCRATCH / "alone"
        shutil.copytree(cls.simulated, cls.alone)
        cls.call_of(cls, "render", cls.alone)
        cls.reference = contents(cls.alone)
        assert {"ball.mp4", "ball_sheet.png", f"frames/ball.{FRAMES:04d}.png"} <= set(cls.reference), cls.reference

    def setUp(self):
        self.out = SCRATCH / self.id().split(".")[-1]
        shutil.copytree(self.simulated, self.out)
        self.films.unlink(missing_ok=True)
        self.processes = []

    def tearDown(self):
        for process in self.processes:
            process.kill()
            process.communicate()

    def start(self, verb, out, *options):
        command = [SUPPLE, verb, self.scene, "--out", out, "--progress", "none", "--threads", "1", *options]
        process = subprocess.Popen([str(word) for word in command], env=self.environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        if hasattr(self, "processes"):
            self.processes.append(process)
        return process

    def call_of(self, verb, out, *options):
        process = Shards.start(self, verb, out, *options)
        text, errors = process.communicate(timeout=120)
        assert process.returncode == 0, errors
        return text

    def draw(self, *ranges):
        return [self.start("render", self.out, "--frames", frames) for frames in ranges]

    def ends(self, processes, alone=False):
        """What the processes print; each must succeed without a warning. `alone`: one may end before another has begun, and says what it leaves out."""
        texts = [process.communicate(timeout=120) for process in processes]
        for process, (_, errors) in zip(processes, texts):
            self.assertEqual(process.returncode, 0, errors)
            if not (alone and errors.startswith("warning: no film: frames ")):
                self.assertEqual(errors, "")
        return [text[0] for text in texts]

    def stopped(self, *options, verb="render", waits_for="frames/ball.*.png"):
        """A process that stands still after its first file, holding what it holds."""
        process = self.start(verb, self.out, *options)
        while not list(self.out.glob(waits_for)):
            self.assertIsNone(process.poll(), process.stderr.read() if process.poll() is not None else "")
            time.sleep(0.002)
        process.send_signal(signal.SIGSTOP)
        return process

    def refused(self, verb, words, *options):
        process = self.start(verb, self.out, *options)
        errors = process.communicate(timeout=60)[1]
        self.assertEqual(process.returncode, 4, errors)
        self.assertIn(words, errors)

    def expect_whole(self, films=1):
        self.assertEqual(contents(self.out), self.reference)
        self.assertEqual(len(self.films.read_text().split()) if self.films.exists() else 0, films)

    def test_any_number_of_processes_makes_the_bytes_of_one(self):
        for count in (2, 3, 4):
            with self.subTest(count=count):
                shutil.rmtree(self.out)
                shutil.copytree(self.simulated, self.out)
                self.films.unlink(missing_ok=True)
                size = FRAMES // count
                texts = self.ends(self.draw(*(f"{1 + k * size}-{(k + 1) * size}" for k in range(count))), alone=True)
                self.assertGreaterEqual(sum("film:" in text and "left" not in text for text in texts), 1)
                self.expect_whole()

    def test_ranges_may_overlap(self):
        self.ends(self.draw("1-16", "8-24", "1-24:3"), alone=True)
        self.expect_whole()

    def test_the_last_process_makes_the_film(self):
        first = self.stopped("--frames", "1-12")
        text, = self.ends(self.draw("13-24"))
        self.assertIn("left to the other processes", text)
        self.assertFalse((self.out / "ball.mp4").exists())
        self.assertFalse((self.out / "ball_sheet.png").exists())
        first.send_signal(signal.SIGCONT)
        self.assertIn("ball.mp4", self.ends([first])[0])
        self.expect_whole()

    def test_the_last_process_says_what_is_missing(self):
        first = self.stopped("--frames", "1-6")
        self.ends(self.draw("13-24"))
        first.send_signal(signal.SIGCONT)
        errors = first.communicate(timeout=60)[1]
        self.assertIn("no film: frames 7-12 of ball have no picture", errors)
        self.assertTrue((self.out / "ball_sheet.png").exists())
        self.assertIn("ball.mp4", self.ends(self.draw("7-12"))[0])
        self.expect_whole()

    def test_a_killed_process_stops_no_other(self):
        killed = self.stopped("--frames", "1-12")
        other = self.draw("13-18")[0]
        temporary = self.out / "frames" / ".ball.0005.png.1-2.0.tmp"
        temporary.write_text("half")
        killed.kill()
        killed.wait()
        other.communicate(timeout=60)
        self.ends(self.draw("19-24", "1-12"))
        self.expect_whole()
        self.assertFalse(temporary.exists())

    def test_a_killed_maker_of_the_film_is_replaced(self):
        self.ends([self.start("render", self.out, "--set", "output.film=false")])
        stalls = SCRATCH / "stalls"
        stalls.write_text("#!/bin/sh\nsleep 100\n")
        stalls.chmod(0o755)
        whole, Shards.environment = Shards.environment, {**os.environ, "SUPPLE_FFMPEG": str(stalls)}
        try:
            maker = self.start("render", self.out)
            while not list(self.out.glob(".ball.mp4.*.tmp")):
                time.sleep(0.002)
        finally:
            Shards.environment = whole
        waits = self.start("render", self.out)
        time.sleep(0.3)
        self.assertIsNone(waits.poll())  # the film is in the making
        maker.kill()
        maker.wait()
        self.ends([waits])
        self.expect_whole()

    def test_another_look_is_refused_by_its_keys(self):
        first = self.stopped("--frames", "1-12")
        self.refused("render", "expected the look in which other processes draw here, with output.images.size=[48, 36] (here [64, 48])", "--frames", "13-24", *LOOK)
        self.refused("render", "--set 'output.images.size=[48, 36]'", "--frames", "13-24", *LOOK)
        self.refused("render", "--context auto, found osmesa", "--frames", "13-24", "--context", "osmesa")
        first.send_signal(signal.SIGCONT)
        first.communicate(timeout=60)
        self.ends(self.draw("13-24"))
        self.expect_whole()

    def test_runs_and_exports_are_alone(self):
        first = self.stopped("--frames", "1-12")
        for verb, options in (("run", ["--overwrite"]), ("run", ["--resume"]), ("export", ["--particles", "csv"])):
            self.refused(verb, "expected an output folder that no other run uses", *options)
        first.kill()
        first.wait()
        shutil.rmtree(self.out)
        run = self.stopped(verb="run", waits_for="states/ball.0003.state")
        self.refused("render", "expected an output folder that no other run uses")
        run.send_signal(signal.SIGCONT)
        self.ends([run])
        self.expect_whole()

    def test_frames_of_another_look_make_no_film_of_two(self):
        self.ends([self.start("render", self.out)])
        self.films.unlink()
        errors = self.start("render", self.out, "--frames", "1-6", *LOOK).communicate(timeout=60)[1]
        self.assertIn("frames 1-6 of ball have another size than the others; an earlier ball.mp4 of other pictures is removed", errors)
        self.assertFalse((self.out / "ball.mp4").exists())
        self.assertFalse(self.films.exists())
        self.ends([self.start("render", self.out, "--frames", frames, *LOOK) for frames in ("7-15", "16-24")])
        self.assertEqual(len(self.films.read_text().split()), 1)
        self.ends(self.draw("1-24"))
        self.expect_whole(films=2)

    def test_all_there_draws_nothing(self):
        self.ends([self.start("render", self.out)])
        before = {path: path.stat().st_mtime_ns for path in self.out.rglob("*") if path.is_file() and path.name not in REPORTS}
        self.ends(self.draw("1-12", "13-24"))
        self.assertEqual(before, {path: path.stat().st_mtime_ns for path in self.out.rglob("*") if path.is_file() and path.name not in REPORTS})
        self.assertEqual(json.loads((self.out / "render.json").read_text())["pictures"]["drawn"], 0)
        self.expect_whole()


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
