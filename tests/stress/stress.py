"""Stress tests: the rows of docs/reliability.md. Called by scripts/stress.sh, which builds their programs."""
import argparse
import concurrent.futures
import dataclasses
import datetime
import functools
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time
import traceback

import rows_failures
import rows_fits
import rows_inputs
import rows_programs
import rows_runs
from support import MOST_FAULTS_TOLD, Context, Outcome

SOURCES = pathlib.Path(__file__).resolve().parents[2]
REPORT = SOURCES / "docs/reliability.md"


@dataclasses.dataclass
class Row:
    name: str
    what: str
    asked: int        # at full share, in things that `unit` names
    unit: str
    run: object
    fixed: bool = False  # no share changes it
    every: bool = False  # all that there are: `run` takes the share, and finds the number
    only_named: bool = False  # takes hours


def tests(*parts):
    return functools.partial(rows_programs.several, parts)


ROWS = [
    Row("scenes", "library scenes and golden messages, mutated; read and checked, those that pass run for two frames", 10_000, "scenes", functools.partial(rows_inputs.by_libraries, "scenes")),
    Row("tool", "mutated scenes by the command line: checked in 1 s of processor time, the quickest of three, and 256 MB; then run under a time limit", 500, "scenes", rows_inputs.mutated_by_tool),
    Row("hostile", "hostile scenes and golden messages: refused in 1 s of processor time, the quickest of three, and 256 MB", 250, "scenes", rows_inputs.hostile),
    Row("files", "meshes (OBJ, PLY, OFF, STL) and tables (CSV), mutated", 2_000, "files", functools.partial(rows_inputs.by_libraries, "files")),
    Row("fits", "fits of damaged meshes, scenes with damaged objects, fits whose input, output and memory fail or that are killed: refused with a message, no incomplete file", 400, "trials", rows_fits.fits),
    Row("fuzz", "fuzz targets (mesh, CSV, PNG, state with a right checksum, scene read, scene checked): corpora with changes; used or refused", 1_000_000, "inputs", rows_programs.fuzz),
    *(Row(f"libfuzzer-{target}", f"fuzz target {target} led by coverage, with address and undefined-behaviour sanitizers, by clang", round(share * 10_000_000), "inputs",
          functools.partial(rows_programs.sanitized_fuzz, target), only_named=True) for target, share in rows_programs.FUZZ_TARGETS.items()),
    Row("state-bytes", "saved states with altered bytes, by the library: refused", 10_000, "states", functools.partial(rows_inputs.by_libraries, "states")),
    Row("states", "saved states altered or exchanged, by `run --resume`, `render`, `export`: refused with 7, or simulated again to the same bits", 1_000, "commands", rows_runs.states),
    Row("frames", "lists of frames for `--frames`", 100_000, "lists", functools.partial(rows_inputs.by_libraries, "frames")),
    Row("grids", "OpenVDB files altered or truncated: exported again, complete", 1_000, "files", rows_runs.grids),
    Row("memory", "the n-th allocation fails: exit 6 with a message, no incomplete file, resumed to the same bits", 1, "allocations", rows_failures.failing_memory, every=True),
    Row("io", "EIO, ENOSPC, EINTR or a short count at the n-th call: exit 4 or the same result, resumed to the same bits", 1, "failing calls", rows_failures.failing_io, every=True),
    Row("kill", "SIGKILL at random moments, then `--resume`: same bits, no temporary file, no process left", 500, "kills", rows_runs.kill),
    Row("signals", "SIGINT, SIGTERM: exit 130, 143, resumed to the same bits", 100, "signals", rows_runs.signals),
    Row("races", "two runs in one folder: one runs, the other is refused with the reason", 50, "races", rows_runs.races),
    Row("shards", "several processes draw frames of one run, SIGKILL at random moments, drawn again: same bytes, no temporary file, no process left", 100, "kills", rows_runs.shards),
    Row("resume", "resumed twice from every frame, in new processes", 60, "frames", rows_runs.resume),
    Row("threads", "8 scenes by 1, 2, 3, 4, 8, 16 threads: same bits, same files", 48, "runs", rows_runs.threads),
    Row("messages", "golden messages, word for word", 150, "tests", tests(("scenes_tests", "Golden/Message.*:Messages.*")), True),
    Row("determinism", "threads, skips, outputs, restarts, order of objects", 1, "tests", tests(("scenes_tests", "*Determinism*"), ("collision_tests", "*AnyNumberOfThreads*:*AnyThreads*")), True),
    Row("invariance", "contacts exchanged, turned and moved, a thousandth and a thousand times as large; particles numbered otherwise: the same to 1e-9, or to the error of contacts where bodies of many particles touch", 285, "cases", rows_programs.invariance, True),
    Row("conservation", "momentum, angular momentum, action and reaction", 1, "tests", tests(("scenes_tests", "FreeBalls.*:FreeCollision.*:SetParticles.KeepsTheAudits"), ("collision_tests", "React.KeepsMomentum*:FreeCollision.*:ContactRules.*KeepMomenta")), True),
    Row("surfaces", "both deformed surfaces coincide on the contact surface, no force elsewhere", 1, "tests", tests(("collision_tests", "DeformedField.*:*NeverGivesOnePointToTwoBodies*:ContactSurface.HasBothPressuresEqualAtEveryPoint:ContactSurface.IsEmpty*"), ("scenes_tests", "FreeCollision.BothDeformed*:Simulation.GivesNoForce*:Meshes.OfTouchingObjects*")), True),
    Row("contacts", "random contacts of 13 kinds of pairs: momenta, pressures and deformed surfaces to 1e-10, none where bodies are apart", 2_000, "contacts", rows_programs.contacts),
    Row("gradients", "laws, kernels, shapes and fields against finite differences", 1, "tests", tests(("core_tests", "*AreTheGradient*:*MatchCentralDifferences*"), ("implicit_tests", "*CentralDifferences*"), ("collision_tests", "*Gradient*")), True),
    Row("stability", "step x stiffness x compression x mass ratio, and contact at any stiffness and speed", 1_000, "runs", rows_programs.stability, True),
    Row("soak", "memory of a long run: grows by less than 1 %", 1_000_000, "steps", rows_programs.soak, True),
]


