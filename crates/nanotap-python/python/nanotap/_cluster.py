"""Chunks on the workers of a Dask cluster.

A chunk is a pure function of the case, the options and its index. A worker computes the files
of a chunk and sends them back; only this process writes. A chunk whose worker dies is computed
again elsewhere, and written files stay.
"""

import os
from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from typing import Any, TypeAlias

from . import _nanotap
from ._case import Case

# A study, its case and its request.
Plan: TypeAlias = tuple[str, Case, str]

# Tasks that wait on the cluster for each of its threads: enough to keep it busy, few enough
# to be dropped at once.
_AHEAD = 4
# How often a chunk may lose its worker. Somebody who takes machines away is no reason to
# give up.
_RETRIES = 20


def compute(
    client: Any,
    recipe: "_nanotap.Recipe",
    plan: Plan,
    store: str,
    hears: Callable[[int, int], object] | None,
) -> bool:
    """Computes the chunks missing in `store`; returns whether Ctrl-C stopped it.

    Raises:
        RuntimeError: a chunk lost its worker repeatedly, or a worker runs another
            version.
    """
    # Dask is installed, since there is a client; its functions have no types.
    distributed: Any = import_module("distributed")
    receiver = recipe.receiver(store)
    missing = receiver.missing
    total = len(missing)
    if hears:
        hears(0, total)
    task = _packed(plan)
    waiting = iter(missing)
    done = 0

    def submit(chunk: int) -> Any:
        return client.submit(
            chunk_files,
            task,
            chunk,
            pure=False,
            retries=_RETRIES,
            key=f"nanotap-{id(task)}-{chunk}",
        )

    ahead = _AHEAD * max(1, sum(client.nthreads().values()))
    running = {
        submit(chunk): chunk for _, chunk in zip(range(ahead), waiting, strict=False)
    }
    completed = distributed.as_completed(list(running), raise_errors=False)
    try:
        for future in completed:
            chunk = running.pop(future)
            receiver.take(chunk, future.result())
            future.release()
            done += 1
            if hears:
                hears(done, total)
            following = next(waiting, None)
            if following is not None:
                new = submit(following)
                running[new] = following
                completed.add(new)
    except KeyboardInterrupt:
        client.cancel(list(running), force=True)
        return True
    except BaseException:
        client.cancel(list(running), force=True)
        raise
    receiver.finish()
    return False


def _packed(plan: Plan) -> tuple[str, str, Case, str]:
    """A plan that can be pickled and used as a key."""
    return (_nanotap.__version__, *plan)


def chunk_files(task: tuple[str, str, Case, str], chunk: int) -> list[bytes]:
    """The files of one chunk. Runs on a worker."""
    version, study, case, request = task
    if version != _nanotap.__version__:
        message = (
            f"this worker has nanotap {_nanotap.__version__}, but {version} is required"
        )
        raise RuntimeError(message)
    # Dask counts one thread for a task.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return _recipe(study, case, request).chunk_files(chunk)


@lru_cache(maxsize=4)
def _recipe(study: str, case: Case, request: str) -> "_nanotap.Recipe":
    return _nanotap.Recipe(study, case._core, request, threads=1)
