"""Input, output and memory that fail at the n-th call (io_failure.cpp, alloc_failure.cpp)."""
import math
import shutil

from support import Outcome, Served, SmallRun, broken_files, fault_of_exit, orphans, remains, run_process, temporaries

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
# What fails: operator new of all libraries, or malloc of the program itself.
MEMORY = [("tables and meshes", NO_PICTURES, "new"), ("traced pictures and grids", TRACED, "new"), ("tables and meshes", NO_PICTURES, "malloc"), ("traced pictures and grids", TRACED, "malloc")]
KINDS = ("eio", "enospc", "short", "eintr")


def spread(total, asked):
    """Numbers from 1 to total: all, or so many of them, each the first of its stretch."""
    return sorted({1 + k * total // asked for k in range(asked)}) if asked < total else list(range(1, total + 1))


class Failing:
    """A run with one failure at the n-th call of a preloaded library, and what comes of it."""

    def __init__(self, run, library, env):
        self.run = run
        self.out = run.reference.parent / "out"
        self.library, self.env = library, env
        self.served = Served(run.command(self.out), library, env, run.reference.parent / "errors")
        self.resuming = Served(run.command(self.out, "--resume"), library, env, run.reference.parent / "resume_errors")
        self.resumed = {}  # faults, by what was left: a resumed run depends on nothing else

    def calls(self, variable, **env):
        """Number of calls of an undisturbed run."""
        count = self.run.reference.parent / "calls"
        shutil.rmtree(self.out, ignore_errors=True)
        ended = run_process(self.run.command(self.out), {**self.env, "LD_PRELOAD": str(self.library), variable: str(count), **env})
        if ended.code != 0 or not count.exists():
            raise RuntimeError(f"the run that counts calls ended with {ended.code}: {ended.err}")
        return int(count.read_text())

    def faults(self, number, kind, allowed, words=""):
        """What is wrong with the run whose call `number` fails: its exit and message, what it leaves, and that it can be resumed."""
        shutil.rmtree(self.out, ignore_errors=True)
        ended = self.served.run(number, kind)
        fault = fault_of_exit(ended, allowed)
        if not fault and ended.code != 0 and words not in ended.err:
            fault = f"a message without '{words}': {ended.err[:200]}"
        faults = [fault] if fault else []
        if ended.code == 0:
            return faults + self.run.difference(self.out)
        if self.out.exists():
            faults += broken_files(self.out, self.run.files) + [f"a temporary file is left: {name}" for name in temporaries(self.out)]
        left = remains(self.out)
        if left not in self.resumed:
            fault = fault_of_exit(self.resuming.run(), {0})
            self.resumed[left] = [f"resumed: {text}" for text in ([fault] if fault else self.run.difference(self.out))]
        return faults + self.resumed[left]

    def close(self):
        """@return processes that are left"""
        self.served.close()
        self.resuming.close()
        return [f"still running: {text}" for text in orphans(self.out)]


def failing(context, name, number, settings, library, env):
    base = context.folder(f"{name}_{number}")
    run = SmallRun(context, *settings, base / "reference")
    return Failing(run, context.build / f"lib/lib{library}.so", {word: text.format(out=base / "out") for word, text in env.items()})


def failing_io(context, share, kinds=KINDS, settings=(*LONGER, FILMED)):
    outcome, totals, resumed = Outcome(), [], 0
    for k, words in enumerate(settings):
        run = failing(context, "io", k, words, "io_failure", {"SUPPLE_FAIL_IO_UNDER": "{out}"})
        totals.append(run.calls("SUPPLE_FAIL_IO_COUNT"))
        for number in spread(totals[-1], math.ceil(share * totals[-1])):
            for kind in kinds:
                faults = run.faults(number, kind, {0} if kind in ("short", "eintr") else {0, 4})
                outcome.faults += [f"{run.out}, {kind} at call {number}: {text}" for text in faults]
                outcome.reached += 1
        outcome.faults += run.close()
        resumed += len(run.resumed)
    outcome.planned = len(kinds) * sum(totals)
    outcome.note = f"{len(totals)} runs make {' + '.join(map(str, totals))} calls; {len(kinds)} kinds of failure; {resumed} different remains, each resumed"
    return outcome


def failing_memory(context, share):
    outcome, told, resumed = Outcome(), [], 0
    for k, (name, settings, kind) in enumerate(MEMORY):
        run = failing(context, "memory", k, settings, "alloc_failure", {})
        total = run.calls("SUPPLE_FAIL_COUNT", SUPPLE_FAIL_KIND=kind)
        for number in spread(total, math.ceil(share * total)):
            faults = run.faults(number, kind, {0, 6}, "memory")
            outcome.faults += [f"{name}, {kind}, allocation {number}: {text}" for text in faults]
            outcome.reached += 1
        outcome.faults += run.close()
        outcome.planned += total
        told.append(f"{total} by {kind} with {name}")
        resumed += len(run.resumed)
    outcome.note = f"{', '.join(told)}; {resumed} different remains, each resumed"
    return outcome
