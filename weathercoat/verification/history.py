"""What time cannot undo between two snapshots: film does not come back, hold again or heal."""

from __future__ import annotations

from weathercoat.verification.film import Film
from weathercoat.verification.findings import Ledger
from weathercoat.verification.metal import Metal


def check_history(ledger: Ledger, file: str, before: Film, film: Film, metal: Metal) -> None:
    """Hold the film against that of an earlier snapshot."""
    ledger.expect_all(
        "lost-stays-lost",
        file,
        before.is_left | ~film.is_left,
        lambda i: f"there is film over metal face {i}, which had lost it in the snapshot before",
    )
    ledger.expect_all(
        "separated-stays-separated",
        file,
        ~(before.separated & (film.start >= 0) & ~film.separated),
        lambda i: f"the film at corner {i % 3} of metal face {i // 3} holds again",
    )
    ledger.expect_all(
        "cracks-stay-open",
        file,
        ~(before.is_apart & film.is_joined),
        lambda i: f"the crack between metal faces {i // 3} and {metal.twin[i] // 3} has closed",
    )
