"""Runs that are killed, interrupted, raced, resumed and continued from altered states."""
import concurrent.futures
import shutil
import signal
import subprocess
import time

from support import Outcome, SmallRun, broken_files, contents, fault_of_exit, orphans, run_process, temporaries

IMAGES = "output.images.size=[48,36]"
# Contact, a film and tables; a cradle; links that break; a spiral hit by three balls; bodies that sleep. About a second each.
KILLED = [
    ("contacts/two_balls", ["duration=0.7", IMAGES, "output.mesh=[ply,usd]", "output.particles=vtk"]),
    ("contacts/newtons_cradle", ["duration=0.3", IMAGES]),
    ("objects/plate_breaks", ["duration=0.3", IMAGES]),
    ("contacts/spiral_three_balls", ["duration=0.4", IMAGES, "output.grid=vdb"]),
    ("contacts/pile_rests", ["duration=0.2", IMAGES]),
]
RESUMED = KILLED + [("contacts/ball_on_mesh", ["duration=0.3", IMAGES])]


def small_runs(context, row, scenes):
    base = context.folder(row)
    return [SmallRun(context, name, overrides, base / ("reference_" + name.split("/")[-1])) for name, overrides in scenes]


def start(command):
    return subprocess.Popen([str(word) for word in command], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                            start_new_session=True)


def killed(context, run, number, times, pick):
    """A run that is killed so often, each time at a random moment, and resumed. @return faults"""
    out = context.scratch / "kill" / f"out_{number}"
    where, faults = f"{run.name}, turn {number}", []
    for again in range(times):
        process = start(run.command(out, *(["--resume"] if again else []), threads=pick.choice([1, 3])))
        moment = pick.uniform(0.0, 1.1 * run.seconds)
        time.sleep(moment)
        process.kill()  # that process alone: what it started must end by itself
        process.wait()
        process.stderr.close()
        if out.exists():
            faults += [f"{where}, killed after {moment:.3f} s: {fault}" for fault in broken_files(out, run.files)]
    fault = fault_of_exit(run_process(run.command(out, "--resume")), {0})
    faults += [f"{where}, resumed: {text}" for text in ([fault] if fault else run.difference(out))]
    faults += [f"{where}: still running: {text}" for text in orphans(out)]
    shutil.rmtree(out, ignore_errors=True)
    return faults


def kill(context, asked):
    """Runs killed once or several times, and resumed; some at the same time."""
    outcome = Outcome()
    runs = small_runs(context, "kill", KILLED)
    turns = []
    while outcome.reached < asked:
        pick = context.random(f"kill {len(turns)}")
        turns.append((context, runs[len(turns) % len(runs)], len(turns), pick.choice([1, 1, 2, 3]), pick))
        outcome.reached += turns[-1][3]
    with concurrent.futures.ThreadPoolExecutor(context.jobs) as pool:
        for faults in pool.map(lambda turn: killed(*turn), turns):
            outcome.faults += faults
    outcome.note = f"{len(turns)} runs of {len(runs)} scenes"
    return outcome


def signals(context, asked):
    """SIGINT and SIGTERM at a random moment: 130 or 143, a report, and a run that can be resumed."""
    outcome, pick = Outcome(), context.random("signals")
    runs = small_runs(context, "signals", KILLED)
    finished = 0
    while outcome.reached < asked:
        run = runs[outcome.reached % len(runs)]
        number, code = ((signal.SIGINT, 130), (signal.SIGTERM, 143))[outcome.reached % 2]
        out = context.scratch / "signals" / f"out_{outcome.reached}"
        where = f"{run.name}, signal {int(number)}, number {outcome.reached}"
        process = start(run.command(out, threads=pick.choice([1, 3])))
        time.sleep(pick.uniform(0.0, 0.9 * run.seconds))
        process.send_signal(number)
        message = process.communicate(timeout=120)[1].decode("utf-8", "replace")
        outcome.reached += 1
        if process.returncode == 0:
            finished += 1  # the signal came too late
        elif process.returncode != code and not (process.returncode == -number and not contents(out)):
            outcome.faults.append(f"{where}: exit {process.returncode}: {message[:200]}")
        if out.exists():
            outcome.faults += [f"{where}: {fault}" for fault in broken_files(out, run.files)]
            outcome.faults += [f"{where}: a temporary file is left: {name}" for name in temporaries(out) if process.returncode > 0]
        ended = run_process(run.command(out, "--resume")) if process.returncode != 0 else None
        fault = fault_of_exit(ended, {0}) if ended else ""
        outcome.faults += [f"{where}, resumed: {text}" for text in ([fault] if fault else run.difference(out))]
        outcome.faults += [f"{where}: still running: {text}" for text in orphans(out)]
        shutil.rmtree(out, ignore_errors=True)
    outcome.note = f"{finished} ended before the signal came" if finished else ""
    return outcome


