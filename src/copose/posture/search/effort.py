"""Effort of a search: how many postures, combinations and placements are tried, and its options."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

from copose.posture.local.multistart import ClimbOptions

EffortName: TypeAlias = Literal["low", "normal", "high"]


@dataclass(frozen=True)
class CombinationOptions:
    """Options of combining the arms' postures."""

    differing: float = 0.3  # rad or m in some joint: starts that differ by less count as one
    looked_through: int = 64  # combinations, per start, in which a differing one is looked for
    plain_spare: int = 8  # degrees of freedom to spare, of all arms, up to which no start is saved
    fewest_starts: int = 4  # climbed from, however many degrees of freedom are to spare
    kinked_starts: int = 2  # times as many starts beside kinks, where gains differ more
    surface_starts: int = 2  # times as many where arms have more than one degree to spare each
    surface_responses: int = 2  # times as many of each arm's postures that climb alone there
    sampled_starts: int = 4  # times as many where an objective climbs by itself from samples
    judged_ends: int = 16  # best ends of which linear programs can judge all pairs
    random: int = 64  # combinations drawn where bodies and the end of the call leave no other


@dataclass(frozen=True)
class PlacementOptions:
    """Options of a search that moves the object, bases or grasps too."""

    one: int = 32  # placements with one free coordinate, twice as many with each more
    most: int = 128  # placements at most
    climbed: int = 96  # postures that are climbed from with everything free, each by a program
    raced: int = 400  # the same where Newton steps climb from all at once
    # Steps after which no more climbs go on than so many; and alike where ends are searched anew.
    race: tuple[tuple[int, int], ...] = ((6, 160), (10, 80), (14, 40), (18, 20))
    last_race: tuple[tuple[int, int], ...] = ((3, 64), (6, 32), (10, 16), (14, 8))
    finished: int = 8  # ends of Newton steps that programs go on from where a score stands in
    certified: int = 2  # best optima of which those that Newton steps stalled at are solved
    costly: int = 2  # times fewer of both where a climb takes many programs
    glanced: int = 3  # climbs at each placement where each takes a program
    insistence: int = 3  # times as many placements are drawn where hardly half let the arms close
    few: float = 0.25  # share of placements with closed arms below which others are looked for
    refined: int = 24  # best placements around which others are tried before anything climbs
    between: int = 2  # placements around each
    nearer: tuple[float, ...] = (0.08, 0.03)  # of the ranges, within which they are drawn in turn
    rounds: int = 4  # of searching anew where climbs ended
    ends: int = 8  # best ends of different placements at which a round searches
    searched: int = 4  # of them, at which postures are sampled anew
    one_place: float = 0.02  # of the ranges, by which such placements differ
    around: int = 8  # placements drawn around the best end
    near: float = 0.1  # of the ranges within which they are drawn
    other: float = 0.1  # rad or m, by which a posture differs for which an end exchanges its own
    exchanged: int = 8  # postures of one arm at most for which an end exchanges its own
    best_around: int = 2  # of them that are climbed from
    looked_through: int = 256  # combinations of a placement in which differing ones are looked for
    near_best: float = 1e-2  # of the best, within which such an end matters
    of_each: int = 8  # starts of one placement; best postures of a case that are combined
    of_each_end: int = 4  # the same where climbs have ended
    multiplied: int = 4  # cases at most of which all combinations of the best are tried
    differing: float = 0.3  # rad, m or share of a range: starts that differ by less count as one
    same: float = 1e-3  # alike, of ends


@dataclass(frozen=True)
class Effort:
    """Effort of one search: how much is tried, and its options.

    Attributes:
        name: as results state it.
        batch: random postures drawn at a time for an arm.
        batches: of them, at most.
        loops: postures kept of an arm with one degree of freedom to spare, at most.
        surfaces: postures kept of an arm with more.
        starts: random combinations that exchange improves where there are more than two arms.
        polished: combinations that are polished.
        rounds: of combining anew what was polished, at most.
        insistence: random postures of an arm that are drawn before it is said to miss its grasp.
        measured: best results so far that are measured where a call has to end.
        complete: whether slices are to meet every self-motion, beside random postures.
        combining: options of combining the arms' postures.
        climbing: options of local searches.
        placing: options of moving the object, bases and grasps.
    """

    name: str
    batch: int
    batches: int
    loops: int
    surfaces: int
    starts: int
    polished: int
    rounds: int
    insistence: int = 4096
    measured: int = 4
    complete: bool = False
    combining: CombinationOptions = CombinationOptions()
    climbing: ClimbOptions = field(default_factory=ClimbOptions)
    placing: PlacementOptions = PlacementOptions()

    def doubled(self) -> Effort:
        """Twice as many samples, starts and rounds; batches are as large as before."""
        return replace(
            self,
            batches=2 * self.batches,
            loops=2 * self.loops,
            surfaces=2 * self.surfaces,
            starts=2 * self.starts,
            polished=2 * self.polished,
            rounds=2 * self.rounds,
        )


EFFORTS: dict[EffortName, Effort] = {
    "low": Effort(
        name="low", batch=64, batches=4, loops=120, surfaces=150, starts=32, polished=8, rounds=0,
        placing=PlacementOptions(one=16, most=64, climbed=24, refined=8),
    ),
    "normal": Effort(
        name="normal", batch=96, batches=8, loops=240, surfaces=300, starts=96, polished=24,
        rounds=2,
    ),
    "high": Effort(
        name="high", batch=256, batches=16, loops=480, surfaces=1200, starts=384, polished=160,
        rounds=6, placing=PlacementOptions(one=128, most=1024, climbed=512, refined=48),
    ),
}  # fmt: skip
