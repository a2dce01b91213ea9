"""The line at the head of what benches print, by made_with.sh."""

import pathlib
import subprocess


def say(program=None):
    """Prints version and commit; of a program its own version."""
    script = pathlib.Path(__file__).with_name("made_with.sh")
    print(subprocess.run([script, *([program] if program else [])], check=True, capture_output=True, text=True).stdout, end="", flush=True)
