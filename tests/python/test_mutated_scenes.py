"""Scenes with numbers, words, lines and letters exchanged at random are read, or refused with a place: nothing else happens."""
import random
import re
import unittest

import supple
from support import LIBRARY

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
WORD = re.compile(r"\b[a-z_]+\b")
VALUES = ["0", "-1", "1e-300", "1e300", "1e9", ".nan", ".inf", "-0.0", "1e-9", "2147483648", "3", "1000", "abc", "[]", "{}", "~",
          "true", "[1, 2]", "1e6", "-1e-3", "18446744073709551616"]


def replaced(text, match, value):
    return text[:match.start()] + value + text[match.end():]


def mutated(text, pick):
    for _ in range(pick.choice([1, 1, 2, 3])):
        kind = pick.random()
        if kind < 0.7 and (numbers := list(NUMBER.finditer(text))):
            text = replaced(text, pick.choice(numbers), pick.choice(VALUES))
        elif kind < 0.8:
            lines = text.split("\n")
            del lines[pick.randrange(len(lines))]
            text = "\n".join(lines)
        elif kind < 0.9:
            words = list(WORD.finditer(text))
            text = replaced(text, pick.choice(words), pick.choice(words).group())
        else:
            at = pick.randrange(len(text))
            text = text[:at] + pick.choice("{}[]:,-'\"#&*!|>%@` \t\n\0é") + text[at + 1:]
    return text


class MutatedScenes(unittest.TestCase):
    def test_are_read_or_refused_with_a_place(self):
        scenes = {path: path.read_text() for path in sorted(LIBRARY.rglob("*.yaml"))}
        read = refused = 0
        for seed in range(1500):
            pick = random.Random(seed)
            path = pick.choice(list(scenes))
            with self.subTest(seed=seed, scene=path.name):
                try:
                    supple.parse_scene(mutated(scenes[path], pick), name=path.name)
                    read += 1
                except supple.Error as error:
                    refused += 1
                    self.assertTrue(error.faults)
                    for fault in error.faults:
                        self.assertTrue(fault.expected, fault)
                        self.assertTrue(fault.place.startswith(path.name), fault)
        self.assertGreater(read, 200)
        self.assertGreater(refused, 200)

    def test_of_two_balls_make_a_simulation_or_are_refused(self):
        text = (LIBRARY / "contacts/two_balls.yaml").read_text()
        made = 0
        for seed in range(300):
            with self.subTest(seed=seed):
                try:
                    simulation = supple.Simulation(supple.parse_scene(mutated(text, random.Random(seed)), name="two_balls.yaml"))
                    simulation.step()
                    made += 1
                except supple.Error as error:
                    self.assertTrue(error.faults)
        self.assertGreater(made, 30)


if __name__ == "__main__":
    unittest.main()
