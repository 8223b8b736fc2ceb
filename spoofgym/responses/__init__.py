"""What follows an alarm."""

from __future__ import annotations

from collections.abc import Callable

from spoofgym.responses.base import Response
from spoofgym.responses.exclude import AlwaysUse, Exclude
from spoofgym.specification import build

RESPONSES: dict[str, Callable[..., Response]] = {"always-use": AlwaysUse, "exclude": Exclude}


def make_response(response: str | Response) -> Response:
    """The response that a specification names; an object is returned as it is.

    Raises:
        ValueError: unknown name or option; the message lists the valid ones.
    """
    return response if isinstance(response, Response) else build(response, RESPONSES, "response")
