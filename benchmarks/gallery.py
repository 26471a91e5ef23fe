"""The gallery: a small picture of every problem's answer, and the page that shows them all.

    python benchmarks/gallery.py [NAME …]

Solves the named problems and runs the named studies, by default all of them, writes
`problems/pictures/gallery/NAME.png`, and makes `problems/README.md` anew of their files. A picture
carries in its text chunks what it is of: a hash of the problem but for its words, and the objective
of the answer drawn. What README and manual show at full size, `problems/pictures/NAME.png`, is made
with them.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

import copose
from copose.report.studies import study_picture
from copose.studies import StudyFolder, StudyTable

ROOT = Path(__file__).parents[1]
PROBLEMS = ROOT / "problems"
PICTURES = PROBLEMS / "pictures/gallery"
PAGE = PROBLEMS / "README.md"
GETTING_STARTED = ROOT / "src/copose/manual/getting-started.md"
WIDTH, MOST_BYTES = 640, 60_000
# The largest file of a picture of the live page, bytes.
LIVE_BYTES = 150_000
GROUPS = {
    "Arms in the plane, and the paper's figures": [
        "paper-fig2", "paper-fig3", "paper-fig4", "push-x", "fast-fine", "two-planar-4r",
    ],
    "Two Pandas and a box: which measure": [
        "two-panda-box", "panda-carry", "panda-worst",
    ],
    "What torque limits allow": ["panda-lift", "panda-payload", "panda-heavy", "xarm-bar"],
    "Cell design": [
        "panda-place-object", "panda-sliding-grasp", "panda-second-base", "panda-three-cases",
    ],
    "Collision, reach and motion": ["panda-walls", "panda-reachable", "panda-carry-path"],
    "Other robots": ["baxter-box", "pr2-box", "talos-box", "tiago-dual"],
}  # fmt: skip
# Pictures of the live page, of which problem or study and what they show.
LIVE = {
    "two-panda-box": ("two-panda-box", "Drag the box by an arrow or an arc: the arms follow."),
    "beyond-reach": (
        "two-panda-box", "Beyond reach the box turns red, and the text says how far off it is."
    ),
    "by-hand": ("two-panda-box", "Arms by hand along self-motions, and the objective there."),
    "baxter-box": ("baxter-box", "Baxter: joints between limits, torques as shares of theirs."),
    "paper-fig4": ("paper-fig4", "Three arms in the plane, seen from above."),
    "panda-carry-path": ("panda-carry-path", "A motion along a path, with its curves over time."),
    "box-over-table": (
        "studies/box-over-table", "The points of a study: a click takes the arms to one of them."
    ),
}  # fmt: skip
# Studies, in `problems/studies`.
STUDIES = [
    "box-over-table", "second-base", "grasp-distance", "payload-one-panda",
    "payload-one-panda-any-way", "payload-two-pandas", "answer-robustness",
]  # fmt: skip
HEAD = """# Problems

Every file here is a complete problem with a comment that says what it shows and what to expect.
Robots come with `pip install '.[robots]'`. Each picture shows the answer to the command beside it,
run in the folder above this one: the posture before, the posture after, and their ellipsoids.

The page and its pictures are made by `python benchmarks/gallery.py`, those of the live page by
`python benchmarks/live_gallery.py`.
"""


def file_of(name: str) -> Path:
    """The problem file, or the study file, of a name."""
    return PROBLEMS / f"studies/{name}.toml" if name in STUDIES else PROBLEMS / f"{name}.toml"


def command(name: str) -> str:
    """The command whose answer the picture shows."""
    if name in STUDIES:
        return f"copose study problems/studies/{name}.toml"
    tables = tomllib.loads(file_of(name).read_text())
    return f"copose {'path' if 'path' in tables else 'solve'} problems/{name}.toml"


def digest(name: str) -> str:
    """A hash of what a problem, or a study, asks, whatever comments and descriptions say."""
    tables = tomllib.loads(file_of(name).read_text())
    if name in STUDIES:
        problem = file_of(name).parent / tables["problem"]
        tables["problem"] = tomllib.loads(problem.read_text())
        tables["problem"].pop("description", None)
    tables.pop("description", None)
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()


def answer(name: str) -> copose.Solution | copose.Motion:
    """The answer that the command gives."""
    problem = copose.load(file_of(name))
    return copose.solve(problem) if problem.path is None else copose.plan(problem)


def picture(name: str, found: copose.Solution | copose.Motion) -> bytes:
    """The picture of an answer, small, with what it is of in its text chunks."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "large.png"
        copose.draw(found, file)
        return reduced(name, file.read_bytes(), found.objective.after)


