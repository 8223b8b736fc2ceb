"""The learned spoofers that a command line names."""

from __future__ import annotations

from collections.abc import Sequence

from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.policies.published import policy_folder


def spoofers(given: Sequence[str], shadow: str | None) -> list[LearnedSpoofer]:
    """The learned spoofers that ``--attacker`` names, with the shadow filter that ``--shadow`` names.

    Raises:
        ValueError: a policy that is unknown or no spoofer, or a shadow for nobody.
        FileNotFoundError: a folder that holds no policy.
    """
    if shadow is not None and not given:
        raise ValueError("--shadow replaces the shadow filter of learned spoofers: it goes with --attacker")
    policies = [LearnedSpoofer.load(policy_folder(text)) for text in given]
    return policies if shadow is None else [policy.with_shadow(shadow) for policy in policies]
