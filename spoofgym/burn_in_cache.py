"""Results of a scenario's methods, kept on the scenario itself."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

Method = TypeVar("Method", bound=Callable[..., Any])


def kept_by_burn_in(method: Method) -> Method:
    """Call a method of one argument, ``burn_in`` = 0, once for each value of it.

    The results lie in the object's own dictionary, as those of `functools.cached_property` do, and go with it.
    `functools.cache` would hold every object on which the method was called until the program ends.
    """
    name = f"_kept_{method.__qualname__}"

    @wraps(method)
    def kept(self: Any, burn_in: int = 0) -> Any:
        results = self.__dict__.setdefault(name, {})
        if burn_in not in results:
            results[burn_in] = method(self, burn_in)
        return results[burn_in]

    return cast(Method, kept)
