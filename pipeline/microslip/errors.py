"""How things go wrong: the two exceptions the command line turns into one sentence and an exit code."""


class UserError(Exception):
    """A mistake in the input. Its text is one sentence naming file, key, what is wrong and what to do."""


class NotConverged(Exception):
    """A solve or a check that did not succeed although the input is well formed (exit code 1)."""