def commit():
    words = ["git", "-C", str(SOURCES), "rev-parse", "--short", "HEAD"]
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip() or "unknown"


def run_row(row, context):
    asked = row.asked if row.fixed else max(1, math.ceil(row.asked * context.share))
    begin = time.monotonic()
    try:
        outcome = row.run(context, context.share if row.every else asked)
        if outcome.reached == 0 and not outcome.faults:
            outcome.faults.append("nothing was tried")
    except Exception as error:  # a row that cannot be run has failed, and the others go on
        traceback.print_exc()
        outcome = Outcome(faults=[f"the row ended early: {error}"])
    return asked, outcome, time.monotonic() - begin


def tell(row, asked, outcome, seconds):
    result = "passed" if not outcome.faults else f"{len(outcome.faults)} FAULTS"
    of_asked = f" of {outcome.planned}" if outcome.planned else f" of {asked}" if row.asked > 1 else ""
    print(f"{row.name:<14} {outcome.reached}{of_asked} {row.unit}, {result}, {seconds:.0f} s{', ' + outcome.note if outcome.note else ''}", flush=True)
    for fault in outcome.faults[:MOST_FAULTS_TOLD]:
        print("    " + fault)
    if len(outcome.faults) > MOST_FAULTS_TOLD:
        print(f"    and {len(outcome.faults) - MOST_FAULTS_TOLD} more")


def asked_in_words(row, outcome=Outcome()):
    if outcome.planned:
        return f"all {outcome.planned:,} {row.unit}"
    return f"{row.asked:,} {row.unit}" if row.asked > 1 else f"all {row.unit}"