def races(context, asked):
    """Two runs in one folder at the same time: one does it, the other one says why not."""
    outcome, pick = Outcome(), context.random("races")
    runs = small_runs(context, "races", KILLED[:2])
    while outcome.reached < asked:
        run = runs[outcome.reached % len(runs)]
        out = context.scratch / "races" / f"out_{outcome.reached}"
        both = [start(run.command(out))]
        time.sleep(pick.choice([0.0, 0.0, 0.01, 0.1]))
        both.append(start(run.command(out)))
        messages = [process.communicate(timeout=300)[1].decode("utf-8", "replace") for process in both]
        codes = sorted(process.returncode for process in both)
        outcome.reached += 1
        if codes != [0, 4]:
            outcome.faults.append(f"{run.name}, race {outcome.reached}: exits {codes}: {messages}")
        elif not any("no other run uses" in text or "earlier result" in text for text in messages):
            outcome.faults.append(f"{run.name}, race {outcome.reached}: the second run does not say why: {messages}")
        outcome.faults += [f"{run.name}, race {outcome.reached}: {text}" for text in run.difference(out)]
        shutil.rmtree(out, ignore_errors=True)
    return outcome


def without_pictures(run, out):
    """A copy of an undisturbed run without what it drew. @return its folder"""
    shutil.copytree(run.reference, out)
    shutil.rmtree(out / "frames")
    for made in [*out.glob("*.mp4"), *out.glob("*_sheet.png")]:
        made.unlink()
    return out


def shards(context, asked):
    """Processes that draw frames of one run at the same time, in ranges that overlap; some are killed, and one more draws what is missing."""
    outcome, pick = Outcome(), context.random("shards")
    runs = small_runs(context, "shards", KILLED[:2])
    drawing_s = []  # of one process that draws all frames
    for k, run in enumerate(runs):
        begin = time.monotonic()
        run_process(run.command(without_pictures(run, context.scratch / "shards" / f"timed_{k}"), verb="render"))
        drawing_s.append(time.monotonic() - begin)
    for turn in range(4 * asked):
        if outcome.reached >= asked:
            break
        run = runs[turn % len(runs)]
        out = without_pictures(run, context.scratch / "shards" / f"out_{turn}")
        count = pick.choice([2, 3, 4])
        size = run.frames // count + 1
        ranges = [f"{max(1, k * size - pick.choice([0, 2]))}-{(k + 1) * size}" for k in range(count)]
        processes = [start(run.command(out, "--frames", frames, verb="render")) for frames in ranges]
        time.sleep(pick.uniform(0.0, 0.7 * drawing_s[turn % len(runs)]))
        for process in processes[: pick.choice([1, count - 1])]:
            process.kill()
        where = f"{run.name}, shards {turn}"
        for process in processes:
            message = process.communicate(timeout=300)[1].decode("utf-8", "replace")
            outcome.reached += process.returncode == -signal.SIGKILL
            if process.returncode not in (0, -signal.SIGKILL):
                outcome.faults.append(f"{where}: exit {process.returncode}: {message[:200]}")
        # The sheet may be of the frames that are there.
        outcome.faults += [f"{where}: {fault}" for fault in broken_files(out, run.files) if "_sheet.png" not in fault]
        fault = fault_of_exit(run_process(run.command(out, verb="render")), {0})
        outcome.faults += [f"{where}, drawn again: {text}" for text in ([fault] if fault else run.difference(out))]
        outcome.faults += [f"{where}: still running: {text}" for text in orphans(out)]
        shutil.rmtree(out, ignore_errors=True)
    return outcome


def resume(context, asked):
    """Continued from every frame in a fresh process, and once more from that."""
    outcome = Outcome()
    runs = small_runs(context, "resume", RESUMED)
    turns = [(run, frame) for frame in range(1, max(run.frames for run in runs)) for run in runs if frame < run.frames]
    for run, frame in turns[:asked]:
        out = context.folder("resume/out")
        (out / "states").mkdir()
        for number in range(1, frame + 1):
            shutil.copy(run.reference / "states" / f"{run.name}.{number:04d}.state", out / "states")
        for turn in ("resumed", "resumed twice"):
            fault = fault_of_exit(run_process(run.command(out, "--resume", "--simulate-only")), {0})
            faults = [fault] if fault else run.difference(out, files=False) + broken_files(out / "states", {name[7:]: value for name, value in run.files.items() if name.startswith("states/")})
            outcome.faults += [f"{run.name}, {turn} from frame {frame}: {text}" for text in faults]
            (out / "states" / f"{run.name}.{run.frames:04d}.state").unlink(missing_ok=True)
        outcome.reached += 1
    outcome.note = f"all frames of {len(runs)} scenes are {len(turns)}"
    return outcome


