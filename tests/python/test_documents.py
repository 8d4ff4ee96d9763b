import contextlib
import io
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import supple
from support import SOURCE, TOOL, run_tool


def output_of(example, page):
    """What an example prints that is run in the source folder."""
    printed = io.StringIO()
    here = os.getcwd()
    os.chdir(SOURCE)
    try:
        with contextlib.redirect_stdout(printed):
            exec(compile(example, page, "exec"), {})
    finally:
        os.chdir(here)
    return printed.getvalue()


class EmbeddingPage(unittest.TestCase):
    @unittest.skipUnless(TOOL, "the command line tool is not built")
    def test_has_an_example_that_gives_what_the_tool_gives(self):
        example = re.search(r"```python\n(.*?)```", (SOURCE / "docs/embedding.md").read_text(), re.DOTALL).group(1)
        self.assertLessEqual(len(example.splitlines()), 12)
        printed = output_of(example, "docs/embedding.md")
        result = run_tool("contacts/two_balls", "--set", "objects.left.particles.mass=0.3")
        self.assertEqual(printed.split()[-1], result["state_hash"])

    def test_has_the_program_of_an_example(self):
        programs = re.findall(r"```cpp\n(.*?)```", (SOURCE / "docs/embedding.md").read_text(), re.DOTALL)
        example = (SOURCE / "examples/cpp/contact_of_two.cpp").read_text()
        self.assertEqual(programs[1], example[example.index("#include"):])
        self.assertLessEqual(programs[1].split("int main() {\n")[1].count("\n"), 10)


class PythonPage(unittest.TestCase):
    def test_has_examples_that_run(self):
        examples = re.findall(r"```python\n(.*?)```", (SOURCE / "docs/python.md").read_text(), re.DOTALL)
        self.assertEqual(len(examples), 6)
        for example in examples:
            self.assertTrue(output_of(example, "docs/python.md") or "assert" in example)


class TutorialPage(unittest.TestCase):
    @unittest.skipUnless(TOOL, "the command line tool is not built")
    def test_works_as_written(self):
        """Its commands and its program, one after the other; pictures are smaller than there."""
        text = (SOURCE / "docs/tutorial.md").read_text()
        self.assertIn("size: [640, 360]", text)
        text = text.replace("size: [640, 360]", "size: [96, 54]")
        steps = re.findall(r"```(sh|python)\n(.*?)```", text, re.DOTALL)
        self.assertEqual([kind for kind, _ in steps], ["sh"] * 5 + ["python"])
        with tempfile.TemporaryDirectory() as folder:
            path = os.pathsep.join([str(pathlib.Path(TOOL).parent), os.environ["PATH"]])
            for kind, step in steps:
                command = ["bash", "-euc", step] if kind == "sh" else [sys.executable, "-B", "-c", step]
                done = subprocess.run(command, cwd=folder, env=os.environ | {"PATH": path}, capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, f"{step}\n{done.stdout}{done.stderr}")
            out = pathlib.Path(folder) / "out/drop"
            for name in ("drop_view.html", "drop_sheet.png", "drop.mp4" if shutil.which("ffmpeg") else "result.json"):
                self.assertTrue((out / name).is_file(), name)


class Help(unittest.TestCase):
    def test_has_a_sentence_for_everything(self):
        for name in dir(supple):
            thing = getattr(supple, name)
            if name.startswith("_") or not callable(thing):
                continue
            self.assertTrue(thing.__doc__, name)
            if not isinstance(thing, type):
                continue
            for member, value in vars(thing).items():
                if not member.startswith("_"):
                    self.assertTrue(value.__doc__, f"{name}.{member}")


if __name__ == "__main__":
    unittest.main()
