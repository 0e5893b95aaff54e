"""Spanning tree of bodies and joints, and the edges that close loops.

The nodes are rigid bodies, and the edges are joints and links.  An elastic body has a
node ``(name, False)`` at the start of its link, which has only one joint, and a node
``(name, True)`` at the end of its link.
"""

import heapq
from collections.abc import Mapping
from dataclasses import dataclass

from forcefit.assembly.drawing.drawing import Drawing, DrawnBody, DrawnJoint
from forcefit.assembly.model.robot import BASE
from forcefit.inputs.table import BadInput, quoted

Node = tuple[str, bool]
ROOT: Node = (BASE, True)


@dataclass(frozen=True, eq=False)
class Edge:
    """Edge of the graph: a joint, or the link of an elastic body.

    Attributes:
        item: the joint or the elastic body.
        first: node at the start, which is the first body of a joint.
        second: node at the end.
    """

    item: DrawnJoint | DrawnBody
    first: Node
    second: Node


@dataclass(frozen=True, eq=False)
class Step:
    """Edge with its direction in the spanning tree.

    Attributes:
        edge: the edge.
        reverse: whether the direction is from the second to the first node.
        closes: whether the edge closes a loop.
    """

    edge: Edge
    reverse: bool
    closes: bool

    @property
    def start(self) -> Node:
        """Node from which the edge is traversed."""
        return self.edge.second if self.reverse else self.edge.first

    @property
    def end(self) -> Node:
        """Node to which the edge is traversed."""
        return self.edge.first if self.reverse else self.edge.second


def steps_of(drawing: Drawing) -> list[Step]:
    """Return all edges, in the order in which frames are created.

    The path from the base to each node has the smallest possible number of reversed
    edges, and then the smallest possible number of joints.

    Args:
        drawing: bodies and joints.

    Returns:
        Edges in depth-first order.

    Raises:
        BadInput: no joint connects a body to the base.
    """
    edges = _edges(drawing)
    around: dict[Node, list[Edge]] = {ROOT: []}
    for edge in edges:
        for node in (edge.first, edge.second):
            around.setdefault(node, []).append(edge)
    entered = _entered(around)
    for body in drawing.bodies:
        if (body.name, True) not in entered:
            raise BadInput(
                f"body {quoted(body.name)}: found no chain of joints that connects it "
                f'to "{BASE}", expected at least one'
            )
    order: list[Step] = []
    waiting = [ROOT]
    while waiting:
        node = waiting.pop()
        steps = [s for e in around[node] if (s := _step(e, node, entered))]
        if node != ROOT:
            order.append(Step(entered[node], entered[node].second != node, False))
        order += [step for step in steps if step.closes]
        waiting += [step.end for step in reversed(steps) if not step.closes]
    return order


def _step(edge: Edge, node: Node, entered: Mapping[Node, Edge]) -> Step | None:
    """Return the step from a node along an edge, or None if there is no such step."""
    reverse = edge.second == node
    if entered.get(edge.first if reverse else edge.second) is edge:
        return Step(edge, reverse, False)
    if entered.get(node) is edge or reverse:
        return None
    return Step(edge, False, True)


def _edges(drawing: Drawing) -> list[Edge]:
    """Return joints in the order of the file, with each link after its first joint."""
    bodies = {body.name: body for body in drawing.bodies}

    def node(name: str, joint: DrawnJoint) -> Node:
        body = bodies.get(name)
        ends = body.ends if body else None
        return name, ends is None or ends[0] != joint.name

    edges = []
    for joint in drawing.joints:
        edges.append(Edge(joint, node(joint.first, joint), node(joint.second, joint)))
        for name in (joint.first, joint.second):
            body = bodies.get(name)
            if body and body.ends and body.ends[0] == joint.name:
                edges.append(Edge(body, (name, False), (name, True)))
    return edges


def _entered(around: Mapping[Node, list[Edge]]) -> dict[Node, Edge]:
    """Return the edge by which the spanning tree reaches each node."""
    entered: dict[Node, Edge] = {}
    reached: set[Node] = set()
    count = 0  # number of added edges, by which paths of equal length are sorted
    waiting: list[tuple[int, int, int, Node, Edge | None]] = [(0, 0, 0, ROOT, None)]
    while waiting:
        against, length, _, node, by = heapq.heappop(waiting)
        if node in reached:
            continue
        reached.add(node)
        if by is not None:
            entered[node] = by
        for edge in around[node]:
            reverse = edge.second == node
            count += 1
            steps = length + isinstance(edge.item, DrawnJoint)
            end = edge.first if reverse else edge.second
            heapq.heappush(waiting, (against + reverse, steps, count, end, edge))
    return entered
