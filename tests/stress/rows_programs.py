"""Rows that call tests and benchmarks and count by their output."""
import csv
import json
import math
import pathlib
import re
import subprocess
import threading
import time

from support import Outcome, run_process

LONG_S = 3600
FUZZ_S = 4 * LONG_S  # libFuzzer ends after so long, with the inputs tried until then


def of_tests(program, pattern, context, asked):
    """Tests of GoogleTest by a pattern of names. Counts tests."""
    outcome = Outcome()
    ended = run_process([context.bin / program, "--gtest_filter=" + pattern, "--gtest_brief=1"], timeout=LONG_S,
                        env={"TMPDIR": str(context.folder("gtest"))})
    found = re.search(r"(\d+) tests? from \d+ test suites? ran", ended.out)
    outcome.reached = int(found.group(1)) if found else 0
    outcome.faults = re.findall(r"^\[  FAILED  \] (\S+)", ended.out, re.MULTILINE)
    if ended.code != 0 and not outcome.faults:
        outcome.faults.append(f"{program} ended with {ended.code}: {ended.err[:200]}")
    if outcome.reached == 0:
        outcome.faults.append(f"no test of {program} has a name like {pattern}")
    return outcome


def several(parts, context, asked):
    """Several sets of tests as one row."""
    outcome = Outcome()
    for program, pattern in parts:
        part = of_tests(program, pattern, context, asked)
        outcome.reached += part.reached
        outcome.faults += part.faults
    return outcome


def stability(context, asked):
    """core_stress and contact_stress: each ends with 1 where a run gained energy, passed through or stopped."""
    outcome = Outcome()
    for program, counted in (("core_stress", r"^(\d+) runs;"), ("contact_stress", r"^\| [^|]+ \| (\d+) \|")):
        ended = run_process([context.bin / program], timeout=LONG_S)
        outcome.reached += sum(int(number) for number in re.findall(counted, ended.out, re.MULTILINE))
        if ended.code != 0:
            outcome.faults.append(f"{program} ended with {ended.code}: {ended.err[:300]}")
    return outcome


SOAK = """schema: 1
duration: 10
frame_rate: 10
gravity: [0, 0, -9.81]
time_step: {{substeps: {substeps}}}
objects:
  - name: ball
    particles: {{arrange: single, at: [0, 0, 0.17], spin: [0, 1, 0], mass: 0.1}}
    skeleton: [{{shape: point, kernel: {{type: wyvill, radius: 0.3}}}}]
    contact: {{modulus: 1e4, friction: 0.3, dissipation: 0.5}}
ground: {{height: 0}}
"""
SOAK_FRAMES = 100


def resident(process):
    """Memory of its own [kB]: pages of the program itself come and go with what else the machine does."""
    try:
        text = pathlib.Path(f"/proc/{process.pid}/status").read_text()
    except OSError:
        return 0
    found = re.search(r"RssAnon:\s+(\d+)", text)
    return int(found.group(1)) if found else 0


