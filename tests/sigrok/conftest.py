"""Fixtures: sigrok's decoders, as an installation makes them."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def sigrok_decoders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("decoders")
    making = [sys.executable, "-m", "vbus.cli.generate", "--sigrok", str(folder)]
    subprocess.run(making, check=True, capture_output=True, timeout=120)
    return folder
