"""Who may ask, and what a browser may do with the answer.

- 127.0.0.1 alone is listened to, and a request must name it as its host: a foreign name that was made to lead here (DNS
  rebinding) is refused.
- The address that the terminal prints holds a token. It becomes a cookie that scripts cannot read; without it nothing
  is answered. The token is compared in constant time.
- What changes something must come from this page (Origin), so that another page cannot do it with the cookie.
- Pages may load nothing but this server's own style sheet and script, and may not be framed by others.
"""

import secrets
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; frame-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
"""Content security policy of the pages."""
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'"
)
"""Policy of a report, which states in its own head the hash of the one script that it may run."""
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
    "cache-control": "no-store",
}
REMEMBERED = 30 * 86_400
"""Seconds that a browser keeps the cookie, also when it is killed; the token itself ends with the server."""
ENTRANCE = (
    '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="0; url=/">'
    '<link rel="icon" href="/icon.svg" type="image/svg+xml"><title>cosim</title></head>'
    '<body><p><a href="/">To the page</a></p></body></html>'
)
SAFE = ("GET", "HEAD")


class Guard:
    """Lets through what comes from this machine with the token, and adds the headers."""

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        self._cookie = f"cosim-{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return

        async def sealed(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await (self._refused(scope) or self._app)(scope, receive, sealed)

    def _refused(self, scope: Scope) -> ASGIApp | None:
        """Return the answer to a request that is not let through."""
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self._hosts:
            return PlainTextResponse("This page answers to 127.0.0.1 alone.", 421)
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if scope["path"] == "/" and self._is_token(given):
            return self._welcome(headers.get("sec-fetch-site", "none"))
        if not self._is_token(self._remembered(headers)):
            text = "This page needs its token: open the address that cosim serve printed in the terminal."
            return PlainTextResponse(text, 403)
        return self._foreign(scope, headers)

    def _foreign(self, scope: Scope, headers: Headers) -> ASGIApp | None:
        own = [f"http://{host}" for host in self._hosts]
        origin, site = headers.get("origin"), headers.get("sec-fetch-site", "same-origin")
        if (origin is not None and origin not in own) or (scope["method"] not in SAFE and origin is None):
            return PlainTextResponse("This request comes from another page.", 403)
        if site == "cross-site" or (site == "same-site" and scope["method"] not in SAFE):
            return PlainTextResponse("This request comes from another page.", 403)
        return None

    def _welcome(self, site: str) -> ASGIApp:
        """Turn the token into a cookie and take it out of the address.

        Who comes from elsewhere, as from the file that the browser was opened with, is led on by a page of ours: a
        browser does not give the cookie to what is led on from there.
        """
        answer: Response = RedirectResponse("/", 303)
        if site in ("cross-site", "same-site"):
            answer = HTMLResponse(ENTRANCE)
        answer.set_cookie(self._cookie, self._token, max_age=REMEMBERED, httponly=True, samesite="strict")
        return answer

    def _remembered(self, headers: Headers) -> str:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return ""
        return found.value if found else ""

    def _is_token(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), self._token.encode())
