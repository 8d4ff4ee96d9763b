#!/usr/bin/env python3
"""Job files of `supple job` run by their engines on this machine: every file is that of one process, a killed task or node loses nothing, nothing is
left running. Prints figures of overhead.

usage: jobs.py SUPPLE SCRATCH [--frames N] [ROW ...]     rows: overhead openjd slurm ray sweep (all where none is named)
openjd-cli and ray are found beside the Python that runs this; Slurm on the search path. A row without its engine fails.
"""
import argparse
import contextlib
import hashlib
import os
import pathlib
import re
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
SCENE = """schema: 1
duration: {duration} s
frame_rate: 100
gravity: [0, 0, -9.81]
ground: {{height: 0}}
objects:
  - name: ball
    particles: {{arrange: single, at: [-0.5, 0, 1], velocity: [0.1, 0, 0], mass: 1}}
    skeleton: [{{shape: point, kernel: {{type: wyvill, radius: 0.5}}}}]
    contact: {{modulus: 1e4}}
camera: {{from: [0, -3, 1], look_at: [0, 0, 0.4]}}
output: {{images: {{size: [64, 48], samples: 1}}, film: true}}
"""
REWRITTEN = re.compile(r"^table\.csv$|\.lock$|^logs/")  # by a second call of a sweep
REPORTS = re.compile(r"^(result|render)\.json$|^\.lock$|^logs/")


RAY_MEMORY = 100 * 2**20  # [bytes] of the object store of a node


class Failed(Exception):
    pass


def contents(folder):
    """Hash of every file that must not depend on who wrote it."""
    names = {str(path.relative_to(folder)): path for path in sorted(folder.rglob("*")) if path.is_file()}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in names.items() if not REPORTS.match(name)}


def running(text):
    """Processes whose command line holds a text, this one and its parents excepted."""
    found = []
    for folder in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode("utf-8", "replace")
        except OSError:
            continue
        if text in words and int(folder.name) not in (os.getpid(), os.getppid()):
            found.append((int(folder.name), words.strip()))
    return found


