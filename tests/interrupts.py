"""What tests of Ctrl-C need of the processes that they start."""

import signal


def obey_interrupts():
    """Undo what a shell does to programs that it runs in the background: they ignore Ctrl-C, and all they start too."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
