#!/usr/bin/env python3
"""Pages of the documentation site: docs/, README.md, the examples, and a reference of the Python package.

    docs_pages.py FOLDER    with `supple` on PYTHONPATH
"""
import inspect
import pathlib
import re
import shutil
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]


def outside_links_as_text(text, page):
    """Links to files of the source tree that the site does not have become their paths."""
    def plain(match):
        label, target = match.groups()
        if re.match(r"[a-z]+:|#", target):
            return match.group(0)
        path = (page.parent / target.split("#")[0]).resolve()
        inside = path.is_relative_to(ROOT / "docs") and path.is_file()
        return match.group(0) if inside else f"{label} (`{path.relative_to(ROOT)}`)"
    return re.sub(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)", plain, text)


def home():
    text = outside_links_as_text((ROOT / "README.md").read_text(), ROOT / "README.md")
    return re.sub(r"\(docs/([^)]*)\)", r"(\1)", text)


def examples():
    text = "# Examples\n\nPrograms in `examples/`; tests run them.\n"
    for language, ending in (("Python", "py"), ("C++", "cpp")):
        text += f"\n## {language}\n"
        for path in sorted((ROOT / "examples").rglob(f"*.{ending}")):
            text += f"\n### {path.name}\n\n```{ending}\n{path.read_text().rstrip()}\n```\n"
    return text


def described(thing, name):
    lines = inspect.cleandoc(thing.__doc__ or "").splitlines()
    signature = ""
    if lines and re.match(rf"{re.escape(name)}\(.*\)( -> .*)?$", lines[0]):  # which the binding writes
        signature, lines = lines[0], lines[1:]
    elif inspect.isfunction(thing):
        signature = name + str(inspect.signature(thing))
    signature = re.sub(r"\bself: [^,)]*(, )?", "", signature)
    body = "\n".join(lines).strip()
    return (f"```py\n{signature}\n```\n\n" if signature else "") + (f"```text\n{body}\n```\n" if "\n" in body else f"{body}\n")


def python_reference():
    import supple
    import supple.notebook
    import supple.usd

    text = "# Python reference\n\nUnits are SI; vectors are rows of arrays. [Python](python.md) shows experiments.\n"
    for module in (supple, supple.notebook, supple.usd):
        text += f"\n## {module.__name__}\n"
        for name in module.__all__:
            thing = getattr(module, name)
            if inspect.ismodule(thing):
                continue
            text += f"\n### {name}\n\n{described(thing, name)}"
            for member, value in sorted(vars(thing).items()) if isinstance(thing, type) else ():
                if member == "__init__" and value.__doc__ and "Initialize self" not in value.__doc__:
                    text += f"\n**{name}(...)**\n\n{described(value, member)}"
                elif not member.startswith("_") and value.__doc__:
                    text += f"\n**{member}**\n\n{described(value, member)}"
    return text


def main():
    out = pathlib.Path(sys.argv[1])
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(ROOT / "docs", out)
    for page in out.glob("*.md"):
        page.write_text(outside_links_as_text(page.read_text(), ROOT / "docs" / page.name))
    (out / "index.md").write_text(home())
    (out / "examples.md").write_text(examples())
    (out / "python_reference.md").write_text(python_reference())
    (out / "cpp.md").write_text("# C++ reference\n\nAll headers, classes and functions: <a href=\"cpp/index.html\">C++ reference</a>. "
                                "[Embedding](embedding.md) shows programs, [architecture](architecture.md) the modules.\n")


if __name__ == "__main__":
    main()
