"""Background threads for tasks of long jobs: the system gives them what pictures and short jobs leave."""

import os
import sys
import threading
from collections.abc import Callable
from contextvars import copy_context
from typing import Any

from distributed.threadpoolexecutor import ThreadPoolExecutor

from .task_cancellation import carry_cancellation

# Niceness above that of the process: a thread has a tenth of the weight of one that draws.
NICENESS = 10
# Tasks of all workers of this process at a time.
MAX_THREADS = 16

# Dask's, whose threads do not delay the end of the process.
_THREADS = ThreadPoolExecutor(MAX_THREADS, thread_name_prefix="bentray-background")


def in_background(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a background thread, with the context of this one, and return what it returns."""
    context = copy_context()
    context.run(carry_cancellation)
    return _THREADS.submit(context.run, _lowered, function, *arguments).result()


def _lowered(function: Callable[..., Any], *arguments: Any) -> Any:
    # Other systems know priorities of processes only. A thread that is lowered may not be raised again.
    if sys.platform == "linux":
        thread = threading.get_native_id()
        lowest = os.getpriority(os.PRIO_PROCESS, os.getpid()) + NICENESS
        if os.getpriority(os.PRIO_PROCESS, thread) < lowest:
            os.setpriority(os.PRIO_PROCESS, thread, lowest)
    return function(*arguments)
