"""A page on which the object is dragged and the arms follow at their best."""

from copose.live.handle import LivePage, open_live, open_study

__all__ = ["LivePage", "open_live", "open_study"]
