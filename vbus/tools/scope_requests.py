"""What browsers send to the scope's server, decoded in one place, or refused in words."""

import re
from collections.abc import Mapping
from typing import Final

import msgspec
from aiohttp import ClientError, web
from aiohttp.http_exceptions import HttpProcessingError

_HOST: Final = re.compile(r"(\[[0-9a-fA-F:.]+\]|[^\[\]:]+)(?::([0-9]{1,5}))?")


class Asked(msgspec.Struct, frozen=True):
    """A request, decoded.

    Attributes:
        host: name or address in its Host header, without brackets; "" if it is none.
        port: the port there; 0 if none is said.
        origin: the page that has made the browser send it; "" if none is said.
        cookies: by name.
        code: what a POST has in its body.
    """

    host: str
    port: int
    origin: str
    cookies: Mapping[str, str]
    code: str


async def decoded(request: web.Request) -> Asked:
    """Return what a request says.

    Raises:
        HTTPBadRequest: it makes no sense; says what does not.
        HTTPRequestEntityTooLarge: its body is longer than any code.
    """
    headers = request.headers
    host = _HOST.fullmatch(headers.get("Host", ""))
    cookies: dict[str, str] = {}
    for part in ";".join(headers.getall("Cookie", ())).split(";"):
        name, _, value = part.strip().partition("=")
        cookies[name] = value
    code = ""
    if request.method == "POST":
        try:
            code = (await request.read()).decode()
        except (web.RequestPayloadError, ClientError, HttpProcessingError, OSError) as error:
            raise _refused(f"the body cannot be read: {error}") from None
        except UnicodeDecodeError:
            raise _refused("this is no UTF-8 text") from None
    return Asked(
        host[1].strip("[]") if host else "",
        int(host[2] or 0) if host else 0,
        headers.get("Origin", ""),
        cookies,
        code,
    )


def _refused(sentence: str) -> web.HTTPBadRequest:
    refused = web.HTTPBadRequest(text=" ".join(sentence.split()) + "\n")
    refused.force_close()
    return refused