def study_table(name: str, folder: Path) -> StudyTable:
    """The table of a study that is run in a folder."""
    place = StudyFolder(copose.run_study(file_of(name), folder))
    return StudyTable.of(place.study(), place)


def map_of(name: str) -> bytes:
    """The picture of a study, small, with what it is of in its text chunks."""
    with tempfile.TemporaryDirectory() as folder:
        table = study_table(name, Path(folder))
        best = table.numbers["objective"][table.best(1)[0]]
        return reduced(name, study_picture(table, "png"), float(best))


def reduced(name: str, drawn: bytes, objective: float | None) -> bytes:
    """A picture as the gallery has it: small, with what it is of in its text chunks."""
    with Image.open(io.BytesIO(drawn)) as large:
        height = round(large.height * WIDTH / large.width)
        small = large.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS)
    told = PngInfo()
    told.add_text("problem", digest(name))
    told.add_text("objective", json.dumps(objective))
    for colours in (256, 128, 64, 32):
        # The rarest colours count, those of arms and lines; then palettes come nearer to all.
        few = small.quantize(
            colours, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE
        )
        sink = io.BytesIO()
        few.save(sink, "png", optimize=True, pnginfo=told)
        if sink.tell() < MOST_BYTES:
            return sink.getvalue()
    raise ValueError(f"{name}: the picture is larger than {MOST_BYTES} bytes")


def full_size() -> dict[str, Callable[[], copose.Solution | copose.Motion]]:
    """What README and manual show at full size."""

    def exact() -> copose.Solution:
        problem = copose.load(file_of("panda-lift"))
        return copose.evaluate(problem, copose.solve(problem))

    def first() -> copose.Solution:
        tables = GETTING_STARTED.read_text().partition("```toml cell.toml\n")[2].partition("```")[0]
        return copose.solve(copose.parse(tomllib.loads(tables)))

    return {
        "paper-fig2": lambda: answer("paper-fig2"),
        "panda-lift": exact,
        "panda-carry-path": lambda: answer("panda-carry-path"),
        "two-ur5": first,
    }


def page() -> str:
    """The page, of the problem files."""
    lines = [HEAD]
    for title, names in GROUPS.items():
        lines += [f"## {title}", "", "| picture | problem |", "| --- | --- |"]
        for name in names:
            words = tomllib.loads(file_of(name).read_text())["description"]
            shown = f'<img src="pictures/gallery/{name}.png" width="420" alt="{name}">'
            lines.append(f"| {shown} | [{name}]({name}.toml): {words}<br>`{command(name)}` |")
        lines.append("")
    lines += ["## Studies", "", "Many problems each; [studies](../src/copose/manual/studies.md)."]
    lines += ["", "| picture | study |", "| --- | --- |"]
    for name in STUDIES:
        words = tomllib.loads(file_of(name).read_text())["description"]
        shown = f'<img src="pictures/gallery/{name}.png" width="420" alt="{name}">'
        lines.append(f"| {shown} | [{name}](studies/{name}.toml): {words}<br>`{command(name)}` |")
    lines.append("")
    lines += ["## On the live page", "", "| picture | command |", "| --- | --- |"]
    for name, (problem, words) in LIVE.items():
        shown = f'<img src="pictures/live-{name}.png" width="600" alt="{words}">'
        command_line = f"copose live problems/{problem}.toml"
        if problem.startswith("studies/"):
            command_line = f"copose study problems/{problem}.toml --view"
        lines.append(f"| {shown} | {words}<br>`{command_line}` |")
    return "\n".join([*lines, ""])


def main() -> None:
    """Make pictures and the page."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    every = [name for names in GROUPS.values() for name in names]
    parser.add_argument("names", nargs="*", metavar="NAME", help="pictures (default: all)")
    PICTURES.mkdir(parents=True, exist_ok=True)
    names = parser.parse_args().names or [*every, *STUDIES, "two-ur5"]
    for name in names:
        if name in STUDIES:
            content = map_of(name)
            (PICTURES / f"{name}.png").write_bytes(content)
            print(f"{name}: {len(content)} bytes")
        if name in every:
            found = answer(name)
            content = picture(name, found)
            (PICTURES / f"{name}.png").write_bytes(content)
            print(f"{name}: {found.status}, {found.objective.after}, {len(content)} bytes")
        if name in full_size():
            copose.draw(full_size()[name](), PROBLEMS / f"pictures/{name}.png")
    PAGE.write_text(page())


if __name__ == "__main__":
    main()
