"""The addresses of the page.

    GET    /                       drop recordings; what was diagnosed
    POST   /jobs                   a new draft; where it is, in the header "location"
    GET    /jobs/ID                a job: its files and card, its progress, or its report
    PUT    /jobs/ID/files?name=N   a recording, or a card where N ends in .toml; the bytes are the body
    POST   /jobs/ID/ACTION         see `Actions`; then leads back to the job
    GET    /jobs/ID/result/N       a file that the diagnosis wrote
    GET    /page.css, /page.js     the whole design and the whole script

Answers to forms are pages, so everything but the upload works without the script.
"""

from importlib.resources import files
from pathlib import Path
from urllib.parse import parse_qsl

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

from cosim.serve.actions import ACTIONS, Form
from cosim.serve.desk import Desk
from cosim.serve.guard import REPORT_POLICY, Guard
from cosim.serve.pages import home_page, job_page
from cosim.serve.store import UnknownJobError
from cosim.serve.uploads import check_size, receive
from cosim.support.errors import CosimError
from cosim.support.numbers import whole

CARD_SUFFIX = ".toml"
REPORT = "report.html"
ASSETS = {"page.css": "text/css", "page.js": "text/javascript", "icon.svg": "image/svg+xml"}


def make_app(desk: Desk, token: str, port: int) -> Starlette:
    """Return the application that works on a desk and answers to who has the token."""
    there = Addresses(desk)
    routes = [
        Route("/", there.home),
        Route("/jobs", there.new, methods=["POST"]),
        Route("/jobs/{id}", there.job),
        Route("/jobs/{id}/files", there.upload, methods=["PUT"]),
        Route("/jobs/{id}/result/{name}", there.result),
        Route("/jobs/{id}/{action}", there.act, methods=["POST"]),
        *(Route(f"/{name}", there.asset) for name in ASSETS),
    ]
    failures = {UnknownJobError: _unknown, HTTPException: _failed, ClientDisconnect: _left}
    guard = Middleware(Guard, token=token, port=port)
    return Starlette(routes=routes, middleware=[guard], exception_handlers=failures)


class Addresses:
    """What is done at each address."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk

    def home(self, request: Request) -> Response:
        """Show where to drop recordings, and all jobs."""
        return home_page(self._desk, request.query_params.get("problem", ""))

    def new(self, request: Request) -> Response:
        """Make a draft."""
        return RedirectResponse(f"/jobs/{self._desk.store.new().id}", 303)

    def job(self, request: Request) -> Response:
        """Show a job as far as it is."""
        return job_page(self._desk, self._desk.store.get(request.path_params["id"]))

    async def upload(self, request: Request) -> Response:
        """Take a file; its sentence if it is refused."""
        name, given = request.path_params["id"], request.query_params.get("name", "")
        try:
            if given.lower().endswith(CARD_SUFFIX):
                text = (await self._body(request, given, self._desk.limits.card)).decode("utf-8")
                await run_in_threadpool(self._desk.give_card, name, text, given)
            else:
                path, most = self._desk.place(name, given)
                stated = request.headers.get("content-length", "")
                size = await receive(request.stream(), whole(stated) or 0, path, most)
                await run_in_threadpool(self._desk.received, name, path, size)
        except UnicodeDecodeError:
            return JSONResponse({"problem": f"{given} is not a card: it is not UTF-8 text."}, 400)
        except CosimError as error:
            return JSONResponse({"problem": str(error)}, 400)
        return JSONResponse({}, 201)

    async def act(self, request: Request) -> Response:
        """Do what a form asks for, and lead to where it shows."""
        name, action = request.path_params["id"], ACTIONS.get(request.path_params["action"])
        if action is None:
            return _failed(request, HTTPException(404))
        form: Form = {}
        try:
            body = await self._body(request, "The form", self._desk.limits.form)
            form = dict(parse_qsl(body.decode("utf-8", "replace")))
            target = await run_in_threadpool(action, self._desk, name, form)
        except (CosimError, KeyError) as error:
            said = str(error) if isinstance(error, CosimError) else "This recording is not there any more."
            return await run_in_threadpool(job_page, self._desk, self._desk.store.get(name), said, form)
        return RedirectResponse(target, 303)

    def result(self, request: Request) -> Response:
        """Give a file that the diagnosis wrote: the report as a page, others to be kept."""
        folder, name = self._desk.store.result(request.path_params["id"]), request.path_params["name"]
        there = {one.name: one for one in folder.iterdir()} if folder.is_dir() else {}
        if name not in there:
            raise UnknownJobError(name)
        if name == REPORT:
            return FileResponse(there[name], headers={"content-security-policy": REPORT_POLICY})
        return FileResponse(there[name], filename=name, media_type="application/octet-stream")

    def asset(self, request: Request) -> Response:
        """Give the style sheet or the script."""
        name = Path(request.url.path).name
        text = (files("cosim.serve") / "pages" / name).read_text("utf-8")
        return Response(text, media_type=ASSETS[name])

    async def _body(self, request: Request, what: str, most: int) -> bytes:
        """Return a small body (InputError: it is none)."""
        body = bytearray()
        async for chunk in request.stream():
            body += chunk
            check_size(what, len(body), most)
        return bytes(body)


def _unknown(request: Request, error: Exception) -> Response:
    return PlainTextResponse("There is no such diagnosis, or it has no such file.", 404)


def _failed(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return PlainTextResponse(error.detail, error.status_code, headers=error.headers)


def _left(request: Request, error: Exception) -> Response:
    return PlainTextResponse("The upload was broken off.", 400)
