"""Who is to be cited: the papers behind the designs of a page, each once, in the order of first use."""

from collections.abc import Iterable

from luenberger.design import Design, SwitchedDesign


def citations(designs: Iterable[Design | SwitchedDesign], further: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the references of designs and further ones, each once.

    Args:
        designs: designs in the order of the page.
        further: references of logs, parameter sets or filters, one string each; empty ones are dropped.
    """
    found = [reference for design in designs for reference in design.references]
    kept: dict[str, str] = {}
    for reference in (*found, *further):
        words = " ".join(reference.split())
        # The same paper is now and then written with another stop or capital.
        kept.setdefault(words.rstrip(".").casefold(), words)
    return tuple(words for key, words in kept.items() if key)


def numbered(references: Iterable[str]) -> str:
    """Return references as numbered plain text, one a line, for terminals and text files.

    Args:
        references: one string each.
    """
    return "\n".join(f"[{k}] {reference}" for k, reference in enumerate(references, start=1))
