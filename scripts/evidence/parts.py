"""The parts of the evidence: each runs benchmarks, draws, and gives the lines of its section."""
import concurrent.futures
import json
import os
import re
from typing import Callable, NamedTuple

from plot_accuracy import draw as draw_accuracy
from plot_accuracy import rows_of

from . import plots
from .bench import Failed
from .pictures import rms


class Part(NamedTuple):
    name: str
    title: str
    budget_s: float
    run: Callable


def table(head, rows):
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)] + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]


def integrators(b):
    plot = b.plot_path("integrators")
    b.bench("core/integrators", plot)
    return b.command_lines() + [b.image("integrators", "CPU time over the error of positions, for every integrator"), "",
                                "Stages 1 and 8 (interactions, integration): the error is the root mean square of positions at the end against the adaptive method at a tolerance of 1e-12."]


def contact(b):
    plot = b.plot_path("contact")
    b.bench("collision/rules", plot)
    return b.command_lines() + [b.image("contact", "CPU time over the error of a contact query, for every rule"), "",
                                "Stages 5 and 6 (candidates, contact surface): the error is the largest of force, area and centre of pressure over random poses, against closed forms or the finest rule."]


QUERY_NAME = re.compile(r"collision/poses/(.*)/error=(.*)")


def queries(b):
    rows = [row for row in b.rows("collision/poses", 20 if b.quick else 200) if row["name"].endswith(("error=0.001", "error=1e-06"))]
    cells = []
    for row in rows:
        case, asked = QUERY_NAME.fullmatch(row["name"]).groups()
        cells.append([case.replace("_", " ").replace("/", ", "), asked, row["poses"], f'{row["cpu_us_median"]:.3g} / {row["cpu_us_max"]:.3g}', f'{row["forces_us_median"]:.2g}',
                      f'{row["error_median"]:.1e} / {row["error"]:.1e}'])
        if row["error"] > float(asked):
            b.loss(f'`{row["name"]}` has a true error of {row["error"]:.1e} in its worst pose, above the one given.')
    slow = max(rows, key=lambda row: row["cpu_us_max"] / max(row["cpu_us_median"], 1e-9))
    b.loss(f'The worst pose of `{slow["name"]}` takes {slow["cpu_us_max"] / slow["cpu_us_median"]:.0f} times the median: its patch is crossed by kinks or rims, where it is cut into pieces until the error estimate is low enough.')
    return b.command_lines() + ["Contact queries in random poses, with the reactions of stage 7 beside them. Errors are true ones, against closed forms or a finer rule with the bodies swapped.", ""] + table(
        ["case", "given error", "poses", "CPU time, median / largest [us]", "reactions, median [us]", "true error, median / largest"], cells)


MESH_NAME = re.compile(r"implicit/mesh/(w\d)/(\d+)/(cubes|tetrahedra|openvdb)")


def meshes(b):
    series = {}
    for body, cells in [("w2", 64), ("w2", 128)] + ([] if b.quick else [("w2", 256), ("w2", 512), ("w3", 64), ("w3", 128), ("w3", 256), ("w3", 512)]):
        for row in b.rows(f"implicit/mesh/{body}/{cells}"):
            found = MESH_NAME.fullmatch(row["name"])
            if found:
                series.setdefault(f"{found[1]} {found[3]}", []).append((row["error"] / cells, row["cpu_ms_min"]))
    b.draw("meshes", plots.log_log(series, "RMS distance of triangle centres, of the side of the lattice", "CPU ms"))
    ours, slowest = f'{series["w2 cubes"][-1][1]:.3g}', f'{series["w2 tetrahedra"][-1][1]:.3g}'
    b.loss(f"Meshes that share triangles where bodies touch (tetrahedra) take {slowest} ms where cubes take {ours} at as many cells (W2): they have about three times the triangles, and vertices on edges of six lattices.")
    return b.command_lines() + [b.image("meshes", "CPU time over the error of meshes"), "",
                                "Stages 2, 3 and 9 (skeleton, field, mesh): W2 and W3 are 1,000 and 10,000 blobs in a deformed ball. `openvdb` is volumeToMesh of OpenVDB on the field of supple."]


