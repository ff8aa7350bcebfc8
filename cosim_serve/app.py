"""The addresses of the page.

    GET    /                       drop recordings; what was diagnosed
    POST   /jobs                   a new draft; where it is, in the header "location"
    GET    /compare?job=ID&job=ID  two diagnoses side by side
    GET    /jobs/ID                a job: its files and card, its progress, or its report
    PUT    /jobs/ID/files?name=N   a recording, or a card where N ends in .toml; the bytes are the body
    POST   /jobs/ID/ACTION         see `Actions`; then leads back to the job
    GET    /jobs/ID/result/N       a file that the diagnosis wrote
    GET    /page.css, /page.js     the whole design and the whole script

Answers to forms are pages, so everything but the upload works without the script.
"""

import asyncio
import errno
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import ParamSpec, TypeVar
from urllib.parse import parse_qsl

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

from cosim.support.errors import CosimError
from cosim.support.numbers import whole
from cosim.support.system_errors import surroundings
from cosim_serve.actions import ACTIONS, LOOKING, Form
from cosim_serve.arrivals import receive
from cosim_serve.desk import Desk
from cosim_serve.folder import plain_files
from cosim_serve.guard import REPORT_POLICY, SAFE, Guard
from cosim_serve.pages import home_page, job_page, unreadable_page
from cosim_serve.pages.pair import comparison_page
from cosim_serve.store import UnknownJobError, UnreadableJobError
from cosim_serve.uploads import ADVICE, check_size, safe_name

CARD_SUFFIX = ".toml"
REPORT = "report.html"
PAIR = 2
"""Diagnoses that are compared."""
NO_ROOM = 507
"""Status of what the system refuses to keep (RFC 4918: insufficient storage)."""
FULL = (errno.ENOSPC, errno.EDQUOT)
THREADS = 12
"""Requests that look at files at a time; anyio has 40 threads for everything else."""
P = ParamSpec("P")
T = TypeVar("T")
ASSETS = {"page.css": "text/css", "page.js": "text/javascript", "icon.svg": "image/svg+xml"}


def make_app(desk: Desk, token: str, port: int) -> Starlette:
    """Return the application that works on a desk and answers to who has the token."""
    there = Addresses(desk)
    routes = [
        Route("/", there.home),
        Route("/jobs", there.new, methods=["POST"]),
        Route("/example", there.example, methods=["POST"]),
        Route("/compare", there.compare),
        Route("/jobs/{id}", there.job),
        Route("/jobs/{id}/files", there.upload, methods=["PUT"]),
        Route("/jobs/{id}/result/{name}", there.result),
        Route("/jobs/{id}/{action}", there.act, methods=["POST"]),
        *(Route(f"/{name}", there.asset) for name in ASSETS),
    ]
    failures = {
        UnknownJobError: _unknown,
        UnreadableJobError: _unreadable,
        HTTPException: _failed,
        ClientDisconnect: _disconnected,
        OSError: there.refused,
        Exception: _broken,
    }
    guard = Middleware(Guard, token=token, port=port)
    return Starlette(routes=routes, middleware=[guard], exception_handlers=failures)


