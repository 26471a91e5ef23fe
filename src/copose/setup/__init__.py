"""A first problem file for robots that have none: arms, bases, object, grasps, commented TOML."""

from copose.setup.problem_writer import Wishes, default_name, draft

__all__ = ["Wishes", "default_name", "draft"]