def pictures(b):
    noises = [1.6, 0.8] if b.quick else [1.6, 0.8, 0.4, 0.2, 0.1]
    finest = 0.4 if b.quick else 0.03
    times, files = {}, {}
    for noise in [*noises, finest]:
        files[noise] = b.work / f"noise_{noise:g}.png"
        times[noise] = b.rows("render/path", noise, files[noise])[0]["cpu_ms"] / 1e3
    errors = {noise: rms(files[noise], files[finest]) for noise in noises}
    frame = next(row for row in b.rows("render/gl") if row["name"] == "render/gl/frame")
    b.draw("pictures", plots.log_log({"path tracer": [(errors[noise], times[noise]) for noise in noises]}, f"RMS of pixels against noise {finest:g}, of the full range", "CPU s"))
    return b.command_lines() + [b.image("pictures", "CPU time over the error of pictures of the path tracer"), "",
                                f'Stage 10 (render): 640 x 360 pixels. By OpenGL a frame of 1280 x 720 and {frame["triangles"]:,} triangles takes {frame["min_cpu_ms"]:.0f} ms; it has no error to choose.', ""] + table(
        ["noise asked", "CPU s", "RMS of pixels"], [[f"{noise:g}", f"{times[noise]:.2g}", f"{errors[noise]:.1e}"] for noise in noises])


# Scenes with the accuracies that fit their time, longest first.
SCENES = {"ball_in_ring": ("1e-2",), "jelly": ("1e-2",), "letter": ("1e-2",), "hand_closes": ("1e-2",), "slide": ("1e-2", "3e-3"), "pile_rests": ("1e-2", "3e-3"),
          "ball_hits_spiral": ("1e-2", "3e-3"), "plate_breaks": ("1e-2", "3e-3"), "shell_dents": ("1e-2", "3e-3", "1e-3"), "chain": ("1e-2", "3e-3", "1e-3"),
          "cradle": ("1e-2", "3e-3", "1e-3"), "spiral_uncoils": ("1e-2", "3e-3", "1e-3")}
QUICK_SCENES = ("chain", "cradle", "spiral_uncoils")
SCENE_S = 900.0
WHY_OFF = "`accuracy` is a rule made before the run, which nothing corrects while it runs"


def scenes(b):
    names = QUICK_SCENES if b.quick else tuple(SCENES)

    def one(name):
        options = [word for accuracy in SCENES[name] for word in ("--accuracy", accuracy)]
        return b.bench(f"scenes/{name}", *options, budget_s=SCENE_S)

    text = []
    with concurrent.futures.ThreadPoolExecutor(min(2, len(os.sched_getaffinity(0)))) as pool:
        for name, job in [(name, pool.submit(one, name)) for name in names]:
            try:
                text += job.result().splitlines()
            except Failed as fault:
                b.fault(str(fault))
    found = rows_of(text)
    b.scenes = found
    if found:
        b.draw("scenes", draw_accuracy(found))
    cells = []
    for rows in found.values():
        for row in rows:
            share = row["largest_error"] / row["accuracy"]
            cells.append([f'`{row["scene"]}`', f'{row["accuracy"]:g}', row["method"].split(":")[0], row["steps"], f'{row["cpu_s_per_s"]:.2g}', f'{row["largest_error"]:.1e}',
                          f'{share:.2g}', f'{row["impulse_error"]:.1e}', f'{row["compared_s"]:.2g} of {row["of_s"]:.2g}'])
            if share > 1.0:
                b.loss(f'`{row["scene"]}` at {row["accuracy"]:g} is off by {share:.2g} times that: {WHY_OFF}.')
    slow = [f'`{rows[0]["scene"]}` ({rows[-1]["cpu_s_per_s"]:.2g})' for rows in found.values() if rows[-1]["cpu_s_per_s"] > 1.0]
    if slow:
        b.loss(f'Slower than real time by one thread, in CPU seconds per simulated second at the finest accuracy here: {", ".join(slow)}. Their steps are those that friction or damping asks for.')
    return b.command_lines() + ([b.image("scenes", "CPU time of a simulated second over the error, for each scene"), ""] if found else []) + [
        "Errors are positions over the size of the object, the largest of all frames before chaos, against all stages 16 times finer; dashed lines lead to the accuracy asked.", ""] + table(
            ["scene", "accuracy", "method", "steps", "CPU s per s", "largest error", "of that asked", "error of the impulse", "compared [s]"], cells)


