"""Objects from data: meshes that are damaged, objects that are, and fits that fail half-way."""
import json
import math
import os
import re
import shutil
import signal
import subprocess
import time

from rows_failures import KINDS, spread
from support import Outcome, contents, fault_of_exit, run_process, temporaries

COARSE = ("--error", "10%", "--particles", "5", "--primitives", "8", "--threads", "1", "--quiet")
SCENE = "schema: 1\nduration: 0.1\nobjects:\n  - {{name: it, include: {}, particles: {{at: [0, 0, 1]}}}}\n"
WORDS = ("0", "-1", "1e9", "1e300", ".nan", "[]", "{}", "4294967296", "x", "'", "- ", "ellipsoid", "null")
MEMORY = 4 << 30  # address space


def octahedron(path):
    """Eight triangles, a metre across."""
    points = [(0.5, 0, 0), (-0.5, 0, 0), (0, 0.5, 0), (0, -0.5, 0), (0, 0, 0.5), (0, 0, -0.5)]
    faces = [(a, b, c) if (a + b + c) % 2 == 0 else (a, c, b) for a in (0, 1) for b in (2, 3) for c in (4, 5)]
    path.write_text("OFF\n6 8 0\n" + "".join("%g %g %g\n" % point for point in points) + "".join("3 %d %d %d\n" % face for face in faces))
    return path


def fit(context, mesh, out, env=None):
    """By the program that `supple fit` starts: preloaded libraries do not follow there."""
    return run_process([context.bin / "supple_fit", mesh, "-o", out, *COARSE, "--overwrite"], env, memory=None if env else MEMORY)


def left_by(folder, ended, reference):
    """What a fit leaves: all or, where it failed, nothing that is not whole."""
    faults = [f"a temporary file is left: {name}" for name in temporaries(folder)]
    objects, report = sorted(folder.glob("*.yaml")), folder / "object.json"
    if reference is not None:
        faults += [f"{path.name} is another one" for path in objects if path.read_text() != reference]
    if report.exists():
        try:
            json.loads(report.read_text())
        except ValueError:
            faults.append("the report is no JSON")
    if ended.code == 0 and not (objects and report.exists()):
        faults.append("a file is missing")
    return faults


def of_scene(context, folder, name):
    """A scene with the object: checked."""
    scene = folder / "scene.yaml"
    scene.write_text(SCENE.format(name))
    ended = run_process([context.tool, "check", scene], timeout=120, memory=MEMORY)
    return ended, scene


def of_damaged_meshes(context, asked, outcome):
    """@return the number of refused ones"""
    folder = context.folder("fit_meshes")
    ended = run_process([context.bin / "stress_inputs", "files", "--count", 2 * asked, "--seed", context.seed, "--sources", context.sources, "--scratch", folder, "--write", "only"])
    if ended.code != 0:
        raise RuntimeError(f"stress_inputs ended with {ended.code}: {ended.err}")
    refused = 0
    meshes = [path for path in sorted(folder.glob("file_*")) if not path.name.endswith("csv")]
    for mesh in meshes[:asked]:
        out = context.folder("fit_mesh")
        ended = fit(context, mesh, out / "object.yaml")
        fault = fault_of_exit(ended, {0, 3, 6})
        if not fault and ended.code != 0:
            refused += 1
            fault = "" if str(mesh) in ended.err else f"a message without the file: {ended.err[:200]}"
        faults = [fault] if fault else left_by(out, ended, None)
        if not faults and ended.code == 0:
            checked, _ = of_scene(context, out, "object.yaml")
            faults = [text for text in [fault_of_exit(checked, {0})] if text]
        outcome.faults += [f"{mesh}: {text}" for text in faults]
        outcome.reached += 1
    return refused


def damaged_text(text, pick):
    words = re.split(r"(\s+)", text)
    for _ in range(pick.randint(1, 4)):
        at = pick.randrange(len(words))
        kind = pick.randrange(4)
        if kind == 0:
            words[at] = pick.choice(WORDS)
        elif kind == 1:
            words[at] = words[pick.randrange(len(words))]
        elif kind == 2:
            words[at] = ""
        else:
            words = words[:max(1, at)]
    return "".join(words)


