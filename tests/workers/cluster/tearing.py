"""Runs that are interrupted again and again, each resuming the previous one."""

from bentray_workers.reconstruction.reconstruction_run import RECONSTRUCTING


class Torn(Exception):
    """Exception that ends the driver half-way."""


def torn_runs(run, patiences):
    """The result of the first run that was not torn, and how far each was when it began.

    ``run`` takes a function to be told of progress; each run is torn after as many reports of the
    reconstruction as the next of ``patiences`` says, and the last one never.
    """
    reached = []
    for patience in (*patiences, 10**6):
        seen = []

        def tear(progress, seen=seen, patience=patience):
            if progress.phase != RECONSTRUCTING:
                return
            seen.append(progress.done)
            if len(seen) > patience:
                raise Torn

        try:
            return run(tear), reached
        except Torn:
            continue
        finally:
            reached.append(seen[0])
    raise AssertionError("every run was torn")
