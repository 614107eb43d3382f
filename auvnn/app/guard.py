"""Who may talk to the server: this machine, this page, with the token; and what the page may do."""

from __future__ import annotations

import hmac
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

# Scripts, styles and data from this server alone; no frame, no form, no base address, no plug-in.
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# A report carries its own styles and pictures and runs nothing.
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; sandbox"
)


class Guard:
    """Refuses what does not come from the page itself, before anything else looks at it.

    The host must be this server's own: a name that a stranger's name server turned into the loopback address is
    refused (DNS rebinding). A request that a browser sends for another page says so by `Origin` or `Sec-Fetch-Site`.
    The token stands in the path, so that no cookie exists that another page could make the browser send along.

    Args:
        app: what is guarded.
        token: first part of every path.
        port: on which the server listens.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self.app = app
        self.token = token
        self.hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse, one request."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        why = self._refusal(scope)
        if why:
            await PlainTextResponse(why, 403)(scope, receive, _with_headers(send))
            return
        prefix = "/" + self.token
        if scope["path"] == prefix:
            # The page's own addresses are relative: only behind a slash do they carry the token.
            await RedirectResponse(prefix + "/")(scope, receive, _with_headers(send))
            return
        await self.app({**scope, "root_path": prefix}, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> str:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if host not in self.hosts:
            return "This server answers by its own address alone."
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return "Requests from other pages are refused."
        if origin is not None and urlsplit(origin).scheme != "http":
            return "Requests from other pages are refused."
        site = headers.get("sec-fetch-site", "none")
        if site not in ("same-origin", "none"):
            return "Requests from other pages are refused."
        first = scope["path"].split("/", 2)[1] if scope["path"].startswith("/") else ""
        if not hmac.compare_digest(first.encode(), self.token.encode()):
            return "The address lacks its token: open the whole address that auvnn app printed."
        return ""


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.setdefault("content-security-policy", PAGE_POLICY)
            headers["x-content-type-options"] = "nosniff"
            headers["referrer-policy"] = "no-referrer"
            headers["cross-origin-opener-policy"] = "same-origin"
            headers["cross-origin-resource-policy"] = "same-origin"
            headers.setdefault("cache-control", "no-store")
        await send(message)

    return sending
