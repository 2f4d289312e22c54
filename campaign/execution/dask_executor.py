"""Batches executed by the workers of a Dask cluster (dask.distributed, an extra).

The cluster only executes: a worker receives trials and returns their files, journal entries and
endings. Only this process writes the run. It writes the files of a batch to the disk before it
reports any of its trials.
"""

from __future__ import annotations

import hashlib
import logging
import pickle
import re
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from campaign import processes
from campaign.archive.layout.files import PART, keep_umask, publish_all
from campaign.archive.writing.trial_file import lost_trial
from campaign.archive.writing.writer import RunWriter
from campaign.backends import backends, calls
from campaign.backends.interface import Backend
from campaign.errors import BackendError, UsageError
from campaign.execution import provenance
from campaign.execution.attempt import Conditions
from campaign.execution.executors import (
    BatchResult,
    BatchWorker,
    OnEnd,
    WorkerLostError,
    WorkerSetup,
)
from campaign.experiments import experiments
from campaign.physics.compensation import compensation_methods
from campaign.physics.friction import friction_models
from campaign.recording import MemoryRecorder
from campaign.source_hash import digest, sources_of
from campaign.trial import Trial

if TYPE_CHECKING:
    from distributed import Client

LOCAL = "dask"
"""`--executor` value for a cluster of local processes."""
_ADDRESS = re.compile(r"dask://(\[[0-9a-fA-F:]+\]|[A-Za-z0-9.-]+):([0-9]{1,5})")
_LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
CERTIFICATES = ("ca.pem", "cert.pem", "key.pem")
"""Files in the folder of `--executor-tls`."""
CONNECTING = 20.0
"""s; timeout of the connection to a scheduler."""
GONE = 10.0
"""s without scheduler or workers until the run ends; it can be resumed."""
PROCESSOR = "processor"
LOOK = 2.0
"""s between two checks for new workers."""


@contextmanager
def cluster(
    address: str,
    workers: int | None,
    backend: Backend,
    trials: Sequence[Trial],
    tls: Path | None = None,
) -> Iterator[Cluster]:
    """Connect to the cluster of `--executor` and admit the workers that may execute these trials.

    Args:
        address: `dask`, or `dask://HOST:PORT` of a scheduler.
        workers: processes of a local cluster; None for one per processor.
        backend, trials: the work to execute.
        tls: folder with `CERTIFICATES`.

    Raises:
        UsageError: dask.distributed is missing, no scheduler answers, or no worker is usable.
    """
    distributed = _distributed()
    with ExitStack() as stack:
        if address == LOCAL:
            local = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
            )
            at: Any = stack.enter_context(local)
        else:
            at, tls = _scheduler(address, tls)
        security = None if tls is None else _security(distributed, tls)
        try:
            client = distributed.Client(
                at, security=security, timeout=CONNECTING, set_as_default=False
            )
        except OSError:
            raise UsageError(f"--executor {address}: no scheduler answers there") from None
        stack.callback(_close, client)
        connected = Cluster(client, address, backend, trials)
        if address == LOCAL:
            client.wait_for_workers(workers or 1, timeout=CONNECTING)
        connected.join()
        connected.need_workers()
        yield connected


class Cluster:
    """A connected cluster.

    A worker with other versions than this process is refused. A worker with another processor
    first executes the shortest trial; it is refused if its samples differ.

    Attributes:
        usable: threads by address of the workers that may execute.
        refused: reasons of refusal by worker address.
    """

    def __init__(
        self, client: Client, address: str, backend: Backend, trials: Sequence[Trial]
    ) -> None:
        self._client, self._address = client, address
        used = provenance.plug_ins(trials, "sim")
        self._plug_ins = [(str(each["room"]), str(each["name"])) for each in used]
        self._expected = identity(self._plug_ins)
        self._reference = backend, min(trials, key=lambda each: each.task.duration)
        self._samples = ""
        self.usable: dict[str, int] = {}
        self.refused: dict[str, str] = {}

    @property
    def threads(self) -> int:
        """Trials, or blocks of trials, that the usable workers execute at once."""
        return sum(self.usable.values())

    def join(self) -> None:
        """Update the lists of workers: new ones, lost ones."""
        present = {
            name: int(each["nthreads"])
            for name, each in self._client.scheduler_info(n_workers=-1)["workers"].items()
        }
        self.usable = {name: threads for name, threads in self.usable.items() if name in present}
        new = [name for name in present if name not in self.usable and name not in self.refused]
        if not new:
            return
        self._client.run(_ignore_interrupts, workers=new)
        ids = self._client.run(identity, self._plug_ins, workers=new)
        why = {name: self._differences(own) for name, own in ids.items()}
        others = [n for n in new if not why[n] and ids[n][PROCESSOR] != self._expected[PROCESSOR]]
        for name in self._with_other_samples(others):
            why[name] = f"on its processor ({ids[name][PROCESSOR]}) a trial has other samples"
        for name in new:
            if why[name]:
                self.refused[name] = f"the worker {name} is not used: {why[name]}"
            else:
                self.usable[name] = present[name]

    @contextmanager
    def executor(self, conditions: Conditions, writer: RunWriter) -> Iterator[DaskExecutor]:
        """An executor on the workers of this cluster."""
        executor = DaskExecutor(self._client, self, conditions, writer)
        try:
            yield executor
        finally:
            executor.close()

    def need_workers(self) -> None:
        """Raise UsageError if no worker is usable."""
        if not self.usable:
            why = "; ".join(self.refused.values()) or "the scheduler has no worker"
            raise UsageError(f"--executor {self._address}: {why}")

    def _differences(self, own: Mapping[str, str]) -> str:
        return "; ".join(
            f"it has {key} {own.get(key, 'not at all')}, here it is {value}"
            for key, value in self._expected.items()
            if own.get(key) != value and key != PROCESSOR
        )

    def _with_other_samples(self, names: Sequence[str]) -> list[str]:
        if not names:
            return []
        self._samples = self._samples or samples_digest(*self._reference)
        digests = self._client.run(samples_digest, *self._reference, workers=list(names))
        return [name for name, samples in digests.items() if samples != self._samples]


