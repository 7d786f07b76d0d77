"""Docstrings are there and their examples true; the stubs have what the compiled part has."""
import ast
import contextlib
import doctest
import inspect
import os
import pathlib
import re
import unittest

import numpy
import plumbline
from plumbline import _native, vector_env

SOURCE = pathlib.Path(os.environ["PLUMBLINE_SOURCE"])


def documented():
    """Everything public: (name, object)."""
    for name in plumbline.__all__:
        thing = getattr(plumbline, name)
        yield name, thing
        if inspect.isclass(thing):
            for member, value in vars(thing).items():
                if not member.startswith("_") and member != "unwrapped":
                    yield f"{name}.{member}", value


def stubs():
    """name -> names of its arguments; None of a property."""
    found = {}
    for node in ast.parse((SOURCE / "python/plumbline/_native.pyi").read_text()).body:
        for function in [node] if isinstance(node, ast.FunctionDef) else getattr(node, "body", []):
            if not isinstance(function, ast.FunctionDef):
                continue
            name = function.name if function is node else f"{node.name}.{function.name}"
            arguments = [argument.arg for argument in function.args.args + function.args.kwonlyargs]
            found[name] = None if function.decorator_list else arguments
    return found


def compiled():
    """The same of the module."""
    found = {}

    def add(name, thing):
        if isinstance(thing, property):
            found[name] = None
        elif thing.__doc__ and (signature := re.match(r"\w+\((.*)\) ->", thing.__doc__)):
            found[name] = re.findall(r"(?:^|, )(\w+)(?=:|,|$)", re.sub(r"\[[^\[\]]*\]", "", signature[1]))

    for name, thing in vars(_native).items():
        if inspect.isclass(thing):
            for member, value in vars(thing).items():
                if not member.startswith("_") or member in ("__init__", "__call__"):
                    add(f"{name}.{member}", value)
        elif callable(thing):
            add(name, thing)
    return found


class DocumentsTest(unittest.TestCase):
    def test_everything_public_has_a_docstring(self):
        for name, thing in documented():
            if isinstance(thing, (property, staticmethod)) or callable(thing):
                self.assertTrue(thing.__doc__, name)

    def test_examples_are_true(self):
        os.chdir(SOURCE)
        examples = 0
        runner = doctest.DocTestRunner()
        for name, thing in documented():
            names = {"plumbline": plumbline, "numpy": numpy} | {n: getattr(vector_env, n) for n in ("Box", "VectorEnv")}
            test = doctest.DocTestParser().get_doctest(thing.__doc__ or "", names, name, None, None)
            examples += len(test.examples)
            self.assertEqual(runner.run(test).failed, 0, name)
        self.assertGreater(examples, 12)

    def test_examples_of_the_page_are_true(self):
        os.chdir(SOURCE)
        text = re.sub(r"^```.*$", "", (SOURCE / "docs/python.md").read_text(), flags=re.M)  # an example ends with a blank line
        test = doctest.DocTestParser().get_doctest(text, {}, "docs/python.md", None, None)
        self.assertGreater(len(test.examples), 15)
        self.assertEqual(doctest.DocTestRunner().run(test).failed, 0)

    def test_no_robot_is_a_type_error(self):
        pendulum = plumbline.load_robot(SOURCE / "robots/pendulum")
        others = {"count": 1, "file": "none", "motions": [], "t": [0], "q": [[0]], "v": [[0]], "u": [[0]]}
        for name, arguments in compiled().items():
            if "robot" in (arguments or []):
                call = getattr(_native, name.removesuffix(".__init__"))
                named = {argument: others[argument] for argument in arguments if argument in others}
                with contextlib.suppress(ValueError, RuntimeError):
                    call(robot=pendulum, **named)  # of a type that it takes, all of them
                with self.assertRaises(TypeError, msg=name):
                    call(robot=None, **named)

    def test_stubs_have_what_the_module_has(self):
        self.assertEqual(stubs(), compiled())


if __name__ == "__main__":
    unittest.main()
