#!/usr/bin/env python3
"""Tells whether what this container is for is alive: exit code 0, or 1 and a sentence.

healthcheck.py           there is a board, and every board here answers
healthcheck.py BOARD...  these boards answer
healthcheck.py --router  the router lets others connect
"""

import json
import os
import socket
import subprocess
import sys

SECONDS = 5.0


def boards(names: list[str]) -> str:
    """Return why boards of this container are not well; empty if they are."""
    # Boards in other containers are their own business.
    here = {name: value for name, value in os.environ.items() if name != "VBUS_ZENOH"}
    try:
        told = subprocess.run(
            ["vbus", "ls", "--json", *names],
            env=here,
            capture_output=True,
            text=True,
            timeout=SECONDS,
        )
    except subprocess.TimeoutExpired:
        return f"vbus ls has not ended within {SECONDS:g} s"
    if told.returncode:
        return told.stderr.strip()
    found = json.loads(told.stdout)
    ill = [f"{board['board']}: {board['error']}" for board in found if "error" in board]
    return "; ".join(ill) if found else "no board is running"


def router() -> str:
    """Return why nobody can connect to the router of this container; empty if one can."""
    try:
        place = os.path.join(os.environ["VBUS_RUNTIME"], "zenoh", "router")
        with open(place) as file:
            endpoint = file.read().split()[0].split(",")[0]
        host, _, port = endpoint.partition("/")[2].rpartition(":")
        socket.create_connection((host.strip("[]"), int(port)), SECONDS).close()
    except (OSError, KeyError, IndexError, ValueError) as error:
        return f"no router lets others connect: {error}"
    return ""


def main() -> int:
    """Say what is wrong, if anything is."""
    wrong = router() if sys.argv[1:] == ["--router"] else boards(sys.argv[1:])
    if wrong:
        print(wrong)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
