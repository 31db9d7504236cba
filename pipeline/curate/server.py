"""The page's server, on this computer only: started, ended, waited for."""

import asyncio
import contextlib
import logging
import secrets
import socket
import threading
import time
import webbrowser

from pipeline.curate.corrected import renew_tables
from pipeline.curate.decisions import user_name
from pipeline.curate.results import Results
from pipeline.session.results_folders import need_results
from pipeline.tables.result_exchange import settled

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
GOODBYE_S = 0.5  # for the last words to reach the browser


def curate(results, port=0, open_browser=True, block=True, say=print, name=None):
    """Let a person correct the contacts of a results folder in the browser.

    Parameters
    ----------
    results : results folder of `whiskerforce run`
    port : of the page; 0: any free one
    open_browser : open the page there
    block : return when the person has finished (in the page, or with Ctrl-C), with all tables
        written; else at once, with a `Server` to be stopped
    say : called with the address of the page
    name : of the person, saved with every correction; None: the user's name on this computer

    Returns
    -------
    Server

    Raises
    ------
    InputError
        Where there is nothing to curate in the folder, another `whiskerforce` is at work in it,
        or the port is taken.
    """
    server = _server(results, port, user_name() if name is None else name)
    say(f"curate: {server.url}")
    say("Finish in the page, or here with Ctrl-C; every correction is saved at once.")
    if open_browser:
        webbrowser.open(server.url)
    if block:
        try:
            server.wait()
        except KeyboardInterrupt:
            say("finishing: writing the tables")
        server.stop()
    return server


def _server(results, port, person):
    """A server of complete results, which are locked until it stops."""
    with contextlib.ExitStack() as held:
        kept = held.enter_context(settled(results))
        need_results(results)
        problems, said = renew_tables(results)  # an earlier curation may have been killed
        opened = Results(results, problems)
        opened.kept += kept + said
        held.callback(opened.close)
        server = Server(opened, port, person)
        server.on_stop(held.pop_all().close)
    return server


class Server:
    """Serves the page from a thread of its own; `url` is where."""

    def __init__(self, results: Results, port: int = 0, person: str = ""):
        self.results, self.person = results, person
        self._callbacks = []
        self._socket = _bound_socket(port)
        self._pages = []
        self._path = f"/{secrets.token_urlsafe(8)}"
        self.url = f"http://{HOST}:{self._socket.getsockname()[1]}{self._path}"
        self._ended, self._stopped = threading.Event(), False
        ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(ready,), daemon=True)
        self._thread.start()
        ready.wait()

    def wait(self) -> None:
        """Wait until the person has finished."""
        while not self._ended.wait(0.2):  # briefly, so that Ctrl-C takes effect
            pass

    def on_stop(self, callback) -> None:
        """Call this when no page is served any more."""
        self._callbacks.append(callback)

    def stop(self) -> None:
        """End; what is due is written by the callbacks of `on_stop`."""
        if self._stopped:
            return
        self._stopped = True
        self._loop.add_callback(self._loop.stop)
        self._thread.join()  # from here on no page asks for frames or corrects contacts
        for callback in self._callbacks:
            callback()

    # ---- the thread -----------------------------------------------------------------------

    def _serve(self, ready):
        from bokeh.application import Application
        from bokeh.application.handlers import FunctionHandler
        from bokeh.server.server import BaseServer
        from tornado.httpserver import HTTPServer
        from tornado.ioloop import IOLoop

        # a page that is closed is no reason for a warning on the terminal
        logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)
        asyncio.set_event_loop(asyncio.new_event_loop())
        self._loop = IOLoop.current()
        place = f"{HOST}:{self._socket.getsockname()[1]}"
        application = Application(FunctionHandler(self._open))
        tornado = local_pages()(
            {self._path: application},
            extra_websocket_origins=[place],
            use_index=False,
            # a session's token is made here, and for this page
            secret_key=secrets.token_bytes(32),
            sign_sessions=True,
            # a laptop that sleeps must not lose its page
            unused_session_lifetime_milliseconds=600_000,
        )
        http = HTTPServer(tornado)
        http.add_socket(self._socket)
        server = BaseServer(self._loop, tornado, http)
        server.start()
        self._loop.add_callback(ready.set)
        self._loop.start()
        server.stop()
        http.stop()

    def _open(self, doc):
        from pipeline.curate.page import Page

        page = Page(doc, self.results, self._finish, self.person)
        self._pages.append(page)
        doc.on_session_destroyed(lambda context: self._pages.remove(page))

    def _finish(self):
        """The person wants to end: write everything (elsewhere), notify the pages, then stop."""
        threading.Thread(target=self._settle_and_end, daemon=True).start()

    def _settle_and_end(self):
        self.results.settle()
        for page in list(self._pages):
            page.doc.add_next_tick_callback(lambda page=page: page.show_state("finished"))
        time.sleep(GOODBYE_S)
        self._ended.set()


def local_pages():
    """Return the class of an application that answers only requests to this computer's own name.

    A page from elsewhere whose name is made to lead here (DNS rebinding) calls it by that name.
    """
    from bokeh.server.tornado import BokehTornado
    from tornado.web import ErrorHandler

    class LocalPages(BokehTornado):
        def find_handler(self, request, **kwargs):
            if request.host_name in NAMES:
                return super().find_handler(request, **kwargs)
            return self.get_handler_delegate(request, ErrorHandler, {"status_code": 403})

    return LocalPages


def _bound_socket(port):
    from pipeline.errors import InputError, why

    bound = socket.socket()
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((HOST, port))
    except OSError as error:
        raise InputError(
            f"--port {port}: cannot serve there ({why(error)}); leave --port out for any free port"
        ) from None
    bound.listen(64)
    bound.setblocking(False)
    return bound