def of_damaged_objects(context, asked, reference, outcome):
    pick, folder = context.random("objects"), context.folder("fit_objects")
    for number in range(asked):
        (folder / "object.yaml").write_text(damaged_text(reference, pick))
        ended, scene = of_scene(context, folder, "object.yaml")
        fault = fault_of_exit(ended, {0, 3, 6})
        if not fault and ended.code == 3 and str(folder) not in ended.err:
            fault = f"a message without file:line:column: {ended.err[:200]}"
        if fault:
            kept = scene.parent / f"object_{number}.yaml"
            shutil.copy(folder / "object.yaml", kept)
            outcome.faults.append(f"{kept}: {fault}")
        outcome.reached += 1


def of_failing_calls(context, asked, mesh, reference, outcome):
    """Input and output of the n-th call, then allocations: exit 4 or 6, or the same object."""
    folder = context.folder("fit_calls")
    kinds = [("io", kind) for kind in KINDS] + [("alloc", "")]
    for library, kind in kinds:
        preload = str(context.build / f"lib/lib{library}_failure.so")
        prefix = "SUPPLE_FAIL_IO_" if library == "io" else "SUPPLE_FAIL_"
        env = {"LD_PRELOAD": preload, **({"SUPPLE_FAIL_IO_UNDER": str(folder), "SUPPLE_FAIL_IO_KIND": kind} if library == "io" else {})}
        shutil.copy(mesh, folder / "mesh.off")
        counting = {name: value for name, value in env.items() if not name.endswith("_KIND")}
        ended = fit(context, folder / "mesh.off", folder / "object.yaml", {**counting, prefix + "COUNT": str(context.scratch / "calls")})
        if ended.code != 0:
            raise RuntimeError(f"the fit that counts calls ended with {ended.code}: {ended.err}")
        total = int((context.scratch / "calls").read_text())
        for number in spread(total, max(1, asked // len(kinds))):
            for path in folder.glob("object.*"):
                path.unlink()
            ended = fit(context, folder / "mesh.off", folder / "object.yaml", {**env, prefix + "AT": str(number)})
            fault = fault_of_exit(ended, {0} if kind in ("short", "eintr") else {0, 4, 6})
            faults = [fault] if fault else left_by(folder, ended, reference)
            outcome.faults += [f"{library} {kind} at call {number} of {total}: {text}" for text in faults]
            outcome.reached += 1


def of_kills(context, asked, mesh, reference, seconds, outcome):
    pick, folder = context.random("fit kills"), context.folder("fit_kills")
    for number in range(asked):
        process = subprocess.Popen([context.tool, "fit", str(mesh), "-o", str(folder / "object.yaml"), *COARSE, "--overwrite"], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL, start_new_session=True)
        time.sleep(pick.uniform(0.0, 1.2 * seconds))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        outcome.faults += [f"kill {number}: {path.name} is not whole" for path in folder.glob("*.yaml") if path.read_text() != reference]
        outcome.faults += [f"kill {number}: {text}" for text in left_by(folder, run_process(["false"]), reference) if "temporary" not in text]
        outcome.reached += 1
    ended = fit(context, mesh, folder / "object.yaml")
    if ended.code != 0 or contents(folder).keys() < {"object.yaml", "object.json"}:
        outcome.faults.append(f"after kills: exit {ended.code}: {ended.err[:200]}")


def fits(context, asked):
    """Half of the trials are damaged meshes, a fourth damaged objects, the rest failing calls and kills."""
    outcome, folder = Outcome(), context.folder("fit")
    mesh = octahedron(folder / "mesh.off")
    begin = time.monotonic()
    ended = fit(context, mesh, folder / "object.yaml")
    seconds = time.monotonic() - begin
    if ended.code != 0:
        raise RuntimeError(f"the undisturbed fit ended with {ended.code}: {ended.err}")
    reference = (folder / "object.yaml").read_text()
    refused = of_damaged_meshes(context, math.ceil(asked / 2), outcome)
    of_damaged_objects(context, math.ceil(asked / 4), reference, outcome)
    of_failing_calls(context, math.ceil(asked / 5), mesh, reference, outcome)
    of_kills(context, max(1, asked // 20), mesh, reference, seconds, outcome)
    outcome.note = f"{refused} meshes refused"
    return outcome
