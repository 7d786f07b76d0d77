"""What the tests of the module share: the robots, the command, a folder of one's own."""
import os
import pathlib
import subprocess
import tempfile
import unittest

import plumbline

ROBOTS = pathlib.Path(os.environ["PLUMBLINE_SOURCE"], "robots")
PLUMB = pathlib.Path(os.environ["PLUMBLINE_BUILD"], "bin/plumb")


def robot(name="pendulum"):
    return plumbline.load_robot(str(ROBOTS / name))


class Test(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def plumb(self, *arguments):
        """What the command prints."""
        done = subprocess.run([PLUMB, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def refused(self, words, call, *arguments, error=ValueError, **named):
        """The call raises that error, with these words in its message."""
        with self.assertRaises(error) as raised:
            call(*arguments, **named)
        self.assertIn(words, str(raised.exception))