def skips(b):
    cells = []
    for name in QUICK_SCENES if b.quick else tuple(SCENES):
        try:
            row = b.rows(f"scenes/{name}", "--accuracy", "1e-2", "--skips", budget_s=240.0)[0]
        except Failed as fault:
            b.fault(str(fault))
            continue
        gain = row["cpu_s_per_s_without_skips"] / row["cpu_s_per_s"]
        cells.append([f"`{name}`", f'{row["cpu_s_per_s"]:.2g}', f'{row["cpu_s_per_s_without_skips"]:.2g}', f"{gain:.2f}", "yes" if row["states_equal"] else "NO"])
    gains = [float(cell[3]) for cell in cells]
    if gains and min(gains) < 1.1:
        b.loss(f"Skips save less than a tenth in {sum(gain < 1.1 for gain in gains)} of {len(gains)} scenes: their bodies touch all the time, or their steps are Newton iterations of the bonds, which no skip leaves out.")
    return b.command_lines() + ["Without skips every stage runs on everything. States are compared to the bit.", ""] + table(
        ["scene", "CPU s per s", "without skips", "ratio", "states equal"], cells)


def stability(b):
    core, contacts = b.plot_path("core_stability"), b.plot_path("contact_stability")
    steps = b.bench("core/stability", core).strip().splitlines()
    lines = ["Step, stiffness, compression and mass ratio of four systems of particles ([what the map shows](stability.md#particles-and-time-steps)): " + steps[-1] + ".", "",
             b.image("core_stability", "Map of stable runs of particles"), ""]
    if b.quick:
        lines.append("The quick form leaves out the thousand runs of bodies in contact.")
    else:
        shots = b.bench("collision/stability", "--seed", 2026, contacts).strip().splitlines()
        lines += ["Stiffness, mass ratio and speed of bodies in contact ([what the map shows](stability.md#contact)).", "", *shots[:-1],
                  b.image("contact_stability", "Map of contact runs"), "", shots[-1] + "."]
    return b.command_lines() + lines


def particles(b):
    most = 32000 if b.quick else 1000000
    series, by_pairs = {}, {}
    for group in ("laws", "lists"):
        for row in b.rows(f"core/{group}", most):
            name, count = row["name"].removeprefix("core/laws/").removeprefix("core/"), row["particles"]
            series.setdefault(name, []).append((count, row["us"] / 1e3))
            by_pairs.setdefault(name, []).append((count * row.get("pairs_per_particle", row.get("distances_per_particle")), row["us"] / 1e3))
    b.draw("particles", plots.log_log(series, "particles", "CPU ms of an evaluation"))
    slopes = {name: plots.exponent(curve[-2:]) for name, curve in by_pairs.items()}
    worst = max(slopes, key=slopes.get)
    if slopes[worst] > 1.03:
        b.loss(f"From {series[worst][-2][0]:,} to {series[worst][-1][0]:,} particles the time of `{worst}` grows with exponent {slopes[worst]:.2f} of the pairs: beyond the caches, of which other programs take their part, a particle's neighbours come from memory.")
    return b.command_lines() + [b.image("particles", "CPU time of one evaluation over the number of particles"), "",
                                "One evaluation of one pair law on particles of a disturbed lattice, and the making of its neighbour lists. A larger lattice has a smaller border, so pairs (of the lists: distances looked "
                                "at) grow faster than particles.", ""] + table(
        ["", "exponent over particles, all sizes", "over particles, the largest two", "over pairs, all sizes", "over pairs, the largest two"],
        [[f"`{name}`", *(f"{plots.exponent(curve):.2f}" for curve in (series[name], series[name][-2:], by_pairs[name], by_pairs[name][-2:]))] for name in series])


