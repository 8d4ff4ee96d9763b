#!/usr/bin/env python3
"""What `supple run --dry-run` forecasts and what `supple run --preview` costs, beside the whole run: docs/forecasts.md.

    scripts/forecasts.py [--tool SUPPLE] [--work DIR] [--page FILE] [SCENE...]

Without scenes it takes those of the library whose run needs minutes at most. Times are CPU times of processes, so other work on the machine changes ratios
little. Rows are kept in DIR/rows.json; scenes that are named are measured again, and the page is made of all rows.
"""
import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONG = {"pile_of_thousand", "shell_fine_dents", "spiral_uncoils_literal"}  # tens of minutes, or diverging
UNITS = {"B": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9, "s": 1.0, "min": 60.0, "h": 3600.0}
QUANTITIES = ("cpu_s", "memory", "disk", "particles", "steps", "triangles")


def measured(command, log):
    """CPU seconds and largest memory [byte] of a command and its children. Raises RuntimeError where it fails."""
    with log.open("w") as output:
        process = subprocess.Popen([str(word) for word in command], stdout=output, stderr=subprocess.STDOUT)
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise RuntimeError(f"{command}: exit code {process.returncode}: {log.read_text()[-2000:]}")
    return usage.ru_utime + usage.ru_stime, 1024.0 * usage.ru_maxrss


def amounts(text):
    """All numbers with a unit in a line, in basic units."""
    return [float(number) * UNITS[unit] for number, unit in re.findall(r"([0-9.e+-]+) (kB|MB|GB|B|min|s|h)\b", text)]


def forecast_of(text):
    """The quantities of a dry run from what it prints."""
    lines = {line[:12].strip(): line[12:] for line in text.splitlines()}
    return {
        "cpu_s": sum(amounts(lines["CPU time"])),
        "memory": amounts(lines["memory"])[0],
        "disk": amounts(lines["disk"])[0],
        "particles": float(lines["particles"]),
        "steps": float(lines["steps"]),
        "triangles": float(lines["triangles"].split()[0]),
    }


def bytes_in(folder):
    return float(sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()))


def triangles_of(tool, scene, folder, frames):
    """Triangles per frame, mean of 25 frames or all, from PLY files that the tool exports."""
    chosen = sorted({1 + round(k * (frames - 1) / 24) for k in range(25)})
    measured([tool, "export", scene, "--out", folder, "--mesh", "ply", "--frames", ",".join(map(str, chosen)), "--progress", "none"], folder.with_suffix(".export.log"))
    count = 0
    for file in folder.rglob("*.ply"):
        header = file.read_bytes()[:4096].split(b"end_header")[0]
        count += int(re.search(rb"element face (\d+)", header)[1])
    return count / len(chosen)


def preview_seconds(tool, scene, work):
    folder = work / f"{scene}_preview"
    shutil.rmtree(folder, ignore_errors=True)
    cpu, _ = measured([tool, "run", scene, "--preview", "--out", folder, "--progress", "none"], work / f"{scene}.log")
    shutil.rmtree(folder)
    return cpu


def measure(tool, scene, work):
    whole = work / scene
    shutil.rmtree(whole, ignore_errors=True)
    log = work / f"{scene}.log"
    quiet = ["--progress", "none", "--at-once", "1"]
    cpu, memory = measured([tool, "run", scene, "--out", whole, *quiet], log)
    disk = bytes_in(whole)
    result = json.loads((whole / "result.json").read_text())
    preview_cpu = preview_seconds(tool, scene, work)
    dry_cpu, _ = measured([tool, "run", scene, "--dry-run", "--threads", "1"], log)
    row = {
        "scene": scene,
        "run": {"cpu_s": cpu, "memory": memory, "disk": disk, "particles": float(sum(o["particles"] for o in result["objects"].values())), "steps": float(result["steps"]),
                "triangles": triangles_of(tool, scene, whole, result["frames"])},
        "forecast": forecast_of(log.read_text()),
        "dry_cpu_s": dry_cpu,
        "preview_cpu_s": preview_cpu,
        "frames": result["frames"],
        "pictures": any((whole / "frames").glob("*.png")),
    }
    shutil.rmtree(whole)
    return row


def page(rows):
    out = ["# Forecasts and previews", "",
           "`scripts/forecasts.py` measures this table: CPU time of whole runs of the library, what `supple run --dry-run` says beforehand as a ratio to the run,",
           "and CPU times of the dry run and of `supple run --preview` over that of the run. Both the run and the dry run draw one frame at a time.", "",
           "A preview saves most where pictures are most of the run. It draws fewer frames, makes no estimates of errors and no contact sheet, finds contacts by a quarter of the samples and leaves",
           "bodies whole where they touch. What limits it: steps that a scene fixes or that friction needs stay as they are, and long thin contacts need thousands of points whatever error is asked",
           "(`ball_in_ring`: four thousand on a thin ring). Stills (one frame) have no film; their",
           "previews take as long as the start of the program with OpenGL: 0.05 s for the libraries to load, 0.1 s for the context, the shaders and the picture. Where a scene draws no",
           "pictures, its preview does, and is compared with nothing.", "",
           "| scene | frames | run, CPU s | " + " | ".join(("CPU", "memory", "disk", "particles", "steps", "triangles")) + " | dry run | preview, CPU s | preview |",
           "|---|---|---|" + "---|" * 9]
    for row in sorted(rows.values(), key=lambda row: row["scene"]):
        run = row["run"]
        ratios = [f"{row['forecast'][q] / run[q]:.2f}" if run[q] > 0 else "-" for q in QUANTITIES]
        out.append(f"| `{row['scene']}` | {row['frames']} | {run['cpu_s']:.1f} | " + " | ".join(ratios) +
                   f" | {row['dry_cpu_s'] / run['cpu_s']:.2f} | {row['preview_cpu_s']:.2f} | " + (f"{row['preview_cpu_s'] / run['cpu_s']:.3f} |" if row["pictures"] else "- |"))
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tool", type=Path, default=ROOT / "build/release/bin/supple")
    parser.add_argument("--work", type=Path, default=ROOT / "build/forecasts")
    parser.add_argument("--page", type=Path, default=ROOT / "docs/forecasts.md")
    parser.add_argument("--previews", action="store_true", help="measure the previews of rows again, and nothing else")
    parser.add_argument("scenes", nargs="*")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    kept = options.work / "rows.json"
    rows = json.loads(kept.read_text()) if kept.exists() else {}
    scenes = options.scenes or sorted({file.stem for file in (ROOT / "scenes/library").rglob("*.yaml")} - LONG)
    for scene in scenes:
        try:
            if options.previews:
                rows[scene]["preview_cpu_s"] = preview_seconds(options.tool, scene, options.work)
            else:
                rows[scene] = measure(options.tool, scene, options.work)
        except RuntimeError as error:
            print(error, file=sys.stderr)
            continue
        kept.write_text(json.dumps(rows, indent=1))
        print(page({scene: rows[scene]}).splitlines()[-1], flush=True)
    options.page.write_text(page(rows))


if __name__ == "__main__":
    main()
