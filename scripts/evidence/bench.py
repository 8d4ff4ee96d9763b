"""Programs that a part runs, with its budget of time, and what it collects for the page."""
import itertools
import json
import os
import pathlib
import platform
import shutil
import signal
import subprocess
import time


class Failed(Exception):
    """A program that ended with a fault or did not end in time; the text is one line."""


class Bench:
    def __init__(self, supple, peers, work, root, quick):
        self.supple, self.peers, self.work, self.root, self.quick = supple, peers, work, root, quick
        self.faults, self.losses, self.plots, self.commands = {}, [], [], []
        self.part, self.end = "", 0.0
        self.numbers = itertools.count(1)
        self.scenes = {}  # rows by scene, once they are measured
        self.load = os.getloadavg()[0]
        self.date, self.program = time.strftime("%Y-%m-%d"), self.revision()
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir(parents=True)

    def begin(self, part, budget_s):
        self.part, self.end, self.commands = part, time.monotonic() + budget_s, []
        self.faults[part] = []

    def fault(self, text):
        self.faults[self.part].append(" ".join(text.split())[:300])

    def loss(self, text):
        self.losses.append(text)

    def call(self, words, shown=None, budget_s=None):
        """Standard output of a program. @raise Failed: it ends with a code, or not within the time of the part or its own"""
        words = [str(word) for word in words]
        shown = shown or " ".join(["supple", *words[1:]] if words[0] == str(self.supple) else words)
        shown = shown.replace(f"{self.work}/", "").replace(f"{self.root}/", "")
        self.commands.append(shown)
        left = min(self.end - time.monotonic(), budget_s or float("inf"))
        if left <= 0.0:
            raise Failed(f"no time was left for {shown}")
        errors = self.work / f"{self.part}.{next(self.numbers)}.err"
        with open(errors, "wb") as err:
            process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=err, text=True, start_new_session=True, cwd=self.work)
        try:
            out, _ = process.communicate(timeout=left)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            raise Failed(f"{shown} was ended after {left:.0f} s") from None
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            raise
        if process.returncode:
            raise Failed(f"{shown} ended with {process.returncode}: {errors.read_text(errors='replace')[-200:]}")
        return out

    def bench(self, group, *words, budget_s=None):
        return self.call([self.supple, "bench", group, *words], budget_s=budget_s)

    def rows(self, group, *words, budget_s=None):
        """Rows of JSON that a group of benchmarks prints."""
        return [json.loads(line) for line in self.bench(group, *words, budget_s=budget_s).splitlines() if line.startswith("{")]

    def plot_path(self, name):
        """Where a program draws a plot, and what it is called in the page."""
        path = self.work / f"evidence_{name}.svg"
        self.plots.append(path)
        return path

    def draw(self, name, svg):
        self.plot_path(name).write_text(svg, encoding="utf-8")

    @staticmethod
    def image(name, words):
        return f"![{words}](images/evidence_{name}.svg)"

    def command_lines(self):
        """The commands of the part so far as a block."""
        return [f"    {command}" for command in dict.fromkeys(self.commands)] + [""]

    def revision(self):
        words = ["git", "-C", str(self.root), "describe", "--always", "--dirty"]
        try:
            told = subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip()
        except OSError:
            told = ""
        version = subprocess.run([str(self.supple), "--version"], capture_output=True, text=True, check=False).stdout.strip()
        return f"{version}, revision {told}" if told else version

    def machine_lines(self):
        names = [line.split(":", 1)[1].strip() for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
        count = len(os.sched_getaffinity(0))
        busy = self.load > 0.5
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
        return [f"| | |", "|---|---|",
                f"| machine | {names[0] if names else platform.processor()}, {count} processors used, {memory:.0f} GiB, Linux {platform.release()} |",
                f"| load before the first part | {self.load:.1f}{': the machine had other work, so times are upper bounds' if busy else ''} |",
                f"| program | supple {self.program} |",
                f"| date | {self.date} |", "",
                "Times are CPU times of one thread unless a line says otherwise. Commands are those of an installed tool; in a source tree `supple` is `build/release/bin/supple`."]