def soak(context, asked):
    """A ball that rolls on the ground for so many steps: resident memory from the tenth part of the way to the end."""
    outcome = Outcome()
    folder = context.folder("soak")
    steps = 1
    while steps * SOAK_FRAMES < asked:
        steps *= 2
    scene = folder / "soak.yaml"
    scene.write_text(SOAK.format(substeps=steps))
    process = subprocess.Popen([context.tool, "run", str(scene), "--out", str(folder / "out"), "--simulate-only", "--progress", "none", "--threads", "1"],
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    early = late = 0
    states = folder / "out" / "states"
    while process.poll() is None:
        frames = len(list(states.glob("*.state"))) if states.exists() else 0
        if not early and frames >= SOAK_FRAMES // 10:
            early = resident(process)
        late = resident(process) or late
        time.sleep(0.05)
    outcome.reached = steps * SOAK_FRAMES
    if process.returncode != 0:
        outcome.faults.append(f"the run ended with {process.returncode}")
    elif not early or late > 1.01 * early:
        outcome.faults.append(f"{early} kB after a tenth, {late} kB at the end")
    outcome.note = f"{early} kB after a tenth, {late} kB at the end"
    return outcome


def contacts(context, asked):
    """stress_contacts: momenta, pressures and deformed surfaces of random contacts, and none where bodies are apart."""
    outcome = Outcome()
    ended = run_process([context.bin / "stress_contacts", asked, context.seed], timeout=LONG_S)
    try:
        told = json.loads(ended.out)
    except ValueError:
        outcome.faults.append(f"stress_contacts ended with {ended.code}: {ended.err[:300]}")
        return outcome
    outcome.reached, outcome.faults = told["touching"], told["faults"]
    outcome.note = (f"and {told['apart']} pairs apart; largest relative errors: forces {told['forces']:.0e}, moments {told['moments']:.0e}, "
                    f"pressures {told['pressures']:.0e}, surfaces {told['surfaces']:.0e}")
    return outcome


ROUND_OFF = 1e-9  # relative
CONTACT_ERROR = 1e-6
SOFT_BODY = """schema: 1
duration: 0.1
frame_rate: 100
gravity: [0, 0, -9.81]
contact: {{error: {error}}}
ground: {{height: 0, modulus: 1e5, friction: 0.4}}
objects:
  - name: body
    particles: {{arrange: file, file: {points}}}
    skeleton: [{{shape: point, kernel: {{type: wyvill, radius: 0.12}}}}]
    {kind}
  - name: press
    particles: {{arrange: single, at: [0.02, 0.01, 0.39], velocity: [0.3, 0, -1], mass: 1}}
    skeleton: [{{shape: point, kernel: {{type: wyvill, radius: 0.3}}}}]
    contact: {{modulus: 1e4, friction: 0.2}}
output: {{particles: csv}}
"""
PRESSED = "contact: {modulus: 2e4, friction: 0.3, dissipation: 0.5}\n    "
# Keys of the lump, and the largest relative change. The nodes of a contact lie by the first part of a body, so that another one changes it by its error. The law
# of friction is left out: explicit steps damp pair by pair, so that another order changes them by the error of the step.
SOFT_KINDS = {
    "bonds": ("interactions: [{law: bond_frame, within: 0.15, stretch: 300, rotation: 0.2}]", ROUND_OFF),
    "pairs": ("interactions: [{law: lennard_jones, geometric: true, rest_distance: 0.07, depth: 0.01, cut_off: 0.2}]", ROUND_OFF),
    "cohesion": ("interactions: [{law: cohesion, within: 0.2, rest_distance: 0.07, maximum_distance: 0.1, maximum_force: 0.5}]", ROUND_OFF),
    "bodies": (PRESSED + "separate: true", ROUND_OFF),
    "one body": (PRESSED + "interactions: [{law: bond_frame, within: 0.15, stretch: 300, rotation: 0.2}]", 10.0 * CONTACT_ERROR),
}


def soft_body(pick):
    """Particles of a lump at random: x, y, z, mass, velocity."""
    return [[0.08 * (i - 1) + pick.uniform(-0.01, 0.01), 0.08 * (j - 1) + pick.uniform(-0.01, 0.01), 0.07 + 0.08 * k + pick.uniform(-0.01, 0.01),
             pick.uniform(0.01, 0.03), *[pick.uniform(-1.0, 1.0) for _ in range(3)]] for i in range(3) for j in range(3) for k in range(2)]


def motion_of(context, folder, name, kind, points, order):
    """Positions and velocities of all particles after three frames, by the numbers that they have in `points`."""
    (folder / f"{name}.csv").write_text("x,y,z,mass,vx,vy,vz\n" + "".join(",".join(map(repr, points[k])) + "\n" for k in order))
    scene = folder / f"{name}.yaml"
    scene.write_text(SOFT_BODY.format(points=f"{name}.csv", kind=kind, error=CONTACT_ERROR))
    ended = run_process([context.tool, "run", scene, "--out", folder / name, "--frames", "1-4", "--progress", "none", "--threads", 1])
    if ended.code != 0:
        raise RuntimeError(f"{scene} ended with {ended.code}: {ended.err}")
    with open(folder / name / "particles" / f"{name}.0004.csv", newline="") as table:
        rows = list(csv.DictReader(table))
    numbers = [[float(row[key]) for key in ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")] for row in rows]
    found = [None] * len(order)
    for row, k in zip(numbers, order):
        found[k] = row
    return found + numbers[len(order):]


def renumbered(context, asked):
    """A lump of particles in other orders: the same motion."""
    outcome, pick = Outcome(), context.random("renumbered")
    folder = context.folder("renumbered")
    orders = -(-asked // len(SOFT_KINDS))
    for kind, (keys, most) in SOFT_KINDS.items():
        points = soft_body(pick)
        rest = motion_of(context, folder, kind.replace(" ", "_") + "_rest", keys, points, list(range(len(points))))
        for number in range(orders):
            order = pick.sample(range(len(points)), len(points))
            moved = motion_of(context, folder, f"{kind.replace(' ', '_')}_{number}", keys, points, order)
            change = max(abs(a - b) for one, other in zip(rest, moved) for a, b in zip(one, other))
            outcome.reached += 1
            if not change <= most * max(abs(a) for row in rest for a in row):
                outcome.faults.append(f"{kind}, order {number}: differs by {change:.1e}")
    return outcome


def invariance(context, asked):
    """contact_invariance: contacts exchanged, turned and moved, made smaller and larger, each a case for every pose; and particles numbered otherwise."""
    outcome = renumbered(context, 25)
    ended = run_process([context.bin / "contact_invariance", 5, "all", "auto", context.seed], timeout=LONG_S)
    poses = {}
    for line in ended.out.splitlines():
        told = json.loads(line)
        case = told["name"].rsplit("/", 1)[0]
        poses[case] = max(poses.get(case, 0), told["poses"])
        if told["beyond_1e-9"]:
            outcome.faults.append(f"{told['name']}: {told['beyond_1e-9']} of {told['poses']} poses differ, by {told['largest_change']}")
    if ended.code != 0:
        outcome.faults.append(f"contact_invariance ended with {ended.code}: {ended.err[:300]}")
    outcome.note = f"{sum(poses.values())} of contacts, each for 4 errors, {outcome.reached} of particles numbered otherwise"
    outcome.reached += sum(poses.values())
    outcome.faults += [f"{outcome.reached} cases instead of {asked}"] if outcome.reached < asked else []
    return outcome


FUZZ_TARGETS = {"mesh": 1.0, "csv": 1.0, "png": 1.0, "state": 1.0, "scene": 1.0, "check": 0.01}  # share of the inputs, as some take far longer
SCENES = "tests/golden/messages"  # more to begin with for targets that read scenes


def fuzz(context, asked):
    """The fuzz targets without libFuzzer: their corpora, with changes. Each ends where an input is neither used nor refused."""
    outcome = Outcome()
    for name, share in FUZZ_TARGETS.items():
        corpus = context.sources / "tests/fuzz/corpus" / name
        changes = max(1, math.ceil(share * asked / sum(FUZZ_TARGETS.values()) / len(list(corpus.iterdir()))))
        folder = context.folder("fuzz_" + name)
        ended = run_process([context.bin / ("fuzz_" + name), "--changes", changes, corpus], timeout=LONG_S, cwd=folder)
        tried = re.search(r"^(\d+) inputs", ended.out)
        outcome.reached += int(tried.group(1)) if tried else 0
        if ended.code != 0:
            outcome.faults.append(f"fuzz_{name} ended with {ended.code} ({folder}/fuzz_input): {ended.err[:200]}")
    return outcome


BUILDING = threading.Lock()


def sanitized_fuzz(target, context, asked):
    """A fuzz target by libFuzzer, for so many inputs, but at most FUZZ_S seconds; what it finds is left in its folder."""
    outcome = Outcome()
    with BUILDING:
        # A configured folder keeps its options.
        configure = [] if (context.sources / "build/sanitizers/build.ninja").exists() else [["cmake", "--preset", "sanitizers"]]
        for command in (*configure, ["cmake", "--build", "--preset", "sanitizers", "--target", "fuzz_" + target]):
            built = run_process(command, timeout=4 * LONG_S, cwd=context.sources)
            if built.code != 0:
                raise RuntimeError(f"{' '.join(command)} ended with {built.code}: {(built.err or built.out)[-300:]}")
    folder = context.folder("libfuzzer_" + target)
    (folder / "found").mkdir()
    corpora = [context.sources / "tests/fuzz/corpus" / target, *([context.sources / SCENES] if target in ("scene", "check") else [])]
    ended = run_process([context.sources / "build/sanitizers/bin" / ("fuzz_" + target), f"-runs={asked}", f"-max_total_time={FUZZ_S}", f"-seed={context.seed}", "found", *corpora],
                        timeout=2 * FUZZ_S, cwd=folder)
    tried = re.search(r"^stat::number_of_executed_units: (\d+)", ended.err, re.MULTILINE)
    outcome.reached = int(tried.group(1)) if tried else 0
    kept = len(list((folder / "found").iterdir()))
    outcome.note = f"{kept} of them reached something new"
    if ended.code != 0:
        outcome.faults.append(f"fuzz_{target} ended with {ended.code} ({folder}): {ended.err[-300:]}")
    return outcome
