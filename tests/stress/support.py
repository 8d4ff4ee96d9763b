"""Common code of the rows of scripts/stress.sh: the tool as a process, comparison of folders, and the result of a row."""
import dataclasses
import hashlib
import json
import os
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import threading
import time

MB = 1 << 20
TIME_LIMIT_S = 600  # of a process that nothing else ends
SERVED_LIMIT_S = 60  # of small runs
MOST_FAULTS_TOLD = 20


@dataclasses.dataclass
class Outcome:
    """What a row did. `reached` counts what was tried, `faults` tells each thing that must not happen."""
    reached: int = 0
    faults: list = dataclasses.field(default_factory=list)
    note: str = ""
    planned: int = 0  # at full share, where the row itself finds that out


@dataclasses.dataclass
class Ended:
    """A process that ended. `code` is negative for a signal, None where it had to be killed for its time."""
    code: object
    out: str
    err: str
    processor_s: float
    most_bytes: int


class Context:
    """Paths, and the numbers of trials."""

    def __init__(self, sources, build, scratch, seed, share, jobs=1):
        self.sources = pathlib.Path(sources)
        self.build = pathlib.Path(build).resolve()
        self.bin = self.build / "bin"
        self.tool = os.environ.get("SUPPLE_STRESS_TOOL", str(self.bin / "supple"))
        self.scratch = pathlib.Path(scratch)
        self.seed = seed
        self.share = share
        self.jobs = jobs

    def folder(self, name):
        """A new, empty folder."""
        path = self.scratch / name
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir(parents=True)
        return path

    def random(self, name):
        return random.Random(f"{self.seed} {name}")

    def library(self, name):
        return str(self.sources / "scenes/library" / (name + ".yaml"))


