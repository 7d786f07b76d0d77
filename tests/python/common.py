"""What the tests of the module share: the robots, the command, a folder of one's own."""
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

import plumbline

ROBOTS = pathlib.Path(os.environ["PLUMBLINE_SOURCE"], "robots")
PLUMB = pathlib.Path(os.environ["PLUMBLINE_BUILD"], "bin/plumb")


def robot(name="pendulum"):
    return plumbline.load_robot(ROBOTS / name)


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

    def others_run_during(self, call, *arguments, **named):
        """Another thread runs before the call is over. Nobody takes the GIL away here: the call has to give it."""
        said, interval = [], sys.getswitchinterval()
        thread = threading.Thread(target=lambda: said.append(call(*arguments, **named)))
        sys.setswitchinterval(1000)
        try:
            thread.start()
            self.assertEqual(said, [])
        finally:
            sys.setswitchinterval(interval)
            thread.join()
        self.assertEqual(len(said), 1)

    def can_be_interrupted(self, call, *arguments, **named):
        """A signal's handler is run before the call is over, and what it raises ends the call: at the third signal, as all that
        come during a call that looks for none are one."""
        signals = []

        def count(*_):
            signals.append(1)
            if len(signals) == 3:
                raise KeyboardInterrupt
        self.addCleanup(signal.signal, signal.SIGALRM, signal.signal(signal.SIGALRM, count))
        signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
        try:
            with self.assertRaises(KeyboardInterrupt):
                call(*arguments, **named)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
