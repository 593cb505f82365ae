"""Which driver is tested."""


def pytest_addoption(parser):
    parser.addoption(
        "--driver", default="axis.c", help="a file in src that has the functions of axis.h"
    )
