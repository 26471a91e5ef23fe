"""Bars of torque shares."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from copose.report import style
from copose.report.style import Panel

# Bars narrower than this, inches, have their values written upwards.
_NARROW = 0.3
# Letters of an arm's name to an inch.
_LETTERS = 12
# Values stand on the line of the limit.
_ROOM = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}


def share_panels(panels: list[Panel]) -> list[Panel]:
    """Those whose posture states what torque holds the object; none beside a nearest miss."""
    if any(panel.name == style.MISS for panel in panels):
        return []
    return [panel for panel in panels if panel.posture.static_torque]


def draw_shares(ax: Axes, panels: list[Panel], named: bool) -> None:
    """Each joint's share of its torque limit to hold the object, by arm; earlier panels in grey.

    Args:
        ax: where.
        panels: of `share_panels`.
        named: whether a legend says which they are.
    """
    shares = [panel.posture.static_torque or {} for panel in panels]
    width = 0.8 / len(panels)
    colors = style.arm_colors(panels[-1].posture)
    count = sum(map(len, shares[0].values())) + 0.8 * len(shares[0])
    inches = ax.get_window_extent().width / ax.get_figure().dpi  # type: ignore[union-attr]
    upwards = inches / count * width < _NARROW
    ticks: list[float] = []
    start = 0.0
    for arm, color in colors.items():
        joints = [start + i for i in range(len(shares[0][arm]))]
        ticks += joints
        letters = max(3, min(24, int(_LETTERS * (len(joints) + 0.8) * inches / count)))
        for k, each in enumerate(shares):
            bars = ax.bar(
                [x + (k - (len(panels) - 1) / 2) * width for x in joints],
                [100 * share for share in each[arm]], width * 0.92,
                color=color if k + 1 == len(panels) else style.BEFORE,
            )  # fmt: skip
            words = ax.bar_label(bars, list(map(style.percent, each[arm])), fontsize=8, padding=2,
                                 rotation=90 if upwards else 0, bbox=_ROOM)  # fmt: skip
            for text, share in zip(words, each[arm], strict=True):
                if share > 1:
                    text.set(color=style.OVER, fontweight="bold")
        ax.text(
            (joints[0] + joints[-1]) / 2, -0.2, style.short(f"arm {arm}", letters), ha="center",
            va="top", transform=ax.get_xaxis_transform(), fontsize=9, color=color,
        )  # fmt: skip
        start = joints[-1] + 1.8
    ax.axhline(100, color=style.OVER, linewidth=1.2, linestyle="--")
    ax.text(1, 100, "limit", transform=ax.get_yaxis_transform(), ha="right", va="bottom",
            fontsize=8, color=style.OVER)  # fmt: skip
    highest = max(100.0, *(100 * style.largest_share(each) for each in shares))
    ax.set_ylim(0, 1.25 * highest)
    ax.set_xlim(-0.8, start - 0.6)
    ax.set_xticks(ticks, [str(i + 1) for mine in shares[0].values() for i in range(len(mine))])
    ax.set_yticks([])
    ax.tick_params(axis="x", labelsize=8, length=0)
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    ax.set_title("joint torque that holds the object, % of its limit", fontsize=10, loc="left")
    if named:
        names = [style.short(panel.name) for panel in panels]
        shown = [style.BEFORE] * (len(panels) - 1) + [next(iter(colors.values()))]
        patches = [Patch(color=color) for color in shown]
        ax.legend(patches, names, frameon=False, fontsize=9, loc="lower right",
                  bbox_to_anchor=(1, 0.98), ncols=len(panels), borderaxespad=0.1)  # fmt: skip
