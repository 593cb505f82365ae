"""What fuzzing has found out to be different is taken, or refused in one clear sentence."""

from pathlib import Path

import pytest

from tests.fuzz.targets import TARGETS, tried

CORPUS = Path(__file__).parent / "corpus"


@pytest.mark.parametrize("name", TARGETS)
def test_every_input_of_the_corpus_is_taken_or_refused_in_words(name: str) -> None:
    inputs = sorted((CORPUS / name).iterdir())
    refused = [bool(tried(name, path.read_bytes())) for path in inputs]
    assert len(refused) > 3
    if not name.endswith("_protocol"):  # those answer
        assert True in refused
        assert False in refused


def test_the_corpus_is_small() -> None:
    sizes = [path.stat().st_size for path in CORPUS.rglob("*") if path.is_file()]
    assert sum(sizes) < 300_000
