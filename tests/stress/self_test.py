"""Planted faults: every kind of check must find its own."""
import stat

import rows_failures
import rows_inputs
import rows_runs
from support import run_process

PLANTS = ("crash", "hang", "slow", "memory", "contract", "internal", "place")

# A tool that does what the real one does, and something wrong besides.
WRONG_TOOLS = {
    "crashes": (("hostile", "tool"), 'kill -SEGV $$'),
    "accepts everything": (("hostile",), 'exit 0'),
    "says nothing": (("hostile",), 'exit 3'),
    "has no place": (("hostile",), 'echo "scene: something is wrong" >&2; exit 3'),
    "leaves a temporary file": (("kill", "signals"), '{tool} "$@"; code=$?; touch "{out}/.x.tmp"; exit $code'),
    "leaves half a file": (("kill", "races", "states"), '{tool} "$@"; code=$?; echo half > "{out}/frames/two_balls.0001.png"; exit $code'),
    "takes any state": (("states",), '{tool} "$@" || exit 0'),
}
SHARE = {"hostile": 3, "tool": 3, "kill": 2, "signals": 2, "races": 1, "states": 3}
RUN = {"hostile": rows_inputs.hostile, "tool": rows_inputs.mutated_by_tool, "kill": rows_runs.kill, "signals": rows_runs.signals,
       "races": rows_runs.races, "states": rows_runs.states}


def planted_inputs(context):
    failed = False
    for plant in (*PLANTS, "none"):
        ended = run_process([context.bin / "stress_inputs", "planted", "--plant", plant, "--count", 1, "--scratch", context.folder("planted")], timeout=120)
        found = ended.code == 1
        right = found == (plant != "none")
        print(f"{'stress_inputs, ' + plant:<44} {'found' if found else 'nothing found'}{'' if right else ', WRONG'}", flush=True)
        failed = failed or not right
    return failed


def wrong_tools(context):
    failed = False
    real = context.tool
    for name, (rows, script) in WRONG_TOOLS.items():
        for row in rows:
            folder = context.folder("wrong")
            tool = folder / "supple"
            # Undisturbed runs, which rows compare with, are right.
            body = script.format(tool=real, out="$out")
            tool.write_text("#!/bin/bash\nout=\nprevious=\nfor word; do [[ $previous == --out ]] && out=$word; previous=$word; done\n"
                            f'if [[ $out == *reference* || $1 == --version ]]; then exec {real} "$@"; fi\n{body}\n')
            tool.chmod(tool.stat().st_mode | stat.S_IXUSR)
            context.tool = str(tool)
            try:
                outcome = RUN[row](context, SHARE[row])
            finally:
                context.tool = real
            found = bool(outcome.faults)
            print(f"{row + ', a tool that ' + name:<44} {'found' if found else 'nothing found, WRONG'}", flush=True)
            failed = failed or not found
    return failed


def crashing_io(context):
    found = len(rows_failures.failing_io(context, 0.01, kinds=("crash",), settings=(rows_failures.TINY,)).faults) >= 2
    print(f"{'io, a call that ends the program':<44} {'found' if found else 'nothing found, WRONG'}", flush=True)
    return not found


def run(context):
    """@return whether something that was planted was not found"""
    return any([planted_inputs(context), crashing_io(context), wrong_tools(context)])
