"""Hostile and mutated inputs: thousands for the libraries (stress_inputs), and some of them for the tool."""
import concurrent.futures
import json
import os
import re
import shutil

from support import MB, Outcome, fault_of_exit, run_process

MOST_SECONDS, MOST_BYTES = 1.0, 256 * MB
RUN_MEMORY = 6 << 30


def by_libraries(what, context, asked):
    """Inputs are told by seed and number: parts of them run at the same time."""
    outcome = Outcome()
    parts = min(context.jobs, asked)
    bounds = [part * asked // parts for part in range(parts + 1)]

    def run_part(first, end):
        return run_process([context.bin / "stress_inputs", what, "--first", first, "--count", end - first, "--seed", context.seed, "--sources", context.sources,
                            "--scratch", context.folder(f"{what}_{first}")], timeout=24 * 3600)

    with concurrent.futures.ThreadPoolExecutor(parts) as pool:
        all_ended = list(pool.map(run_part, bounds[:-1], bounds[1:]))
    refused = 0
    for ended in all_ended:
        try:
            told = json.loads(ended.out)
        except ValueError:
            outcome.faults.append(f"stress_inputs ended with {ended.code}: {ended.err[:300]}")
            continue
        outcome.reached += told["tried"]
        outcome.faults += [f"{fault['what']} ({fault['file'] or fault['number']})" for fault in told["faults"]]
        refused += told["refused"]
    outcome.note = f"{refused} refused"
    return outcome


def checked(context, path):
    """`supple check`. Others may use the processor and its caches, too: the quickest of three where an answer is late."""
    quickest = None
    for _ in range(3):
        ended = run_process([context.tool, "check", path], timeout=120, memory=RUN_MEMORY)
        if quickest is None or ended.processor_s < quickest.processor_s:
            quickest = ended
        if quickest.processor_s <= MOST_SECONDS:
            break
    return quickest


def fault_of_check(path, ended):
    """Of `supple check`: crashes, answers that are slow or take much memory, and refusals without a place."""
    fault = fault_of_exit(ended, {0, 3, 4, 6})
    if fault:
        return fault
    if ended.processor_s > MOST_SECONDS:
        return f"exit {ended.code} after {ended.processor_s:.1f} s of processor time"
    if ended.most_bytes > MOST_BYTES:
        return f"exit {ended.code} after taking {ended.most_bytes / MB:.0f} MB"
    if ended.code == 3 and not re.match(re.escape(str(path)) + r":\d+:\d+: ", ended.err.replace("warning: ", "")) and str(path.parent) not in ended.err:
        return f"a message without file:line:column: {ended.err[:200]}"
    return ""


def mutated_by_tool(context, asked):
    """Mutated scenes: `supple check`, and of those that pass two frames that may be interrupted."""
    outcome = Outcome()
    folder = context.folder("tool")
    ended = run_process([context.bin / "stress_inputs", "scenes", "--count", asked, "--seed", context.seed + 1, "--sources", context.sources, "--scratch", folder, "--write", "only"])
    if ended.code != 0:
        raise RuntimeError(f"stress_inputs ended with {ended.code}: {ended.err}")
    for kind in ("csv", "obj"):
        for path in (context.sources / "scenes/library").rglob("*." + kind):
            shutil.copy(path, folder)
    passed = 0
    for path in sorted(folder.glob("scene_*.yaml")):
        ended = checked(context, path)
        fault = fault_of_check(path, ended)
        if not fault and ended.code == 0:
            passed += 1
            out = folder / "out"
            shutil.rmtree(out, ignore_errors=True)
            # The scene as it is; the signal comes after seconds, and the run has a minute to end by it, or has just ended by itself.
            ended = run_process(["timeout", "--preserve-status", "--signal=INT", "--kill-after=60", "3", context.tool, "run", path, "--out", out, "--progress", "none", "--threads", 1,
                                 "--set", "output.images=false", "--set", "output.film=false"], memory=RUN_MEMORY)
            fault = fault_of_exit(ended, {0, 3, 4, 5, 6, 130})
            fault = fault or "; ".join(f"a temporary file is left: {name.name}" for name in out.rglob("*.tmp"))
        outcome.reached += 1
        outcome.faults += [f"{path}: {text}" for text in [fault] if text]
    outcome.note = f"{passed} passed the check and were run"
    return outcome


HEAD = "schema: 1\nduration: 0.1\n"
BALL = "objects:\n  - {name: ball, particles: {mass: 1}, skeleton: [{shape: point, kernel: {radius: 0.1}}], contact: {}}\n"


def hostile_texts():
    """Scenes that mean harm, by name."""
    bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12))
    particles = lambda text: HEAD + f"objects:\n  - {{name: ball, particles: {text}, skeleton: [{{shape: point, kernel: {{radius: 0.1}}}}]}}\n"
    texts = {
        "alias_bomb": bomb, "alias_of_a_key": HEAD + "&key " + BALL.replace("contact: {}", "contact: *key"), "cycle": "a: &a [*a]\n", "merge": HEAD + "<<: {a: 1}\n", "documents": HEAD + BALL + "---\n" + HEAD + BALL,
        "nothing": "", "zeros": "\0" * 1000, "byte_order": "\xef\xbb\xbf" + HEAD, "deep": "a: " + "[" * 200000, "wide": "a: [" + "1," * 300000 + "1]\n",
        "long_key": "x" * 1000000 + ": 1\n", "big": HEAD + "title: " + "x" * (9 << 20) + "\n", "tabs": HEAD.replace(" ", "\t"), "tag": HEAD + "!!python/object a: 1\n",
        "count_1e9": particles("{arrange: line, count: 1000000000, spacing: 0.1}"), "grid_1e9": particles("{arrange: grid, columns: 40000, rows: 40000, spacing: 0.1}"),
        "cell_1e-9": HEAD + BALL + "output: {mesh: ply, cell: 1e-9}\n", "grid_cell_1e-9": HEAD + BALL + "output: {grid: vdb, cell: 1e-9}\n",
        "cell_1e-300": HEAD + BALL + "output: {mesh: ply, cell: 1e-300}\n", "spacing_1e-12": HEAD + BALL.replace("[{", "[{shape: point, at: [0.1, 0, 0], kernel: {radius: 0.1}}, {") + "contact: {sample_spacing: 1e-12}\nground: {height: 0}\n",
        "frames_1e12": "schema: 1\nduration: 1e9\nframe_rate: 1000\n" + BALL, "image_1e9": HEAD + BALL + "output: {images: {size: [1000000000, 1000000000]}}\n",
        "huge_steps": HEAD + BALL + "time_step: {substeps: 1000000000000}\n", "radius_1e300": HEAD + BALL.replace("0.1}", "1e300}"),
        "bad_utf8": HEAD + "title: \xff\xfe\n", "surrogate": HEAD + "title: \xed\xa0\x80\n", "octal": HEAD + BALL.replace("mass: 1", "mass: 017"),
    }
    for name, file in {"traversal": "../../../../etc/passwd", "absolute": "/etc/passwd", "device": "/dev/zero", "link": "link.csv", "pipe": "pipe.csv", "endless": "zero.csv",
                       "folder": ".", "nul": "\"p.csv\\0x\""}.items():
        texts["file_" + name] = particles(f"{{arrange: file, file: {file}, mass: 1}}")
    # Numbers that are none, or not of this world, in every place that takes one.
    wrong = {"negative": "-1", "large": "1e300", "small": "1e-300", "nan": ".nan", "infinite": "-.inf", "word": "x", "list": "[1, 2]", "map": "{a: 1}"}
    places = {"duration": ("duration: 0.1", "duration: "), "mass": ("mass: 1", "mass: "), "radius": ("radius: 0.1", "radius: "),
              "modulus": ("contact: {}", "contact: {modulus: ", "}"), "frame_rate": ("schema: 1", "schema: 1\nframe_rate: "),
              "gravity": ("objects:", "gravity: ", "\nobjects:"), "count": ("mass: 1", "arrange: line, spacing: 0.1, mass: 1, count: "), "cell": ("objects:", "output: {mesh: ply, cell: ", "}\nobjects:")}
    for place, (old, new, *end) in places.items():
        texts |= {f"{place}_{name}": (HEAD + BALL).replace(old, new + value + "".join(end), 1) for name, value in wrong.items()}
    return texts


def hostile(context, asked):
    """Scenes that mean harm and those of the golden messages: each is refused in time, with little memory."""
    outcome = Outcome()
    folder = context.folder("hostile")
    (folder / "link.csv").symlink_to("/etc/passwd")
    (folder / "zero.csv").symlink_to("/dev/zero")
    os.mkfifo(folder / "pipe.csv")
    for name, text in hostile_texts().items():
        (folder / f"{name}.yaml").write_bytes(text.encode("latin-1"))
    golden = [path for path in sorted((context.sources / "tests/golden/messages").glob("*.yaml"))
              if path.with_suffix(".txt").read_text() != "no fault\n" and "# --set " not in path.read_text(errors="replace")]
    for path in golden:
        shutil.copy(path, folder / path.name)
    for path in sorted(folder.glob("*.yaml"))[:asked]:
        ended = checked(context, path)
        fault = fault_of_check(path, ended) or ("accepted" if ended.code == 0 else "")
        outcome.reached += 1
        outcome.faults += [f"{path.name}: {text}" for text in [fault] if text]
    return outcome