class Jobs:
    def __init__(self, supple, scratch, frames):
        self.supple, self.frames = supple, frames
        self.scratch = scratch / "names with spaces"  # of scenes, folders and job files
        shutil.rmtree(scratch, ignore_errors=True)
        self.scratch.mkdir(parents=True)
        self.scene = self.scratch / "a ball's bounces.yaml"
        self.scene.write_text(SCENE.format(duration=(frames - 1) / 100))
        self.alone = self.scratch / "alone"
        begin = time.monotonic()
        self.call("run", self.scene, "--out", self.alone, "--threads", "1", "--progress", "none", "--quiet")
        self.serial_s = time.monotonic() - begin
        self.expected = contents(self.alone)
        print(f"one process: {frames} frames in {self.serial_s:.1f} s", flush=True)

    def call(self, *words, program=None, environment=None, timeout=3600):
        command = [str(word) for word in (program or self.supple, *words)]
        ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout, env=environment)
        if ended.returncode:
            raise Failed(f"{command}: exit {ended.returncode}: {ended.stdout[-2000:]} {ended.stderr[-2000:]}")
        return ended.stdout

    def job(self, engine, chunk):
        out, file = self.scratch / f"{engine} run", self.scratch / f"{engine} job"
        if engine == "openjd":
            file = file.with_suffix(".json")
        self.call("job", self.scene, "--format", engine, "--out", file, "--folder", out, "--chunk", chunk, "--threads", 1, "--program", self.supple)
        return out, file

    def compare(self, out):
        found = contents(out)
        for name in sorted(set(found) | set(self.expected)):
            if found.get(name) != self.expected.get(name):
                raise Failed(f"{out}: {name} is not that of one process")
        left = running(str(out))
        if left:
            raise Failed(f"still running: {left}")

    def times_again(self, out, call, reports=REPORTS):
        """Seconds of a second call, which must change nothing but reports."""
        def written():
            return {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file() and not reports.match(str(path.relative_to(out)))}

        before, begin = written(), time.monotonic()
        call()
        if written() != before:
            raise Failed(f"{out}: a second call wrote files")
        return time.monotonic() - begin

    def overhead(self):
        """CPU time of a task besides simulating and drawing, which others that use the machine change little."""
        def milliseconds(*words):
            def spent():
                usage = resource.getrusage(resource.RUSAGE_CHILDREN)
                return usage.ru_utime + usage.ru_stime

            times = []
            for _ in range(9):
                begin = spent()
                self.call(*words)
                times.append(1e3 * (spent() - begin))
            return statistics.median(times)

        common = [self.scene, "--out", self.alone, "--threads", 1, "--progress", "none", "--quiet"]
        start = milliseconds("--version")
        kept = milliseconds("render", *common, "--frames", "1-1")
        drawn = {count: milliseconds("render", *common, "--frames", f"1-{count}", "--overwrite") for count in (1, 11, 21)}
        frame = (drawn[21] - drawn[1]) / 20
        print(f"overhead, CPU time: start of the tool {start:.0f} ms; a task whose frames are there {kept:.0f} ms; a task of 1 frame {drawn[1]:.0f} ms, of 11 {drawn[11]:.0f} ms,"
              f" of 21 {drawn[21]:.0f} ms: {frame:.1f} ms a frame and {drawn[1] - frame:.0f} ms a task, {(drawn[1] - frame) / 600:.2f} % of a task of a minute")

    def openjd(self):
        out, file = self.job("openjd", max(1, self.frames // 20))
        tool = pathlib.Path(sys.executable).parent / "openjd"
        self.call("check", file, program=tool)
        begin = time.monotonic()
        self.call("run", file, program=tool)
        seconds = time.monotonic() - begin
        self.compare(out)
        again = self.times_again(out, lambda: self.call("run", file, program=tool))
        print(f"openjd: 22 tasks in {seconds:.1f} s, {seconds / self.serial_s:.2f} of one process; again, with all there, {again:.1f} s, {again / 36:.2f} % of an hour")

    def slurm(self):
        out, file = self.job("slurm", max(1, self.frames // 20))
        with self.slurm_host() as environment:
            def submit(meanwhile=lambda: None):
                self.submit_to_slurm(file, environment, meanwhile)

            killed = []

            def kill_one():
                drawing = [pid for pid, words in running(str(out)) if words.startswith(f"{self.supple} render")]
                if not killed and drawing and len(list((out / "frames").glob("*.png"))) > self.frames // 3:
                    os.kill(drawing[0], signal.SIGKILL)
                    killed.append(drawing[0])

            begin = time.monotonic()
            submit(kill_one)
            if (out / f"{self.scene.stem}.mp4").exists() or not killed:
                raise Failed("slurm: no task was killed before the film")
            submit()
            seconds = time.monotonic() - begin
            self.compare(out)
            again = self.times_again(out, submit)
            print(f"slurm: 22 tasks in {seconds:.1f} s, one killed and the job submitted again, {seconds / self.serial_s:.2f} of one process; again, with all there, {again:.1f} s,"
                  f" {again / 36:.2f} % of an hour")

    @contextlib.contextmanager
    def slurm_host(self):
        """Environment of the commands of a Slurm of this machine alone."""
        host = subprocess.Popen([HERE / "slurm_host.sh", str(self.scratch.parent / "slurm"), "2"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        try:
            variable = host.stdout.readline().strip()
            if not variable:
                raise Failed("slurm: it does not start")
            yield {**os.environ, **dict([variable.split("=", 1)])}
        finally:
            host.stdin.close()
            host.wait()

    def submit_to_slurm(self, file, environment, meanwhile=lambda: None):
        """Until nothing of it is in the queue."""
        self.call(file, program="bash", environment=environment)
        while self.call("--noheader", program="squeue", environment=environment).strip():
            meanwhile()
            time.sleep(0.05)

    @contextlib.contextmanager
    def ray_cluster(self):
        """A cluster of Ray of one node with one CPU."""
        import ray
        from ray.cluster_utils import Cluster
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False, "object_store_memory": RAY_MEMORY})
        try:
            yield cluster
        finally:
            ray.shutdown()
            cluster.shutdown()

    def ray(self):
        out, file = self.job("ray", max(1, self.frames // 50))
        driver = None
        with self.ray_cluster() as cluster:
            try:
                second = cluster.add_node(num_cpus=1, object_store_memory=RAY_MEMORY)
                begin = time.monotonic()
                driver = subprocess.Popen([sys.executable, str(file), "--address", cluster.address], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                drawn = 0
                while drawn < self.frames // 3:
                    if driver.poll() is not None:
                        raise Failed(f"ray: {driver.communicate()[1][-2000:]}")
                    time.sleep(0.02)
                    drawn = len(list((out / "frames").glob("*.png")))
                cluster.remove_node(second, allow_graceful=False)
                _, errors = driver.communicate(timeout=3600)
                if driver.returncode:
                    raise Failed(f"ray: exit {driver.returncode}: {errors[-2000:]}")
                seconds = time.monotonic() - begin
                self.compare(out)
                again = self.times_again(out, lambda: self.call(file, "--address", cluster.address, program=sys.executable))
                print(f"ray: two nodes, one killed after {drawn} of {self.frames} frames: 52 tasks in {seconds:.1f} s, {seconds / self.serial_s:.2f} of one process;"
                      f" again, with all there, {again:.1f} s, {again / 36:.2f} % of an hour")
            finally:
                if driver and driver.poll() is None:
                    driver.kill()
                    driver.communicate()

    def sweep(self):
        """A sweep of six points by each engine: rows and table of one process, nothing written by a second call, another plan refused."""
        def results(folder):
            return {path.relative_to(folder): path.read_bytes() for path in [folder / "table.csv", *folder.glob("*/row.json")]}

        def plan(folder, *more):
            self.call("sweep", self.scene, "--set", "duration=0.5", "--set", "objects.ball.contact.modulus=1e3:1e5:log3", "--set", "objects.ball.particles.mass=[1, 2]",
                      "--out", folder, "--progress", "none", "--quiet", *more)

        alone = self.scratch / "sweep alone"
        plan(alone)
        expected = results(alone)
        with self.slurm_host() as slurm, self.ray_cluster() as cluster:
            engines = {"openjd": lambda file: self.call("run", file, program=pathlib.Path(sys.executable).parent / "openjd"),
                       "slurm": lambda file: self.submit_to_slurm(file, slurm),
                       "ray": lambda file: self.call(file, "--address", cluster.address, program=sys.executable)}
            for engine, run in engines.items():
                folder, file = self.scratch / f"{engine} sweep", (self.scratch / f"{engine} sweep job").with_suffix(".json")
                plan(folder, "--plan-only")
                self.call("job", folder, "--format", engine, "--out", file, "--threads", 1, "--program", self.supple)
                begin = time.monotonic()
                run(file)
                seconds = time.monotonic() - begin
                if len(expected) != 7 or results(folder) != expected:
                    raise Failed(f"{folder}: rows and table are not those of one process")
                again = self.times_again(folder, lambda: run(file), REWRITTEN)
                left = running(str(folder))
                if left:
                    raise Failed(f"still running: {left}")
                print(f"sweep by {engine}: 6 points and a table in {seconds:.1f} s; again, with all there, {again:.1f} s", flush=True)
        other = subprocess.run([self.supple, "sweep", alone, "--point", "1", "--fingerprint", "0" * 16], capture_output=True, text=True)
        if other.returncode != 3 or "fingerprint" not in other.stderr:
            raise Failed(f"a plan of another fingerprint: exit {other.returncode}: {other.stderr}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("supple", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("scratch", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("rows", nargs="*", metavar="ROW")
    parser.add_argument("--frames", type=int, default=1000)
    arguments = parser.parse_intermixed_args()
    rows = arguments.rows or ["overhead", "openjd", "slurm", "ray", "sweep"]
    jobs, failures = Jobs(arguments.supple, arguments.scratch, arguments.frames), 0
    for row in rows:
        try:
            getattr(jobs, row)()
        except (Failed, ImportError, OSError) as fault:
            print(f"{row}: failed: {fault}")
            failures += 1
    sys.exit(failures)


if __name__ == "__main__":
    main()