PILE_NAME = re.compile(r"collision/pile/balls=(\d+),threads=1")


def bodies(b):
    series = {"a step": [], "a contact": []}
    cells = []
    for row in b.rows("collision/pile", *((2, 10) if b.quick else (2, 10, 100, 1000, 10000))):
        found = PILE_NAME.fullmatch(row["name"])
        if not found:
            continue
        count = int(found[1])
        series["a step"].append((count, row["cpu_ms_step_min"]))
        series["a contact"].append((count, row["cpu_us_contact"] / 1e3))
        cells.append([f"{count:,}", f'{row["contacts"]:,}', f'{row["cpu_ms_step_min"]:.3g}', f'{row["cpu_us_contact"]:.2g}'])
    b.draw("bodies", plots.log_log(series, "bodies", "CPU ms"))
    if plots.exponent(series["a step"]) > 1.0:
        b.loss("A body in a dense pile costs more than one of few: balls of a settled pile have six to nine neighbours, two balls on the ground one each, so the exponent of a step exceeds 1. Time per contact is the fair measure.")
    return b.command_lines() + [b.image("bodies", "CPU time of a step over the number of bodies"), "", "Steps of settled balls in a bin, without sleeping, contact error 1e-2.", "",
                                f'Fitted exponents over the number of bodies: of a step {plots.exponent(series["a step"]):.2f}, of a contact {plots.exponent(series["a contact"]):.2f}; '
                                f'between the largest two {plots.exponent(series["a step"][-2:]):.2f} and {plots.exponent(series["a contact"][-2:]):.2f}.', ""] + table(
        ["balls", "contacts", "CPU ms of a step", "us of a contact"], cells)


def conservation(b):
    text = b.bench("collision/conservation", 4000 if b.quick else 20000, 10).strip().splitlines()
    return b.command_lines() + ["Ten balls collide inside a free elastic ring without loss, steps of 0.25 ms. The largest values of all steps, relative:", ""] + text


# Modules of Python and what they are called; their programs print rows of the jelly on stairs. The piles of both are one program.
PEERS = {"mujoco": ("MuJoCo", "jelly_mujoco.py", "4e-3,2e-3,1e-3,5e-4"), "pydrake": ("Drake", "jelly_drake.py", "4e-3,2e-3,1e-3")}


def peers(b):
    here = [module for module in PEERS if installed(b, module)]
    lines = [f"Left out: {PEERS[module][0]} did not install here." for module in PEERS if module not in here]
    if not here:
        return lines
    jelly = [row for module in here for row in peer_rows(b, PEERS[module][1], "--seconds", "0.6" if b.quick else "2", "--steps", "2e-3,1e-3" if b.quick else PEERS[module][2])]
    scenes = {"jelly": jelly}
    if len(here) == len(PEERS) and not b.quick:
        scenes["pile_rests"] = peer_rows(b, "pile_peers.py", b.supple, "--steps", "4e-3,2e-3,1e-3,5e-4")
    cells = []
    for scene, theirs in scenes.items():
        ours = [] if b.quick else b.scenes.get(scene) or b.rows(f"scenes/{scene}", "--accuracy", "1e-2")
        series = {}
        for row in [*theirs, *({"program": "supple", "finite": True, **row} for row in ours)]:
            if row["finite"]:
                series.setdefault(row["program"], []).append((row["largest_error"], row["cpu_s_per_s"]))
        b.draw(f"peers_{scene}", plots.log_log({name: curve for name, curve in series.items() if all(error > 0 for error, _ in curve)},
                                               "largest error of positions before chaos, of the size of the body", "CPU s per simulated s"))
        cells += [[f"`{scene}`", row["program"], f'{1e3 * row["step_s"]:.3g} ms', f'{row["cpu_s_per_s"]:.2g}', f'{row["largest_error"]:.1e}', f'{row["compared_s"]:.2g}'] for row in theirs]
        cells += [[f"`{scene}`", "supple", f'accuracy {row["accuracy"]:g}', f'{row["cpu_s_per_s"]:.2g}', f'{row["largest_error"]:.1e}', f'{row["compared_s"]:.2g}'] for row in ours]
        say_slower(b, scene, theirs, ours)
    return b.command_lines() + [b.image(f"peers_{scene}", f"CPU time over the error of `{scene}`") for scene in scenes] + [
        "", "`jelly`: a cube of 4 x 4 x 4 particles falls down stairs for 2 s, with the same geometry, mass, friction and Young's modulus (that of the bonds, in closed form). MuJoCo collides nodes as balls of 0.024 m, "
        "Drake the faces of tetrahedra between the nodes, supple the smooth surface. `pile_rests`: a hundred balls, rigid with a soft contact in both other programs. Each program is compared with itself at 16 times "
        "finer steps, up to the first frame that chaos reaches.", "", *lines, ""] + table(["scene", "program", "step", "CPU s per s", "largest error", "compared [s]"], cells)


