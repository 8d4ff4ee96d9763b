"""Input, output and memory that fail at the n-th call (io_failure.cpp, alloc_failure.cpp)."""
import shutil

from support import Outcome, SmallRun, broken_files, fault_of_exit, orphans, run_process, temporaries

TINY = ("contacts/two_balls", ["duration=0.05", "output.images.size=[32,24]", "output.images.samples=1", "output.film=false", "output.mesh=[ply,usd]",
                               "output.particles=vtk", "output.contacts=csv", "output.cell=0.05"])
# Without pictures: what a graphics driver does without memory is its own.
NO_PICTURES = (TINY[0], [word for word in TINY[1] if not word.startswith("output.images")] + ["output.images=false"])
# Pictures by the path tracer, which is ours, and grids by OpenVDB.
TRACED = (TINY[0], [word for word in TINY[1] if not word.startswith(("output.mesh", "output.particles", "output.contacts"))]
          + ["render.renderer=path", "render.most_samples=4", "output.grid=vdb"])
LONGER = [(scene, ["duration=0.1", *words[1:]]) for scene, words in (TINY, TRACED)]
# A film, pictures of two formats, and even samples.
FILMED = (TINY[0], ["duration=0.05", "output.images.size=[32,24]", "output.images.samples=1", "output.images.formats=[png,exr]", "output.samples=csv"])
KINDS = ("eio", "enospc", "short", "eintr")


def spread(total, asked):
    """Numbers from 1 to total: all, or so many of them, each the first of its stretch."""
    return sorted({1 + k * total // asked for k in range(asked)}) if asked < total else list(range(1, total + 1))


def judge(run, out, ended, where, same):
    """A failed run: its exit, what it leaves, and that it can be resumed. `same`: nothing may have come of it."""
    fault = fault_of_exit(ended, {0} if same else {0, 4, 6})
    faults = [fault] if fault else []
    if ended.code == 0:
        faults += run.difference(out)
    elif out.exists():
        faults += broken_files(out, run.files) + [f"a temporary file is left: {name}" for name in temporaries(out)]
    if ended.code != 0:
        resumed = run_process(run.command(out, "--resume"))
        fault = fault_of_exit(resumed, {0})
        faults += [f"resumed: {text}" for text in ([fault] if fault else run.difference(out))]
    return [f"{where}: {text}" for text in faults]


def failing_io(context, asked, kinds=KINDS, settings=(*LONGER, FILMED)):
    outcome = Outcome()
    library = str(context.build / "lib/libio_failure.so")
    runs, totals = [], []
    for k, words in enumerate(settings):
        base = context.folder(f"io_{k}")
        runs.append(SmallRun(context, *words, base / "reference"))
        out, count = base / "out", base / "calls"
        ended = run_process(runs[-1].command(out), {"LD_PRELOAD": library, "SUPPLE_FAIL_IO_UNDER": str(out), "SUPPLE_FAIL_IO_COUNT": str(count)})
        if ended.code != 0:
            raise RuntimeError(f"the run that counts calls ended with {ended.code}: {ended.err}")
        totals.append(int(count.read_text()))
    calls = [(run, number) for run, total in zip(runs, totals) for number in range(1, total + 1)]
    for place in spread(len(calls), max(1, asked // len(kinds))):
        run, number = calls[place - 1]
        out = run.reference.parent / "out"
        for kind in kinds:
            shutil.rmtree(out, ignore_errors=True)
            env = {"LD_PRELOAD": library, "SUPPLE_FAIL_IO_UNDER": str(out), "SUPPLE_FAIL_IO_KIND": kind, "SUPPLE_FAIL_IO_AT": str(number)}
            ended = run_process(run.command(out), env)
            outcome.faults += judge(run, out, ended, f"{out}, {kind} at call {number}", kind in ("short", "eintr"))
            outcome.reached += 1
    outcome.faults += [f"still running: {text}" for run in runs for text in orphans(run.reference.parent)]
    outcome.note = f"{len(runs)} runs make {' + '.join(map(str, totals))} calls; {len(kinds)} kinds of failure"
    return outcome


def failing_memory(context, asked):
    outcome = Outcome()
    library = str(context.build / "lib/liballoc_failure.so")
    totals = []
    for k, settings in enumerate((NO_PICTURES, TRACED)):
        base = context.folder(f"memory_{k}")
        run = SmallRun(context, *settings, base / "reference")
        out, count = base / "out", base / "calls"
        ended = run_process(run.command(out), {"LD_PRELOAD": library, "SUPPLE_FAIL_COUNT": str(count)})
        if ended.code != 0 or not count.exists():
            raise RuntimeError(f"the run that counts allocations ended with {ended.code}: {ended.err}")
        totals.append(int(count.read_text()))
        for number in spread(totals[-1], (asked + 1 - k) // 2):
            shutil.rmtree(out, ignore_errors=True)
            ended = run_process(run.command(out), {"LD_PRELOAD": library, "SUPPLE_FAIL_AT": str(number)})
            outcome.faults += judge(run, out, ended, f"{('tables and meshes', 'traced pictures and grids')[k]}, allocation {number}", False)
            outcome.reached += 1
        outcome.faults += [f"still running: {text}" for text in orphans(out)]
    outcome.note = f"runs with tables and meshes and with traced pictures and grids make {totals[0]} and {totals[1]} allocations"
    return outcome
