import contextlib
import io
import os
import re
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


class PythonPage(unittest.TestCase):
    def test_has_examples_that_run(self):
        examples = re.findall(r"```python\n(.*?)```", (SOURCE / "docs/python.md").read_text(), re.DOTALL)
        self.assertEqual(len(examples), 4)
        for example in examples:
            self.assertTrue(output_of(example, "docs/python.md") or "assert" in example)


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
