"""A cell in three dimensions: looks of robots, ellipsoids and the object in a viser scene."""

from copose.viewer.looks import Look, link_looks
from copose.viewer.result_page import page_html
from copose.viewer.scene import CellScene
from copose.viewer.server import quiet_server, stop

__all__ = ["CellScene", "Look", "link_looks", "page_html", "quiet_server", "stop"]
