"""Runs the parts one after the other and writes the page. Called by scripts/evidence.sh."""
import argparse
import os
import pathlib
import shutil
import sys
import time

from . import parts
from .bench import Bench, Failed

ROOT = pathlib.Path(__file__).resolve().parents[2]
ALL_S = 3600.0  # wall time of all parts


def measure(bench, chosen):
    """{part: (lines of the page, seconds)}; failures are lines."""
    out = {}
    end = time.monotonic() + ALL_S
    for part in chosen:
        begin = time.monotonic()
        bench.begin(part.name, min(part.budget_s, end - begin))
        try:
            lines = part.run(bench)
        except Failed as fault:
            bench.fault(str(fault))
            lines = []
        except (KeyError, ValueError, IndexError, ZeroDivisionError, OSError) as fault:  # rows that are not as expected
            bench.fault(f"its output was not understood: {type(fault).__name__}: {fault}")
            lines = []
        seconds = time.monotonic() - begin
        out[part.name] = (lines, seconds)
        print(f"{part.name:14} {seconds:6.0f} s  {'; '.join(bench.faults[part.name]) or 'done'}", flush=True)
    return out


def page(bench, chosen, results):
    lines = ["# Evidence", "", "Written by `scripts/evidence.sh`, with every figure and plot on it." +
             (" This is its quick form (`--quick`): small sizes, which show that it works." if bench.quick else ""), ""]
    lines += bench.machine_lines()
    lines += ["", "| part | result | time [s] |", "|---|---|---|"]
    for part in chosen:
        told = "; ".join(bench.faults[part.name])
        lines.append(f"| {part.title} | {'failed: ' + told if told else 'done'} | {results[part.name][1]:.0f} |")
    for part in chosen:
        lines += ["", f"## {part.title}", ""] + results[part.name][0]
        lines += [f"Failed: {told}." for told in bench.faults[part.name]]
    lines += ["", "## Where we lose", ""] + [f"- {line}" for line in bench.losses + list(parts.KNOWN_LOSSES)]
    return "\n".join(lines) + "\n"


def publish(bench, text, target):
    """Page and plots under their final names, the page last, each complete when it appears."""
    images = target.parent / "images"
    images.mkdir(parents=True, exist_ok=True)
    for plot in filter(pathlib.Path.exists, bench.plots):
        hidden = images / f".{plot.name}.{os.getpid()}"
        shutil.copyfile(plot, hidden)
        hidden.replace(images / plot.name)
    hidden = target.with_name(f".{target.name}.{os.getpid()}")
    hidden.write_text(text, encoding="utf-8")
    hidden.replace(target)


def main():
    names = [part.name for part in parts.ALL]
    parser = argparse.ArgumentParser(prog="scripts/evidence.sh")
    parser.add_argument("--supple", type=pathlib.Path, required=True)
    parser.add_argument("--peers", type=pathlib.Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--page", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "build/evidence", help="folder of outputs and of pages that are drafts")
    parser.add_argument("parts", nargs="*", metavar="PART")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.parts if name not in names]
    if unknown:
        parser.error(f"expected parts of {', '.join(names)}, found {unknown[0]!r}")
    chosen = [part for part in parts.ALL if not arguments.parts or part.name in arguments.parts]
    draft = arguments.quick or len(chosen) < len(parts.ALL)
    target = (arguments.page or (arguments.work / "evidence.md" if draft else ROOT / "docs/evidence.md")).resolve()
    bench = Bench(arguments.supple.resolve(), arguments.peers, arguments.work.resolve() / "work", ROOT, arguments.quick)
    results = measure(bench, chosen)
    target.parent.mkdir(parents=True, exist_ok=True)
    publish(bench, page(bench, chosen, results), target)
    print(target)
    return 1 if any(bench.faults.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
