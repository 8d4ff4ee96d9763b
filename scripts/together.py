#!/usr/bin/env python3
"""Groups of source files and of test files that are compiled as one translation unit (MODULE/together.cmake).

Two files may share a group when neither contains, anywhere in its text, a name that is private to the other: in an anonymous namespace, a
static, an alias, a macro. So no name changes its meaning beside the other files of its group. An alias may be in both when it is the same; in tests aliases and
directives of namespaces need only not be the names of functions and types of the other file: what is ambiguous does not compile.

usage: scripts/together.py [--write] [MODULE ...]     all modules when none is named
Lists the groups that break this rule; exit code 1 if there are any. --write makes new groups of at most 60,000 characters.
"""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MODULES = ["core", "implicit", "collision", "render", "scenes", "tests/core", "tests/implicit", "tests/collision", "tests/render", "tests/scenes"]
LARGEST_GROUP = 60_000  # characters
# Files that cannot be in a group: vector code that includes itself, macros of a single file, OpenGL
# headers that exclude each other, and OpenVDB, which is large.
ALONE = re.compile(r"HWY_TARGET_INCLUDE|SUPPLE_VERSION|<GL/osmesa.h>|<EGL/egl.h>|<openvdb/", re.MULTILINE)
LARGE = re.compile(r"<nlohmann/json.hpp>")  # whose code is compiled once per group
# Fixed groups: they use the same namespaces, or have compile options of their own.
GIVEN = {
    "implicit": [["src/grid/surface_grid.cpp", "src/grid/grid_leaves.cpp", "src/grid/grid_updater.cpp", "src/grid/union_updater.cpp"]],
    "render": [["src/path/integrator.cpp", "src/path/details.cpp", "src/path/tracer.cpp", "src/path/paint.cpp"],
               ["src/path/geometry.cpp", "src/path/denoise.cpp"]],
}


def without_texts(source: str) -> str:
    source = re.sub(r'R"\((.*?)\)"', lambda m: '""' + "\n" * m.group(0).count("\n"), source, flags=re.DOTALL)
    return re.sub(r'"(\\.|[^"\\\n])*"', '""', source)


def own_names(source: str) -> tuple:
    """Private names of a file, from the lines that begin at the left margin, and its aliases: name -> what it stands for."""
    names, aliases, own = set(), {}, False
    for line in source.split("\n"):
        if re.match(r"\}\s*// namespace\s*$", line):
            own = False
        elif re.match(r"namespace \{", line):
            own = True
        line = re.sub(r"//.*", "", line).rstrip()
        alias = re.match(r"\s*#define\s+(\w+)|using\s+(?:[\w:]*::)?(\w+)\s*[;=]|namespace (\w+) = ", line)
        if alias:
            name = next(name for name in alias.groups() if name)
            if line.lstrip().startswith("#"):
                names.add(name)
            else:
                aliases[name] = line
            continue
        if not line or line[0] in " \t#}{)" or not (own or re.match(r"static |constexpr|const |inline constexpr", line)):
            continue
        kind = re.match(r"(?:template\s*<[^;{]*>\s*)?(?:struct|class|enum class|enum|union)\s+(?:alignas\([^)]*\)\s*)?(\w+)", line)
        if kind:
            names.add(kind.group(1))
            continue
        for found in re.finditer(r"(\w+)\s*(?=[(={;\[])", line):
            before = line[: found.start()].rstrip()
            if found.group(1)[0].isdigit() or found.group(1) in ("operator", "const"):
                continue
            if before and not before.endswith("::"):
                names.add(found.group(1))
            break
    return names, aliases


class File:
    def __init__(self, module: str, name: str):
        source = without_texts((ROOT / module / name).read_text())
        self.name, self.test = name, module.startswith("tests/")
        self.length = len(source)
        self.own, self.aliases = own_names(source)
        self.words = set(re.findall(r"(?<![.:\w])\w+", re.sub(r"//[^\n]*", "", source)))
        self.directives = set(re.findall(r"^using namespace ([\w:]+);", source, re.MULTILINE))

    def clash(self, other: "File") -> set:
        names = (self.own & other.words) | (other.own & self.words)
        for one, two in ((self, other), (other, self)):
            names |= {name for name, text in one.aliases.items() if name in (two.own if self.test else two.words) and two.aliases.get(name) != text}
        return names if self.test else names | (self.directives ^ other.directives)


def sources(module: str) -> list:
    """Files of the library, those that include the same large header one after the other."""
    if module.startswith("tests/"):
        return sorted(str(f.relative_to(ROOT / module)) for f in (ROOT / module).rglob("*_test.cpp"))
    folder = ROOT / module / "src"
    files = sorted(f for f in folder.rglob("*.cpp") if f.parent.name not in ("path", "fit"))  # compiled by options of their own
    files.sort(key=lambda f: not LARGE.search(f.read_text()))
    return [str(f.relative_to(ROOT / module)) for f in files]


def programs(module: str) -> list:
    """Files of the tool, which is a target of its own."""
    return [f"cli/{f.name}" for f in sorted((ROOT / module / "cli").glob("*.cpp")) if not f.name.startswith("fit_")]


def make_groups(module: str) -> list:
    given = GIVEN.get(module, [])
    return groups_of(module, sources(module), {name for group in given for name in group}) + groups_of(module, programs(module), set()) + given


def groups_of(module: str, names: list, taken: set) -> list:
    groups = []
    for name in names:
        if name in taken or ALONE.search((ROOT / module / name).read_text()):
            continue
        file = File(module, name)
        for group in groups:
            if sum(f.length for f in group) + file.length <= LARGEST_GROUP and not any(file.clash(f) for f in group):
                group.append(file)
                break
        else:
            groups.append([file])
    return [[f.name for f in group] for group in groups if len(group) > 1]


def read_groups(module: str) -> list:
    text = (ROOT / module / "together.cmake").read_text()
    return [group.split() for group in re.findall(r'"([^"]*)"', text)]


def write_groups(module: str, groups: list) -> None:
    lines = []
    for group in groups:
        line = '  "'
        for name in group:
            if len(line) + len(name) > 118:
                lines.append(line.rstrip())
                line = "   "
            line += name + " "
        lines.append(line.rstrip() + '"')
    (ROOT / module / "together.cmake").write_text("supple_together(\n" + "\n".join(lines) + ")\n")


def faults(module: str) -> list:
    out = []
    for group in read_groups(module):
        if group in GIVEN.get(module, []):
            continue
        absent = [name for name in group if not (ROOT / module / name).is_file()]
        out += [f"{module}/together.cmake: {name}: no such file" for name in absent]
        files = [File(module, name) for name in group if name not in absent]
        for i, file in enumerate(files):
            for other in files[i + 1:]:
                for name in sorted(file.clash(other)):
                    out.append(f"{module}/together.cmake: {file.name} and {other.name} both have the name '{name}', which one of them keeps "
                               "to itself: rename it, or run scripts/together.py --write")
    return out


def main(arguments: list) -> int:
    if any(a in ("-h", "--help") for a in arguments):
        print(__doc__)
        return 0
    modules = [a for a in arguments if a != "--write"] or MODULES
    unknown = [m for m in modules if m not in MODULES]
    if unknown:
        print(f"error: {unknown[0]}: expected one of {', '.join(MODULES)}", file=sys.stderr)
        return 2
    found = []
    for module in modules:
        if "--write" in arguments:
            write_groups(module, make_groups(module))
        found += faults(module)
    for fault in found:
        print(fault)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