class DaskExecutor:
    """A `BatchExecutor` on a cluster."""

    def __init__(
        self, client: Client, at: Cluster, conditions: Conditions, writer: RunWriter
    ) -> None:
        self.most_pending = 2 * at.threads  # no worker waits while files are written here
        self._client, self._cluster, self._writer = client, at, writer
        self._timing = conditions.supervision.timing
        self._setup = pickle.dumps(WorkerSetup.of(conditions), pickle.HIGHEST_PROTOCOL)
        self._run = uuid.uuid4().hex
        self._lost = 0
        self._looked = self._heard = time.monotonic()
        self._pending: dict[Future[None], tuple[Any, frozenset[str]]] = {}  # with usable workers
        self._lock = threading.Lock()

    def submit(self, batch: Sequence[Trial], on_end: OnEnd) -> Future[None]:
        """See `BatchExecutor`."""
        future: Future[None] = Future()
        attempts = {trial.number: self._writer.attempt(trial) for trial in batch}
        usable = frozenset(self._cluster.usable)
        result = self._client.submit(
            execute_remotely,
            self._run,
            self._setup,
            tuple(batch),
            attempts,
            key=f"campaign-{uuid.uuid4().hex}",
            workers=list(usable),
            pure=False,
        )
        self._pending[future] = result, usable
        callback = partial(self._on_result, batch, on_end, future)
        result.add_done_callback(callback)  # type: ignore[no-untyped-call]
        return future

    def look(self) -> None:
        """See `BatchExecutor`. Raises BackendError when scheduler or workers are gone."""
        now = time.monotonic()
        if self._client.status == "running" and self._cluster.usable:
            self._heard = now
        elif now - self._heard > GONE:
            raise BackendError(
                "the scheduler of the cluster, or the last of its workers, is gone; the run can be "
                "resumed"
            )
        if now - self._looked < LOOK or self._client.status != "running":
            return
        self._looked = now
        with suppress(OSError, RuntimeError):  # the connection is being lost
            self._cluster.join()
        self.most_pending = max(1, 2 * self._cluster.threads)
        for result, usable in list(self._pending.values()):
            if not usable & self._cluster.usable.keys():  # the scheduler would wait for them
                self._client.cancel([result])  # type: ignore[no-untyped-call]

    def stop(self) -> None:
        """See `BatchExecutor`."""
        with suppress(OSError, RuntimeError):
            at = list(self._cluster.usable)
            self._client.run(_stop, self._run, workers=at, on_error="ignore")

    def close(self) -> None:
        """End all pending batches."""
        if self._pending:
            self.stop()
            with suppress(Exception):
                left = [result for result, _ in self._pending.values()]
                self._client.cancel(left)  # type: ignore[no-untyped-call]

    def _on_result(
        self, batch: Sequence[Trial], on_end: OnEnd, future: Future[None], result: Any
    ) -> None:
        """Called in a thread of the client."""
        self._pending.pop(future, None)
        if result.status != "finished":
            self._fail(future, result)
            return
        outcome: BatchResult = result.result()
        try:
            with self._lock:
                self._publish(outcome.files)
        except OSError as error:
            part = self._writer.folder / next(iter(outcome.files), "trial")
            future.set_exception(lost_trial(part, error, count=len(outcome.files)))
            return
        outcome.report(batch, on_end, self._timing, future)

    def _fail(self, future: Future[None], result: Any) -> None:
        """Pass on the error of the worker, or WorkerLostError if worker or scheduler is lost."""
        error = None
        with suppress(Exception):
            error = result.exception(timeout=1.0)
        if result.status == "error" and error is not None and not _is_loss(error):
            future.set_exception(error)
            return
        self._lost += 1
        future.set_exception(WorkerLostError(self._lost))

    def _publish(self, files: Mapping[str, bytes]) -> None:
        folder = self._writer.folder.absolute()
        written = []
        for name, content in files.items():
            final = folder / name
            part = final.with_name(name + PART)
            keep_umask()
            part.write_bytes(content)
            written.append((part, final))
        publish_all(written)


