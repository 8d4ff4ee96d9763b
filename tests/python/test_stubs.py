"""The stubs name what is there, and with the same arguments."""
import ast
import inspect
import pathlib
import re
import unittest

import supple

STUBS = ast.parse((pathlib.Path(supple.__file__).parent / "__init__.pyi").read_text())
CLASSES = {node.name: node for node in STUBS.body if isinstance(node, ast.ClassDef)}
FUNCTIONS = {node.name: node for node in STUBS.body if isinstance(node, ast.FunctionDef)}


def public(names):
    return {name for name in names if not name.startswith("_")}


def members(node):
    named = {item.name: item for item in node.body if isinstance(item, ast.FunctionDef)}
    named.update({item.target.id: item for item in node.body if isinstance(item, ast.AnnAssign)})
    for base in node.bases:
        named.update(members(CLASSES[base.id]) if getattr(base, "id", None) in CLASSES else {})
    return named


def arguments(function):
    return [a.arg for a in function.args.args + function.args.kwonlyargs]


def documented_arguments(thing):
    """Those in the first line of the description, which the binding writes; of functions in Python those that they take."""
    if inspect.isfunction(thing):
        return list(inspect.signature(thing).parameters)
    inside = re.match(r"\w+\((.*)\) -> ", thing.__doc__.splitlines()[0]).group(1)
    return [name for name in re.findall(r"(?:^|, )(\w+)(?=:)", re.sub(r"\[[^\[\]]*\]", "", re.sub(r"\[[^\[\]]*\]", "", inside)))]


class Stubs(unittest.TestCase):
    def test_name_all_functions_and_classes(self):
        classes = {name for name in supple.__all__ if isinstance(getattr(supple, name), type)}
        self.assertEqual(public(CLASSES), classes)
        self.assertEqual(public(FUNCTIONS), set(supple.__all__) - classes)

    def test_have_the_members_of_classes(self):
        for name in set(CLASSES) & set(supple.__all__) - {"Error", "ContractViolation", "Fault"}:
            self.assertEqual(public(members(CLASSES[name])), public(vars(getattr(supple, name))), name)

    def test_have_the_arguments_of_calls(self):
        for name, node in FUNCTIONS.items():
            self.assertEqual(arguments(node), documented_arguments(getattr(supple, name)), name)
        for name in set(CLASSES) & set(supple.__all__) - {"Error", "ContractViolation", "Fault"}:
            for member, node in members(CLASSES[name]).items():
                value = getattr(getattr(supple, name), member)
                if member.startswith("_") or isinstance(value, property) or isinstance(node, ast.AnnAssign):
                    continue
                self.assertEqual(arguments(node), documented_arguments(value), f"{name}.{member}")


if __name__ == "__main__":
    unittest.main()
