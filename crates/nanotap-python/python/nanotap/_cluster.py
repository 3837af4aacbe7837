"""Chunks on the workers of a Dask cluster.

A chunk is a pure function of the case, the options and its index: a worker makes the files
of one and sends them back; only this process writes. A chunk whose worker dies is computed
again elsewhere, and what is written stays.
"""

import os
from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from typing import Any, TypeAlias

from . import _nanotap
from ._case import Case

Plan: TypeAlias = tuple[str, Case, dict[str, Any]]

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
    """Computes the chunks that `store` lacks; says whether Ctrl-C stopped it.

    Raises:
        RuntimeError: a chunk lost its worker again and again, or a worker runs another
            version.
    """
    # The client proves that it is there; its functions have no types.
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
    receiver.tidy()
    return False


def _packed(plan: Plan) -> tuple[str, str, Case, tuple[tuple[str, Any], ...]]:
    """A plan that can be sent, and be a key."""
    kind, case, options = plan
    return (
        _nanotap.__version__,
        kind,
        case,
        tuple((k, _hashable(v)) for k, v in options.items()),
    )


def _hashable(value: Any) -> Any:
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(_hashable(entry) for entry in value)
    return value


def chunk_files(
    task: tuple[str, str, Case, tuple[tuple[str, Any], ...]], chunk: int
) -> list[bytes]:
    """The files of one chunk. Runs on a worker."""
    version, kind, case, options = task
    if version != _nanotap.__version__:
        message = (
            f"this worker has nanotap {_nanotap.__version__}, {version} is asked of it"
        )
        raise RuntimeError(message)
    # Dask counts one thread for a task.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return _recipe(kind, case, options).chunk_files(chunk)


@lru_cache(maxsize=4)
def _recipe(
    kind: str, case: Case, options: tuple[tuple[str, Any], ...]
) -> "_nanotap.Recipe":
    from . import _arguments

    given = dict(options)
    given["state"] = _arguments.state(given["state"])
    if kind == "sweep":
        given["over"] = list(given["over"])
        given["sides"] = list(given["sides"])
        return _nanotap.Recipe.sweep(case._core, **given)
    if given["attractors"] is not None:
        given["attractors"] = [list(state) for state in given["attractors"]]
    return _nanotap.Recipe.basin(case._core, **given, threads=1, progress=None)
