"""Work on other machines: a Dask scheduler, what its workers must be, results as they finish.

Dask moves the work when a worker dies. What is added here: workers of another build are refused, so
that results have the same bits as local ones; what waits is bounded; and every way in which the
scheduler or its workers can fail ends in one line that says what to do.
"""

from __future__ import annotations

import queue
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar, cast

from dualdrive.build import fingerprint
from dualdrive.mapper import Mapper, Threads

if TYPE_CHECKING:
    from distributed import Client, Future

__all__ = ["Cluster", "SchedulerError", "connected", "mapper_for"]

T = TypeVar("T")
R = TypeVar("R")
Job = tuple[Any, ...]

CONNECT = 10.0  # s to wait for a scheduler's answer
PATIENCE = 30.0  # s without any worker: a nanny has put a new one in a dead one's place by then
_TICK = 0.2  # s between looks at the scheduler and at Ctrl-C


class SchedulerError(RuntimeError):
    """A scheduler or its workers that can't do the work. The message is one line."""


@contextmanager
def connected(scheduler: str | Client) -> Iterator[Cluster]:
    """Connect to a scheduler by its address, or use a client that is connected.

    Raises SchedulerError where nobody answers, no worker is there, or workers are of another build.
    """
    try:
        from distributed import Client
    except ImportError:
        raise SchedulerError(
            f"scheduler = {scheduler!r}: needs Dask; pip install 'dualdrive[distributed]'"
        ) from None
    if isinstance(scheduler, Client):
        yield Cluster(scheduler, scheduler.scheduler.address)
        return
    try:
        _check_address(scheduler)
        client = Client(scheduler, timeout=CONNECT, set_as_default=False, name="dualdrive")
    except (OSError, ValueError) as error:
        why = str(error) if isinstance(error, ValueError) else "nobody answers there"
        raise SchedulerError(
            f"scheduler = {scheduler!r}: {why}; begin one with 'dask scheduler' and give the "
            "address it prints, tcp://HOST:8786, or leave it out to compute here"
        ) from None
    try:
        yield Cluster(client, scheduler)
    finally:
        with suppress(OSError, RuntimeError):
            client.close(timeout=2)


def _check_address(scheduler: str) -> None:
    """Raise ValueError unless it is one: a client would try it for long, and not end well."""
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    scheme, place = parse_address(scheduler)
    get_backend(scheme)
    parse_host_port(place)


@contextmanager
def mapper_for(scheduler: str | Client | None) -> Iterator[Mapper]:
    """Threads of this process, or the workers of a scheduler. Raises SchedulerError."""
    if scheduler is None:
        yield Threads()
        return
    with connected(scheduler) as cluster:
        yield cluster


