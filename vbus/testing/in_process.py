"""A client's bus on a board in this process, for tests."""

from vbus.serve.in_process import HostTurn as HostTurn
from vbus.serve.in_process import InProcessLink as InProcessLink
from vbus.serve.in_process import connect_in_process as connect_in_process