def installed(b, module):
    try:
        b.call([b.peers, "-c", f"import {module}"], f"python -c 'import {module}'")
    except (Failed, OSError):
        return False
    finally:
        b.commands.pop()
    return True


def peer_rows(b, script, *options):
    shown = ["supple" if word == b.supple else str(word) for word in options]
    text = b.call([b.peers, b.root / "tests/benchmarks/peers" / script, *options], f"python tests/benchmarks/peers/{script} {' '.join(shown)}")
    return [{"finite": True, **json.loads(line)} for line in text.splitlines() if line.startswith("{")]


def say_slower(b, scene, theirs, ours):
    fits = [row for row in theirs if row["finite"] and row["largest_error"] <= 1e-2]
    if not ours or not fits:
        return
    best = min(fits, key=lambda row: row["cpu_s_per_s"])
    if best["cpu_s_per_s"] >= ours[0]["cpu_s_per_s"]:
        return
    steps = ours[0]["steps"] / (24 * ours[0]["of_s"])
    b.loss(f'`{scene}` takes {ours[0]["cpu_s_per_s"] / best["cpu_s_per_s"]:.1f} times the CPU time of {best["program"]} at an error of at most 1e-2. Contact is {100 * ours[0]["contact_share"]:.0f} % of it, in {steps:.0f} steps a frame. '
           "The particles of supple have six unknowns each, nodes of MuJoCo and Drake three.")


KNOWN_LOSSES = (
    "Other programs were measured once, by hand: [accuracy and speed](accuracy_and_speed.md) has the tables of LAMMPS, VTK, OpenVDB, contacts of Drake, Mitsuba and Cycles with their commands. LAMMPS is faster in a melt (1 to 0.9) "
    "where it does not check its neighbour lists.",
    "An implicit step costs about ten explicit ones where bodies touch, as contact, friction and bonds are solved together by Newton's method. It pays where friction or damping acts.",
)

ALL = (
    Part("integrators", "Time integration", 180.0, integrators),
    Part("contact", "Contact surface", 360.0, contact),
    Part("queries", "Contact queries in random poses", 180.0, queries),
    Part("meshes", "Surface meshes", 240.0, meshes),
    Part("pictures", "Pictures", 180.0, pictures),
    Part("scenes", "Whole scenes", 1500.0, scenes),
    Part("skips", "Skips on and off", 420.0, skips),
    Part("stability", "Stability", 1200.0, stability),
    Part("particles", "Scaling with particles", 300.0, particles),
    Part("bodies", "Scaling with bodies", 420.0, bodies),
    Part("conservation", "Conservation", 120.0, conservation),
    Part("peers", "Scenes beside MuJoCo and Drake", 900.0, peers),
)