def run_process(words, env=None, timeout=TIME_LIMIT_S, cwd=None, memory=None):
    """Runs a program to its end. `memory` bounds its address space [byte]."""
    def prepare():
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))

    process = subprocess.Popen([str(word) for word in words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=cwd,
                               env={**os.environ, **(env or {})}, preexec_fn=prepare, start_new_session=True)
    texts = {}

    def read(name, stream):
        texts[name] = stream.read().decode("utf-8", "replace")

    readers = [threading.Thread(target=read, args=pair) for pair in (("out", process.stdout), ("err", process.stderr))]
    for reader in readers:
        reader.start()
    late = threading.Event()

    def end():
        late.set()
        os.killpg(process.pid, signal.SIGKILL)

    timer = threading.Timer(timeout, end)
    timer.start()
    _, status, usage = os.wait4(process.pid, 0)
    timer.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    for reader in readers:
        reader.join()
    return Ended(None if late.is_set() else process.returncode, texts["out"], texts["err"], usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024)


class Served:
    """A program that starts and links once and is forked before its main for each run, by a preloaded library (served.h)."""

    def __init__(self, command, library, env, errors):
        self.errors = os.open(errors, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        requests, self.requests = os.pipe()
        answers, answer = os.pipe()
        self.answers = os.fdopen(answers)
        self.process = subprocess.Popen([str(word) for word in command], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=self.errors, start_new_session=True,
                                        env={**os.environ, **env, "LD_PRELOAD": str(library), "SUPPLE_SERVE": f"{requests} {answer}"}, pass_fds=(requests, answer),
                                        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CORE, (0, 0)))
        os.close(requests)
        os.close(answer)

    def run(self, number=0, word="none"):
        """One run. What the words mean is told by the library."""
        os.ftruncate(self.errors, 0)
        os.write(self.requests, f"{number} {word}\n".encode())
        child, late = int(self.answers.readline()), threading.Event()

        def end():
            late.set()
            os.kill(child, signal.SIGKILL)

        timer = threading.Timer(SERVED_LIMIT_S, end)
        timer.start()
        status = int(self.answers.readline())
        timer.cancel()
        err = os.pread(self.errors, os.fstat(self.errors).st_size, 0).decode("utf-8", "replace")
        return Ended(None if late.is_set() else os.waitstatus_to_exitcode(status), "", err, 0.0, 0)

    def close(self):
        os.close(self.requests)
        self.process.wait()
        self.answers.close()
        os.close(self.errors)


def fault_of_exit(ended, allowed):
    """What is wrong with the end of a process, or nothing: exit codes that are not allowed, crashes, and refusals without a message."""
    first = (ended.err.strip().splitlines() or [""])[0][:300]
    if ended.code is None:
        return "no end in time"
    if ended.code < 0:
        return f"crash by signal {-ended.code}: {first}"
    if ended.code not in allowed:
        return f"exit {ended.code}: {first}"
    if ended.code not in (0, 130, 143) and not first:
        return f"exit {ended.code} without a message"
    if "terminate called" in ended.err or "recondition" in ended.err:
        return f"exit {ended.code}: {first}"
    return ""


# Files that differ from run to run: times in reports, the random id of OpenVDB files.
REPORTS = re.compile(r"^(result|render|export)\.json$")


def digest(path):
    data = path.read_bytes()
    return str(len(data)) if path.suffix == ".vdb" else hashlib.sha256(data).hexdigest()


def contents(folder):
    """Hash of every finished file below a folder, by name."""
    found = {}
    folder = pathlib.Path(folder)
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        temporary = any(part.endswith(".tmp") for part in path.relative_to(folder).parts)
        if not path.is_file() or path.name == ".lock" or temporary or REPORTS.match(name):
            continue
        found[name] = digest(path)
    return found


def remains(folder):
    """What a resumed run finds: every file by name and contents, of reports the outcome."""
    left = []
    for path in sorted(pathlib.Path(folder).rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and REPORTS.match(name):
            try:
                left.append((name, json.loads(path.read_text()).get("outcome")))
            except ValueError:
                left.append((name, path.read_text()))
        else:
            left.append((name, digest(path) if path.is_file() else ""))
    return tuple(left)


def temporaries(folder):
    return [str(path.relative_to(folder)) for path in pathlib.Path(folder).rglob("*.tmp")]


def broken_files(folder, reference):
    """Files under their final names that are not those of an undisturbed run."""
    faults = [f"{name} is not that of an undisturbed run" for name, value in contents(folder).items() if reference.get(name) != value]
    for name in ("result.json", "render.json", "export.json"):
        path = pathlib.Path(folder) / name
        if path.exists():
            try:
                json.loads(path.read_text())
            except ValueError:
                faults.append(f"{name} is no JSON")
    return faults


def state_hash(folder, report="result.json"):
    try:
        return json.loads((pathlib.Path(folder) / report).read_text()).get("state_hash")
    except (OSError, ValueError):
        return None


def orphans(folder, patience_s=5.0):
    """Processes that still name a folder some seconds later."""
    mark = str(folder).encode()
    end = time.monotonic() + patience_s
    while True:
        left = []
        for path in pathlib.Path("/proc").glob("[0-9]*/cmdline"):
            try:
                words = path.read_bytes()
            except OSError:
                continue
            if mark in words and int(path.parent.name) != os.getpid():
                left.append(words.replace(b"\0", b" ").decode("utf-8", "replace")[:120])
        if not left or time.monotonic() > end:
            return left
        time.sleep(0.1)


class SmallRun:
    """A scene of the library made short and small, and what an undisturbed run of it leaves."""

    def __init__(self, context, name, overrides, folder):
        self.context = context
        self.scene = context.library(name)
        self.name = name.split("/")[-1]
        self.overrides = [word for override in overrides for word in ("--set", override)]
        self.reference = pathlib.Path(folder)
        begin = time.monotonic()
        ended = run_process(self.command(self.reference))
        self.seconds = time.monotonic() - begin
        if ended.code != 0:
            raise RuntimeError(f"the undisturbed run of {name} ended with {ended.code}: {ended.err}")
        self.files = contents(self.reference)
        self.hash = state_hash(self.reference)
        self.frames = json.loads((self.reference / "result.json").read_text())["frames"]

    def command(self, out, *more, verb="run", threads=1):
        return [self.context.tool, verb, self.scene, "--out", out, "--progress", "none", "--threads", threads, *self.overrides, *more]

    def difference(self, folder, files=True):
        """What a finished run left otherwise than the undisturbed one."""
        faults = [f"a temporary file is left: {name}" for name in temporaries(folder)]
        if state_hash(folder) != self.hash:
            faults.append(f"state {state_hash(folder)} instead of {self.hash}")
        if files:
            faults += broken_files(folder, self.files)
            faults += [f"{name} is missing" for name in self.files if not (pathlib.Path(folder) / name).exists()]
        return faults
