"""The clients as hosts of a campaign: each reads back what its chip tells of what it has taken."""

from vbus.client import Bus, aio
from vbus.client.aio.lm628 import Lm628 as AwaitedLm628
from vbus.client.lm628 import Lm628
from vbus.client.mc1241a import Mc1241a
from vbus.client.mcp1200 import Mcp1200


def there(at: int, target: int) -> int:
    """Return where a motor is, which must be near its target."""
    assert abs(at - target) < 6, f"at {at}, not at {target}"
    return at


def lm629(bus: Bus) -> int:
    """Load the filter and move."""
    axis = Lm628(bus, ready="wait", checked=True)
    axis.load_filter(kp=300, kd=2000)
    return there(axis.move(100, acc=400, vel=4 << 16, longest="200ms"), 100)


async def lm629_asyncio(bus: aio.Bus) -> int:
    """Do the same by asyncio, and poll."""
    axis = AwaitedLm628(bus, checked=True)
    await axis.load_filter(kp=300, kd=2000)
    return there(await axis.move(100, acc=400, vel=4 << 16, longest="200ms"), 100)


def mcp1200(bus: Bus) -> int:
    """Load the filter and move."""
    axis = Mcp1200(bus, checked=True)
    axis.feature(pid=True)
    axis.write_kp(64)
    axis.write_kd(64)
    axis.control()
    return there(axis.move(100, velocity=1024, acceleration=64, longest="200ms"), 100)


def mc1241a(bus: Bus) -> int:
    """Power the motor and move."""
    axis = Mc1241a(bus, ready="wait", checked=True)
    axis.set_buf_mtr_cmd(24000)
    axis.set_step_ratio(40)
    return axis.move(500, vel=15 << 16, acc=0x1000)
