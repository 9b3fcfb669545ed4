"""A circular queue of buckets of nodes by time, unordered within a bucket (Yatziv et al. 2006).

Bucket ``int(time / width) % buckets`` is a doubly linked list, so that a node moves when its time falls.
Nodes are removed by bucket, not by time, at a cost independent of the length of the queue. Arrays: ``heads``
has the last entered node of each bucket, ``links`` the nodes before and after each, ``place`` the bucket of
each node, or ``FAR`` or ``DONE`` as in ``heap``. Node 0 lies in the border, is never entered, and ends a
list.
"""

from ..compilation.compiled import int64, kernel
from .heap import DONE, FAR, Nodes


@kernel(inline="always")
def enter(heads: Nodes, links: Nodes, place: Nodes, width: float, node: int, time: float) -> int:
    """Enter a node, or move one to the bucket of its earlier time; returns the number of nodes entered."""
    bucket = int(time / width) % heads.size
    old = int64(place[node])
    if old == bucket:
        return 0
    if old != FAR:
        unlink(heads, links, node, old)
    first = heads[bucket]
    links[node, 0] = 0
    links[node, 1] = first
    links[first, 0] = node
    heads[bucket] = node
    place[node] = bucket
    return 1 if old == FAR else 0


@kernel(inline="always")
def unlink(heads: Nodes, links: Nodes, node: int, bucket: int) -> None:
    before = links[node, 0]
    after = links[node, 1]
    if before == 0:
        heads[bucket] = after
    else:
        links[before, 1] = after
    links[after, 0] = before


@kernel(inline="always")
def take(heads: Nodes, links: Nodes, place: Nodes, bucket: int) -> int:
    """Take out the last entered node of a bucket that has one."""
    node = int64(heads[bucket])
    unlink(heads, links, node, bucket)
    place[node] = DONE
    return int(node)
