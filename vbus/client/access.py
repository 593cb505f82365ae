"""How a host moves words and register values to and from a chip, blocking."""

from vbus.client.aio import access
from vbus.client.blocking import export

export(access, globals())