def threads(context, asked):
    """The state and every file by 1, 2, 3, 4, 8 and 16 threads."""
    outcome = Outcome()
    scenes = RESUMED + [("objects/hand_closes", ["duration=0.2", IMAGES]), ("contacts/worm_curls_up", ["duration=0.2", IMAGES])]
    for name, overrides in scenes[:max(1, asked // 6)]:
        base = context.folder("threads")
        run = SmallRun(context, name, overrides, base / "reference")
        outcome.reached += 1
        for count in (2, 3, 4, 8, 16):
            fault = fault_of_exit(run_process(run.command(base / str(count), threads=count)), {0})
            outcome.faults += [f"{name}, {count} threads: {text}" for text in ([fault] if fault else run.difference(base / str(count)))]
            outcome.reached += 1
    return outcome


def altered(data, others, pick):
    """Bytes of a state changed somehow; never the same."""
    kind = pick.randrange(6)
    at = pick.randrange(len(data))
    if kind == 0:
        return data[:at] + bytes([data[at] ^ (1 << pick.randrange(8))]) + data[at + 1:]
    if kind == 1:
        return data[:at]
    if kind == 2:
        return data + bytes(pick.randrange(1, 64))
    if kind == 3:
        return data[:at] + bytes([(data[at] + pick.randrange(1, 256)) % 256]) + data[at + 1:]
    if kind == 4:
        return b""
    return pick.choice([other for other in others if other != data])


def states(context, asked):
    """One state of a finished run altered, or put in the place of another; then the tool is told to use it."""
    outcome, pick = Outcome(), context.random("states")
    runs = small_runs(context, "states", [KILLED[0], KILLED[2]])
    every = [path.read_bytes() for run in runs for path in sorted((run.reference / "states").iterdir())]
    verbs = {"resume": ["--resume"], "render": ["--overwrite"], "export": ["--particles", "vtk", "--contacts", "csv"]}
    while outcome.reached < asked:
        run = runs[outcome.reached % len(runs)]
        verb = pick.choice(list(verbs))
        out = context.scratch / "states" / "out"
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(run.reference, out)
        paths = sorted((out / "states").iterdir())
        path = paths[-1] if verb == "resume" else pick.choice(paths)
        path.write_bytes(altered(path.read_bytes(), every, pick))
        ended = run_process(run.command(out, *verbs[verb], verb="run" if verb == "resume" else verb))
        outcome.reached += 1
        where = f"{run.name}, {verb}, altered state {outcome.reached} ({path.name})"
        fault = fault_of_exit(ended, {0, 7})
        if not fault and ended.code == 0:
            # What is damaged may be simulated again; then the folder is that of an undisturbed run.
            fault = "; ".join(run.difference(out)) if verb == "resume" else "exit 0 though the state is not what was saved"
        elif not fault and path.name not in ended.err:
            fault = f"the message does not name the file: {ended.err[:200]}"
        # Tables of the export are new; whatever the run had left is as it was.
        changed = [name for name, value in contents(out).items() if name in run.files and not name.startswith("states/") and run.files[name] != value]
        outcome.faults += [f"{where}: {name} is another one" for name in changed]
        outcome.faults += [f"{where}: {text}" for text in [fault] if text]
        outcome.faults += [f"{where}: a temporary file is left: {name}" for name in temporaries(out)]
    return outcome


def grids(context, asked):
    """OpenVDB files altered or cut off. No command reads them: they are exported again from the saved states, whole."""
    outcome, pick = Outcome(), context.random("grids")
    run = small_runs(context, "grids", [("contacts/two_balls", ["duration=0.2", "output.images=false", "output.film=false", "output.grid=vdb"])])[0]
    out = context.scratch / "grids" / "out"
    shutil.copytree(run.reference, out)
    names = [name for name in run.files if name.endswith(".vdb")]
    while outcome.reached < asked:
        for name in names:
            data = (run.reference / name).read_bytes()
            (out / name).write_bytes(altered(data, [b"no grid"], pick))
            outcome.reached += 1
        fault = fault_of_exit(run_process(run.command(out, "--grid", "vdb", verb="export")), {0})
        outcome.faults += [f"{outcome.reached}: {text}" for text in ([fault] if fault else broken_files(out, run.files))]
    return outcome