# Executed by a worker

_stopped: set[str] = set()
_workers: dict[str, BatchWorker] = {}


def execute_remotely(
    run: str, setup: bytes, batch: Sequence[Trial], attempts: Mapping[int, int]
) -> BatchResult:
    """Execute a batch in a worker of a cluster."""
    worker = _workers.get(run)
    if worker is None:
        processes.tune_memory()
        given: WorkerSetup = pickle.loads(setup)  # noqa: S301 - from a client of the scheduler
        worker = BatchWorker(given, lambda: run in _stopped)
        _workers.clear()
        _workers[run] = worker
    with tempfile.TemporaryDirectory(prefix="campaign-") as folder:
        return worker.execute(batch, attempts, Path(folder), remote=True)


def identity(plug_ins: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Versions, source hashes and processor: what samples depend on besides their trials.

    plug_ins: (room, name) of the plug-ins that the trials use.
    """
    from llvmlite import binding

    features = hashlib.sha256(binding.get_host_cpu_features().flatten().encode()).hexdigest()
    versions = {
        **provenance.versions(),
        "sources": digest(sources_of(["campaign"]))[:16],
        PROCESSOR: f"{binding.get_host_cpu_name()} {features[:12]}",
    }
    rooms = (experiments(), friction_models(), compensation_methods(), backends())
    for room, name in plug_ins:
        plug_in = next(each.plug_in(name) for each in rooms if each.room == room)
        if plug_in is not None:
            sources = digest(sources_of(plug_in.packages))[:16]
            versions[f"{room} {name}"] = f"{plug_in.version} ({sources})"
    return versions


def samples_digest(backend: Backend, trial: Trial) -> str:
    """SHA-256 of all samples of a trial executed in this process."""
    recorder = MemoryRecorder()
    ending = calls.execute(backend, trial, recorder, lambda: False)
    whole = hashlib.sha256()
    recording = recorder.recording(ending)
    for samples in (recording.time, *(recording[name] for name in recording.channels)):
        whole.update(samples.tobytes())
    return whole.hexdigest()


def _stop(run: str) -> None:
    _stopped.add(run)


def _ignore_interrupts() -> None:
    """Ignore Ctrl-C, which also reaches local worker processes; this program ends them."""
    import signal

    with suppress(ValueError):  # not the main thread
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _is_loss(error: BaseException) -> bool:
    from distributed import KilledWorker

    return isinstance(error, KilledWorker | OSError)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise UsageError(
            "--executor needs dask.distributed: pip install 'campaign[dask]'"
        ) from None
    for name in ("distributed", "distributed.client", "tornado"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # this program reports errors itself
    return distributed


def _scheduler(address: str, tls: Path | None) -> tuple[str, Path | None]:
    """Scheduler address in Dask syntax, and the TLS folder. Raises UsageError."""
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise UsageError(f"--executor {address}: is neither 'dask' nor dask://HOST:PORT")
    host, port = match.groups()
    if tls is None and host not in _LOOPBACK:
        raise UsageError(
            f"--executor {address}: anyone who reaches a scheduler can execute code; name a "
            f"folder with {', '.join(CERTIFICATES)} (--executor-tls DIR), or reach it by a "
            "tunnel to localhost"
        )
    return f"{'tcp' if tls is None else 'tls'}://{host}:{port}", tls


def _security(distributed: Any, folder: Path) -> Any:
    ca, certificate, key = (folder / name for name in CERTIFICATES)
    for path in (ca, certificate, key):
        if not path.is_file():
            raise UsageError(f"--executor-tls: {path}: there is no such file")
    return distributed.Security(
        tls_ca_file=str(ca),
        tls_client_cert=str(certificate),
        tls_client_key=str(key),
        require_encryption=True,
    )


def _close(client: Any) -> None:
    with suppress(Exception):
        client.close(timeout=2)