class Addresses:
    """What is done at each address."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._threads = ThreadPoolExecutor(THREADS, "looks")

    def home(self, request: Request) -> Response:
        """Show where to drop recordings, and all jobs."""
        return home_page(self._desk, request.query_params.get("problem", ""))

    def new(self, request: Request) -> Response:
        """Make a draft."""
        return RedirectResponse(f"/jobs/{self._desk.store.new().id}", 303)

    async def example(self, request: Request) -> Response:
        """Make a draft of the example's files."""
        job = await self._looked(self._desk.example)
        return RedirectResponse(f"/jobs/{job.id}", 303)

    def compare(self, request: Request) -> Response:
        """Show two diagnoses side by side; others than two that are done lead back with a sentence."""
        chosen = [self._desk.store.get(name) for name in dict.fromkeys(request.query_params.getlist("job"))]
        if len(chosen) != PAIR or any(job.state != "done" for job in chosen):
            return home_page(self._desk, f"Choose two diagnoses that are done; {len(chosen)} chosen.", 400)
        return comparison_page(self._desk, *sorted(chosen, key=lambda job: job.id))

    def job(self, request: Request) -> Response:
        """Show a job as far as it is."""
        return job_page(self._desk, self._desk.store.get(request.path_params["id"]))

    async def upload(self, request: Request) -> Response:
        """Take a file; its sentence if it is refused."""
        name, given = request.path_params["id"], request.query_params.get("name", "")
        try:
            if given.lower().endswith(CARD_SUFFIX):
                called = safe_name(given, self._desk.limits.name)
                text = (await self._body(request, called, self._desk.limits.card)).decode("utf-8")
                await self._looked(self._desk.give_card, name, text, called)
            else:
                await self._recording(request, name, given)
        except UnicodeDecodeError:
            return JSONResponse({"problem": f"{called} is not a card: it is not UTF-8 text."}, 400)
        except CosimError as error:
            return JSONResponse({"problem": str(error)}, 400)
        except OSError as error:
            return JSONResponse({"problem": not_kept(error)}, NO_ROOM)
        return JSONResponse({}, 201)

    async def _recording(self, request: Request, name: str, given: str) -> None:
        """Take a recording; what a sender states of its size is reserved before it comes."""
        stated = whole(request.headers.get("content-length", "")) or 0
        with self._desk.arriving(name, given, stated) as arrival:
            size = await receive(request.stream(), arrival, self._desk.grow)
            await self._looked(self._desk.received, arrival, size)

    async def act(self, request: Request) -> Response:
        """Do what a form asks for, and lead to where it shows."""
        name, action = request.path_params["id"], ACTIONS.get(request.path_params["action"])
        if action is None:
            return _failed(request, HTTPException(404))
        form: Form = {}
        try:
            body = await self._body(request, "The form", self._desk.limits.form)
            form = dict(parse_qsl(body.decode("utf-8", "replace")))
            done = self._looked if action.__name__ in LOOKING else run_in_threadpool
            return RedirectResponse(await done(action, self._desk, name, form), 303)
        except UnreadableJobError:
            raise
        except CosimError as error:
            said, status = str(error), 400
        except KeyError:
            said, status = "This recording is not there any more.", 400
        except OSError as error:
            said, status = not_kept(error), NO_ROOM
        return await run_in_threadpool(self._again, name, said, form, status)

    def _again(self, name: str, said: str, form: Form, status: int) -> Response:
        """Show a job with why a form was refused."""
        return job_page(self._desk, self._desk.store.get(name), said, form, status)

    def result(self, request: Request) -> Response:
        """Give a file that the diagnosis wrote: the report as a page, others to be kept."""
        name = request.path_params["name"]
        path = plain_files(self._desk.store.result(request.path_params["id"])).get(name)
        if path is None:
            raise UnknownJobError(name)
        if name == REPORT:
            return FileResponse(path, headers={"content-security-policy": REPORT_POLICY})
        return FileResponse(path, filename=name, media_type="application/octet-stream")

    def refused(self, request: Request, error: Exception) -> Response:
        """Say on the first page what the system refused."""
        assert isinstance(error, OSError)
        try:
            return home_page(self._desk, not_kept(error), NO_ROOM)
        except OSError:  # the folder of the jobs cannot be read either
            return PlainTextResponse(not_kept(error), NO_ROOM)

    def asset(self, request: Request) -> Response:
        """Give the style sheet or the script."""
        name = Path(request.url.path).name
        text = (files("cosim_serve") / "pages" / name).read_text("utf-8")
        return Response(text, media_type=ASSETS[name])

    async def _looked(self, work: Callable[P, T], *given: P.args, **named: P.kwargs) -> T:
        """Do what looks at files, which may take long, in one of a few threads: those that draw pages stay free."""
        return await asyncio.get_running_loop().run_in_executor(self._threads, partial(work, *given, **named))

    async def _body(self, request: Request, what: str, most: int) -> bytes:
        """Return a small body (InputError: it is none)."""
        body = bytearray()
        async for chunk in request.stream():
            body += chunk
            check_size(what, len(body), most)
        return bytes(body)


def _unknown(request: Request, error: Exception) -> Response:
    return PlainTextResponse("There is no such diagnosis, or it has no such file.", 404)


def _unreadable(request: Request, error: Exception) -> Response:
    assert isinstance(error, UnreadableJobError)
    return unreadable_page(error, 200 if request.method in SAFE else 400)


def _failed(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return PlainTextResponse(error.detail, error.status_code, headers=error.headers)


def _disconnected(request: Request, error: Exception) -> Response:
    return PlainTextResponse("The upload was broken off.", 400)


def _broken(request: Request, error: Exception) -> Response:
    return PlainTextResponse("This failed, by a defect of cosim; the terminal of cosim serve says where.", 500)


def not_kept(error: OSError) -> str:
    """Say that the system refused to keep something, without the name of a file that the user has never seen."""
    text = f"This could not be kept: {surroundings(OSError(error.errno, error.strerror or str(error)))}"
    return f"{text} Nothing was changed; {ADVICE}." if error.errno in FULL else text
