"""Input that is refused with a sentence."""

import pytest

from evfem.errors import InputError


def refuses(sentence, call, *arguments, **more):
    """A call is refused in words that match; the error."""
    with pytest.raises(InputError, match=sentence) as refused:
        call(*arguments, **more)
    return refused.value
