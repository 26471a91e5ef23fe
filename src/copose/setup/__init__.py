"""A first problem file for robots that have none: arms, bases, object, grasps, commented TOML."""

from copose.setup.problem_draft import Draft, Wishes, default_name, draft

__all__ = ["Draft", "Wishes", "default_name", "draft"]