def report_line(row, context, outcome, seconds, at_commit):
    command = f"`scripts/stress.sh {row.name} --seed {context.seed}" + ("" if row.fixed or context.share == 1.0 else f" --share {context.share:g}")
    command += ("" if str(context.scratch).startswith(str(context.build)) else f" --scratch {context.scratch.parent}") + "`"
    asked = asked_in_words(row, outcome)
    today = datetime.date.today().isoformat()
    note = f" ({outcome.note})" if outcome.note else ""
    return f"| {row.name} | {row.what} | {asked} | {outcome.reached:,}{note} | {len(outcome.faults)} | {seconds:.0f} | {today}, {at_commit} | {command} |"


def write_report(lines):
    """Rows that were not run this time keep their last line; the text around the table is as it was."""
    text = REPORT.read_text()
    line = re.compile(r"^\| ([a-z-]+) \|.*\n", re.MULTILINE)
    known = {match.group(1): match.group(0) for match in line.finditer(text)} | {name: made + "\n" for name, made in lines.items()}
    never = lambda row: f"| {row.name} | {row.what} | {asked_in_words(row)} | 0, not run | | | | `scripts/stress.sh {row.name}` |\n"
    head, rule, _ = text.partition("|---|---|---|---|---|---|---|---|\n")
    foot = text[text.rindex("\n|") + 1:].partition("\n")[2]
    REPORT.write_text(head + rule + "".join(known.get(row.name, never(row)) for row in ROWS) + foot)


def run_rows(rows, context, report):
    """Runs rows, some at the same time: they are judged by processor time, and have folders of their own. @return whether one failed"""
    lines, failed, at_commit = {}, False, commit()
    with concurrent.futures.ThreadPoolExecutor(context.jobs) as pool:
        running = {pool.submit(run_row, row, context): row for row in rows}
        for done in concurrent.futures.as_completed(running):
            row, (asked, outcome, seconds) = running[done], done.result()
            tell(row, asked, outcome, seconds)
            lines[row.name] = report_line(row, context, outcome, seconds, at_commit)
            failed = failed or bool(outcome.faults)
            if report:
                write_report(lines)  # at once: what follows may take long
    return failed


def main():
    parser = argparse.ArgumentParser(prog="scripts/stress.sh", description="Runs stress tests, row by row: " + ", ".join(row.name for row in ROWS) + ".")
    parser.add_argument("rows", nargs="*", metavar="ROW", help="all but those of libFuzzer when none is named")
    parser.add_argument("--seed", type=int, default=1, help="seed of random numbers (default 1)")
    parser.add_argument("--share", type=float, default=1.0, help="share of the planned numbers, e.g. 0.1")
    parser.add_argument("--report", action="store_true", help="write the lines of these rows into docs/reliability.md")
    parser.add_argument("--build", default=str(SOURCES / "build/release"), help="build folder (default build/release)")
    parser.add_argument("--scratch", help="folder for what the rows write (default: below the build folder); in memory, as /dev/shm, they are quicker")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="rows at the same time (default: one per processor)")
    parser.add_argument("--self-test", action="store_true", help="plant faults and expect every row that is tried to find them")
    arguments = parser.parse_args()
    unknown = set(arguments.rows) - {row.name for row in ROWS}
    if unknown:
        parser.error(f"no row is named {', '.join(sorted(unknown))}; rows: {', '.join(row.name for row in ROWS)}")
    if not 0.0 < arguments.share <= 1.0:
        parser.error("--share: expected a number above 0, at most 1")
    scratch = pathlib.Path(arguments.scratch or pathlib.Path(arguments.build) / "stress").resolve() / f"stress_{os.getpid()}"
    context = Context(SOURCES, arguments.build, scratch, arguments.seed, arguments.share, max(1, arguments.jobs))
    if arguments.self_test:
        import self_test
        failed = self_test.run(context)
    else:
        failed = run_rows([row for row in ROWS if row.name in arguments.rows or not (arguments.rows or row.only_named)], context, arguments.report)
    if failed:
        print(f"what shows the faults is in {scratch}")
    else:
        shutil.rmtree(scratch, ignore_errors=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