class Cluster:
    """The workers of a scheduler, all of this build. A `dualdrive.mapper.Mapper`."""

    near = False

    def __init__(self, client: Client, name: str) -> None:
        self._client, self._name = client, name
        self._threads, self._counted, self._seen = 0, -1.0, time.monotonic()
        self._kept: dict[int, tuple[Any, Future[Any]]] = {}
        self._await_workers()
        _refuse_other_builds(client, name)

    # --- work ---------------------------------------------------------------------------------

    def keep(self, value: T) -> T:
        """A future of the value: every worker process gets it once and shares it among its threads.

        The scheduler holds the recipe, so that a worker which dies takes no value with it.
        """
        if id(value) not in self._kept:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "Sending large graph")  # that is what this is for
                future = self._client.submit(_same, value, pure=False)
            self._kept[id(value)] = (value, future)  # held, so that its id stays its own
        # Dask puts the value in the place of its future where a job is computed
        return cast("T", self._kept[id(value)][1])

    def as_finished(
        self, do: Callable[..., R], jobs: Iterable[Job], stop: threading.Event | None = None
    ) -> Iterator[tuple[int, R]]:
        """Yield (number of the job, do(*job)) as they finish; jobs are taken as there is room.

        At most two jobs per thread of the workers are under way. Those of a lost worker are begun
        again elsewhere. When `stop` is set, no job is begun any more and those under way are still
        handed over. An exception of a job is raised here.

        Raises SchedulerError when the scheduler or all workers are lost, or they die of a job.
        """
        ready: queue.SimpleQueue[Future[R]] = queue.SimpleQueue()
        waiting = enumerate(jobs)
        running: dict[Any, tuple[int, Future[R]]] = {}
        try:
            while True:
                if stop is not None and stop.is_set():
                    self._withdraw(running)
                else:
                    for k, job in islice(waiting, max(0, 2 * self.threads - len(running))):
                        future = self._client.submit(_run, fingerprint(), do, *job, pure=False)
                        running[future.key] = (k, future)
                        future.add_done_callback(ready.put)
                if not running:
                    return
                with suppress(queue.Empty):
                    future = ready.get(timeout=_TICK)
                    found: list[R] = self._result(future, ready) if future.key in running else []
                    for result in found:
                        yield running.pop(future.key)[0], result
                self._look()
        finally:
            self._forget(running)

    def _result(self, future: Future[R], ready: queue.SimpleQueue[Future[R]]) -> list[R]:
        """The result, in a list; nothing where it was lost on its way and is computed again."""
        from distributed import CancelledError, KilledWorker

        try:
            return [future.result(timeout=CONNECT)]
        except TimeoutError:
            future.add_done_callback(ready.put)
            return []
        except CancelledError:
            raise self._lost() from None
        except KilledWorker as error:
            raise SchedulerError(
                f"{self._name}: {error.allowed_failures + 1} workers died of the same work, the "
                f"last was {error.last_worker.address}; see its log, give workers more memory"
            ) from None
        except ModuleNotFoundError as error:
            raise SchedulerError(f"{self._name}: a worker that joined has {error}") from None

    def _withdraw(self, running: dict[Any, tuple[int, Future[R]]]) -> None:
        """Take back what no thread has begun; one that is not known there yet, at the next look."""
        with suppress(OSError, TimeoutError, KeyError):
            stacks = self._client.call_stack(keys=list(running))
            begun = {key for own in stacks.values() for key in own}
            self._forget(
                {
                    key: running.pop(key)
                    for key, (_, future) in list(running.items())
                    if key not in begun and not future.done()
                }
            )

    def _forget(self, jobs: dict[Any, tuple[int, Future[R]]]) -> None:
        if jobs and self._client.status == "running":
            with suppress(OSError, TimeoutError):
                self._client.cancel([future for _, future in jobs.values()])

    # --- the state of the cluster -------------------------------------------------------------

    @property
    def threads(self) -> int:
        """Threads of all workers, counted anew every second: workers come and go."""
        self._look()
        return self._threads

    def _look(self) -> None:
        """Count threads if that is due. Raises SchedulerError when nobody is left to work."""
        now = time.monotonic()
        if self._client.status != "running":
            raise self._lost()
        if now < self._counted + 1.0:
            return
        try:
            self._threads = sum(self._client.nthreads().values())
        except (OSError, TimeoutError):
            raise self._lost() from None
        self._counted = now
        if self._threads:
            self._seen = now
        elif now > self._seen + PATIENCE:
            raise SchedulerError(
                f"{self._name}: no worker is left, for {PATIENCE:.0f} s; begin some with "
                f"'dask worker {self._name}'"
            )

    def _lost(self) -> SchedulerError:
        return SchedulerError(
            f"{self._name}: the scheduler was lost; begin it and its workers anew"
        )

    def _await_workers(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=CONNECT)
        except TimeoutError:
            raise SchedulerError(
                f"{self._name}: the scheduler has no workers; begin some with "
                f"'dask worker {self._name}'"
            ) from None


def _same(value: T) -> T:
    return value


def _run(expected: dict[str, str], do: Callable[..., R], *job: Any) -> R:
    """On the worker: it may have joined after the others were looked at."""
    if fingerprint() != expected:
        raise SchedulerError(
            f"a worker that joined differs: {_difference(fingerprint(), expected)}"
        )
    return do(*job)


def _refuse_other_builds(client: Client, name: str) -> None:
    """Raise SchedulerError unless all workers compute what this process would, to the last bit."""
    here = fingerprint()
    versions: dict[str, Any] = client.get_versions()["workers"]
    for worker, own in versions.items():
        python = ".".join(own["host"]["python"].split(".")[:2])
        if python != here["python"]:  # nothing else could be asked in a language it does not speak
            raise _other(name, worker, f"python {python} there, {here['python']} here")
    for worker, there in client.run(_question()).items():
        if there is None:
            raise _other(name, worker, "dualdrive is not installed there")
        if there != here:
            raise _other(name, worker, _difference(there, here))


def _question() -> Callable[[], dict[str, str] | None]:
    """A function that a worker without dualdrive can answer: a nested one travels whole."""

    def build() -> dict[str, str] | None:
        try:
            from dualdrive.build import fingerprint

            return fingerprint()
        except ModuleNotFoundError as error:
            return None if error.name == "dualdrive" else {"dualdrive": f"without {error.name}"}
        except Exception as error:  # whatever ails it there is to be told here
            return {"dualdrive": f"that does not load ({error})"}

    return build


def _difference(there: dict[str, str], here: dict[str, str]) -> str:
    """The first thing that differs; one side may not say all that the other does."""
    name = next(name for name in (*there, *here) if there.get(name) != here.get(name))
    return f"{name} {there.get(name, 'unknown')} there, {here.get(name, 'unknown')} here"


def _other(name: str, worker: str, difference: str) -> SchedulerError:
    return SchedulerError(
        f"{name}: worker {worker}: {difference}; install the same build on every machine, for only "
        "that gives the same bits"
    )
