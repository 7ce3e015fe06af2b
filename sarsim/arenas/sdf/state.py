"""The ``<state>`` of a world: the poses of models and links when Gazebo saved the world."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


@dataclass(frozen=True, eq=False)
class State:
    """The saved state of a model or a world.

    Attributes:
        element: element that contains the states of the links and nested models; None if there is none.
        prefix: prefix of the names of links and nested models in ``element``; versions of Gazebo before 7 write the
            states of all nested models into the outermost model's state.
        pose: element that contains the model's own pose; None if there is none.
    """

    element: "Element | None" = None
    prefix: str = ""
    pose: "Element | None" = None

    def of_link(self, name: str) -> "Element | None":
        """The element with the world pose of a link; None if there is none."""
        return self._named("link", name)

    def of_model(self, name: str) -> "State":
        """The state of a model nested in this model or world."""
        own = self._named("model", name)
        return State(self.element, f"{self.prefix}{name}::") if own is None else State(own, "", own)

    def _named(self, tag: str, name: str) -> "Element | None":
        found = [] if self.element is None else self.element.findall(tag)
        posed = (e for e in found if e.get("name") == f"{self.prefix}{name}" and e.find("pose") is not None)
        return next(posed, None)


def world_state(world: "Element") -> State:
    """The state of a world: as in Gazebo, the first ``<state>``."""
    return State(world.find("state"))


def children_of(world: "Element") -> "Iterator[Element]":
    """Yield the children of a world and the elements that its state inserts, except models that its state deletes."""
    state = world.find("state")
    deleted = set() if state is None else {(e.text or "").strip() for e in state.iterfind("deletions/name")}
    inserted = [] if state is None else list(state.iterfind("insertions/*"))
    for child in (*world, *inserted):
        name = child.get("name") or (child.findtext("name") or "").strip()
        if child.tag not in ("model", "include") or name not in deleted:
            yield child
