"""What every refusal is: one sentence, which names a key and a remedy, and exit code 2 from the command line."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from microslip.cli import main
from microslip.errors import UserError


def refused(words: str | tuple[str, ...], call: Callable[..., object], *given: object, **named: object) -> str:
    """The one sentence in which a call is refused; all these words stand in it."""
    with pytest.raises(UserError) as caught:
        call(*given, **named)
    said = str(caught.value)
    assert "\n" not in said, said
    return holding(said, (words,) if isinstance(words, str) else words)


def refused_command(line: Sequence[str], capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The sentence in which a command line is refused with exit code 2, or one for each mistake of a file; all these
    words stand there. What was printed before does not count."""
    capsys.readouterr()
    code = main([*line])
    shown = capsys.readouterr()
    assert code == 2 and "Traceback" not in shown.out + shown.err, shown.err
    return holding(shown.err[shown.err.index("error: ") :].strip(), words)


def holding(said: str, words: Sequence[str]) -> str:
    for part in words:
        assert part in said, said
    return said
