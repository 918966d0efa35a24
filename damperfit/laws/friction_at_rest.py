"""What becomes of friction that is larger at rest in a law that has no more there."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from damperfit.damper.model import Model, Values

__all__ = ["AT_REST", "with_whole_friction"]

AT_REST = "breakaway"


def with_whole_friction(near: Values, model: Model) -> Values:
    """Return values whose friction is all that they have at rest, where a law has no more there.

    Of the friction that slides next to nothing may be left beside it: what is nothing has no slope,
    and no descent leads back.

    Parameters
    ----------
    near : Values
        Of a law fitted before.
    model : Model
        The law.
    """
    if AT_REST not in near.names or AT_REST in model.names:
        return near
    name = next(one.name for one in near.quantities if one.is_friction)
    return near.replace({name: getattr(near, name) + getattr(near, AT_REST)})
