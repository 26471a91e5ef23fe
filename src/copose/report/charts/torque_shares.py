"""Charts of the joints' shares of their torque limits."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from copose.report.look import LOOK, arm_colors
from copose.report.panels import Panel
from copose.report.words import largest_share, percent, short


@dataclass(frozen=True)
class ShareLook:
    """Sizes of a chart of shares."""

    narrow: float = 0.3  # width of bars below which their values are written upwards, inches
    letters: int = 12  # letters of an arm's name to an inch
    bar: float = 0.92  # width of a bar, as a share of its place
    between: float = 0.8  # between two arms, in places of joints


def share_panels(panels: list[Panel]) -> list[Panel]:
    """Panels whose posture states the torques that hold the object; none beside a nearest miss."""
    if any(panel.misses for panel in panels):
        return []
    return [panel for panel in panels if panel.posture.static_torque]


def draw_shares(
    ax: Axes, panels: list[Panel], *, named: bool, look: ShareLook = ShareLook()
) -> None:
    """Each joint's share of its torque limit to hold the object, by arm; earlier panels in grey,
    and told apart by a legend where they are named.
    """
    shares = [panel.posture.static_torque or {} for panel in panels]
    colors = arm_colors(panels[-1].posture)
    width = look.between / len(panels)
    count = sum(map(len, shares[0].values())) + look.between * len(shares[0])
    inches = ax.get_window_extent().width / ax.get_figure().dpi  # type: ignore[union-attr]
    upwards = inches / count * width < look.narrow
    ticks: list[float] = []
    start = 0.0
    for arm, color in colors.items():
        joints = [start + i for i in range(len(shares[0][arm]))]
        ticks += joints
        for k, by_arm in enumerate(shares):
            places = [x + (k - (len(panels) - 1) / 2) * width for x in joints]
            _draw_bars(ax, places, by_arm[arm], width * look.bar, upwards=upwards,
                       color=color if k + 1 == len(panels) else LOOK.before)  # fmt: skip
        letters = int(look.letters * (len(joints) + look.between) * inches / count)
        ax.text(
            (joints[0] + joints[-1]) / 2, -0.2, short(f"arm {arm}", max(3, min(24, letters))),
            ha="center", va="top", transform=ax.get_xaxis_transform(), fontsize=9, color=color,
        )  # fmt: skip
        start = joints[-1] + 1.8
    ax.axhline(100, color=LOOK.over, linewidth=1.2, linestyle="--")
    ax.text(1, 100, "limit", transform=ax.get_yaxis_transform(), ha="right", va="bottom",
            fontsize=8, color=LOOK.over)  # fmt: skip
    highest = max(100.0, *(100 * largest_share(by_arm) for by_arm in shares))
    ax.set_ylim(0, 1.25 * highest)
    ax.set_xlim(-0.8, start - 0.6)
    numbers = [str(i + 1) for joints in shares[0].values() for i in range(len(joints))]
    ax.set_xticks(ticks, numbers)
    ax.set_yticks([])
    ax.tick_params(axis="x", labelsize=8, length=0)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.set_title("joint torque that holds the object, % of its limit", fontsize=10, loc="left")
    if named:
        names = [short(panel.name) for panel in panels]
        shown = [LOOK.before] * (len(panels) - 1) + [next(iter(colors.values()))]
        patches = [Patch(color=color) for color in shown]
        ax.legend(patches, names, frameon=False, fontsize=9, loc="lower right",
                  bbox_to_anchor=(1, 0.98), ncols=len(panels), borderaxespad=0.1)  # fmt: skip


def _draw_bars(
    ax: Axes, places: list[float], shares: tuple[float, ...], width: float, *, upwards: bool,
    color: str,
) -> None:  # fmt: skip
    """The bars of one arm in one panel, with their values on white: red above the limit."""
    bars = ax.bar(places, [100 * share for share in shares], width, color=color)
    white = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
    words = ax.bar_label(bars, list(map(percent, shares)), fontsize=8, padding=2,
                         rotation=90 if upwards else 0, bbox=white)  # fmt: skip
    for text, share in zip(words, shares, strict=True):
        if share > 1:
            text.set(color=LOOK.over, fontweight="bold")
