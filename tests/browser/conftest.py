"""A browser, the pages it is shown, and the checkers of markup; what is missing skips, here alone.

Nothing is downloaded by a test. `.ci/run` installs Chromium, a Java runtime and Node.js from
Debian, and `npm ci` what `package.json` names; with BROWSER_TESTS=required a missing tool fails.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import pytest

from tests.browser.pages import MADE

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Request, Route

HERE = Path(__file__).parent
NODE = 20
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
WATCH = """
window.violations = [];
document.addEventListener("securitypolicyviolation",
  (event) => window.violations.push(`${event.violatedDirective}: ${event.blockedURI}`));
window.shifts = [];
const keep = (entries) => window.shifts.push(...entries.map((entry) => entry.value));
const observer = new PerformanceObserver((list) => keep(list.getEntries()));
observer.observe({ type: "layout-shift", buffered: true });
window.moved = async () => {
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  await frame();
  await frame();
  keep(observer.takeRecords());
  return window.shifts.reduce((sum, value) => sum + value, 0);
};
"""
"""Told to the page before any of its own: what its policy forbade, and what moved.

`moved` sums the shifts of every frame until it is called, those that nobody was told yet included.
"""


def missing(what: str) -> NoReturn:
    if os.environ.get("BROWSER_TESTS") == "required":
        pytest.fail(f"{what}, although BROWSER_TESTS=required")
    pytest.skip(f"{what}; docs/developers/testing.md says how to install it")


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of the machine's own Chromium."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    return found or missing("no Chromium on the PATH")


@pytest.fixture(scope="session")
def browser(chromium: str) -> Iterator[Browser]:
    """One headless browser for all tests of a worker; each test has a context of its own."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("no playwright")
    with sync_playwright() as started:
        found = started.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield found
        found.close()


@pytest.fixture(scope="session")
def package() -> Callable[[str], Path]:
    """Path of a file within the packages that `npm ci` installed beside the tests."""

    def find(name: str) -> Path:
        path = HERE / "node_modules" / name
        return path if path.is_file() else missing(f"no {name.split('/')[0]} (npm ci)")

    return find


@pytest.fixture(scope="session")
def axe(package: Callable[[str], Path]) -> Callable[[Page], list[Any]]:
    """What axe finds on a page by its rules, best practices and the size of targets included."""
    code = package("axe-core/axe.min.js").read_text(encoding="utf-8")

    def found(page: Page) -> list[Any]:
        page.evaluate(code)
        return page.evaluate(
            """async () => {
              const rules = { "target-size": { enabled: true } };
              const found = await axe.run(document, { resultTypes: ["violations"], rules });
              return found.violations.map((v) =>
                [v.id, v.impact, v.nodes.length, v.nodes[0].html.slice(0, 200)]);
            }"""
        )

    return found


@pytest.fixture(scope="session")
def program() -> Callable[[str], str]:
    """Path of a program on the PATH."""
    return lambda name: shutil.which(name) or missing(f"no {name} on the PATH")


@pytest.fixture(scope="session")
def node(program: Callable[[str], str]) -> str:
    """Path of a Node.js that html-validate runs in."""
    path = program("node")
    version = subprocess.run([path, "--version"], capture_output=True, check=True, text=True).stdout
    if int(version.removeprefix("v").split(".")[0]) < NODE:
        missing(f"Node.js is {version.strip()}, not {NODE} or newer")
    return path


@pytest.fixture(scope="session")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """`report.html` of the page that a name of `MADE` means; made once for all workers."""
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent

    def path(name: str) -> Path:
        import fcntl  # not on Windows, where there is no test of a browser

        folder = root / f"page-{name}"
        with (root / f"page-{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not folder.exists():
                part = folder.with_suffix(".part")
                part.mkdir()
                MADE[name](part)
                part.rename(folder)
        return folder / "report" / "report.html"

    return path


@dataclass
class Shown:
    """A page in the browser, and what it did besides being shown.

    Attributes:
        requests: every URL it asked for, itself and `data:` apart; none is answered.
        messages: warnings and errors of its console, scripts' errors, and dialogs.
    """

    page: Page
    requests: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)

    @property
    def violations(self) -> list[str]:
        """What its Content-Security-Policy forbade."""
        return self.page.evaluate("window.violations")

    def wait_until(self, condition: str) -> None:
        """Until an expression of JavaScript holds, looked at every 20 ms for a minute.

        Playwright's own waiting compiles the expression within the page at every look but the
        first, and the page's policy forbids that.
        """
        self.page.evaluate(
            f"""async () => {{
              const end = performance.now() + 60_000;
              while (!({condition})) {{
                if (performance.now() > end) throw new Error("still not so after a minute");
                await new Promise((done) => setTimeout(done, 20));
              }}
            }}"""
        )

    def scroll_through(self) -> None:
        """From top to bottom in screens, and back, as a reader does."""
        self.page.evaluate(
            """async () => {
              const frame = () => new Promise((done) => requestAnimationFrame(done));
              const end = document.documentElement.scrollHeight;
              for (let at = 0; at < end; at += innerHeight) { scrollTo(0, at); await frame(); }
              scrollTo(0, 0); await frame(); await frame();
            }"""
        )


@pytest.fixture
def show(browser: Browser, page_file: Callable[[str], Path]) -> Iterator[Callable[..., Shown]]:
    """Open a page of `MADE` by its name: `show("usual", width=360, color_scheme="dark")`."""
    with ExitStack() as open_contexts:

        def opened(
            name: str, *, width: int = 1440, height: int = 900, unfold: bool = False, **more: Any
        ) -> Shown:
            context = browser.new_context(viewport={"width": width, "height": height}, **more)
            open_contexts.callback(context.close)
            context.set_default_timeout(60_000)  # for a busy machine
            address = page_file(name).as_uri()
            shown = Shown(context.new_page())

            def answer(route: Route, request: Request) -> None:
                if request.url.split("#")[0] == address:
                    route.continue_()
                    return
                shown.requests.append(request.url)
                route.abort()

            context.add_init_script(WATCH)
            context.route(lambda url: not url.startswith("data:"), answer)
            page = shown.page
            page.on("pageerror", lambda error: shown.messages.append(str(error)))
            page.on("dialog", lambda dialog: (shown.messages.append("dialog"), dialog.dismiss()))
            page.on(
                "console",
                lambda said: said.type in ("warning", "error") and shown.messages.append(said.text),
            )
            page.goto(address)
            if unfold:
                page.evaluate(
                    "document.querySelectorAll('details').forEach((e) => (e.open = true))"
                )
            return shown

        yield opened
