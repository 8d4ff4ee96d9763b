"""Rows that call tests and benchmarks and count by their output."""
import json
import pathlib
import re
import subprocess
import time

from support import Outcome, run_process

LONG_S = 3600


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


FUZZ_TARGETS = {"mesh": 1.0, "csv": 1.0, "png": 1.0, "state": 1.0, "scene": 0.01}  # share of the inputs, as some take far longer


def fuzz(context, asked):
    """The fuzz targets without libFuzzer: their corpora, with changes. Each ends where an input is neither used nor refused."""
    outcome = Outcome()
    for name, share in FUZZ_TARGETS.items():
        corpus = context.sources / "tests/fuzz/corpus" / name
        changes = max(1, int(share * asked / len(FUZZ_TARGETS) / len(list(corpus.iterdir()))))
        folder = context.folder("fuzz_" + name)
        ended = run_process([context.bin / ("fuzz_" + name), "--changes", changes, corpus], timeout=LONG_S, cwd=folder)
        tried = re.search(r"^(\d+) inputs", ended.out)
        outcome.reached += int(tried.group(1)) if tried else 0
        if ended.code != 0:
            outcome.faults.append(f"fuzz_{name} ended with {ended.code} ({folder}/fuzz_input): {ended.err[:200]}")
    return outcome
