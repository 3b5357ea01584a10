"""Pictures of a saved result: the string and its rotation, its history, spectra, waves, the rock, a film.

Reads result folders only (`drillfem.results.open_result`). Charts need matplotlib, the string needs pyvista;
neither needs a display.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from drillfem.errors import SceneError

__all__ = ["render_all", "render_result"]


def render_all(
    folder: str | Path,
    time: float | Sequence[float] | None = None,
    field: str | None = None,
    film: bool = False,
    windows: Sequence[tuple[float, float]] | None = None,
) -> list[Path]:
    """Make the pictures of the result in ``folder`` and put them into ``folder``/pictures.

    Args:
        folder: a result folder.
        time: which moment to show, s; the saved pose next to it is taken, the last one by default. Several: pictures
            of a well compare them, the others show the last of them.
        field: scalar field that colours the string; the most telling one by default.
        film: make string.gif as well.
        windows: times (s) between which spectra are taken; `drillfem.results.windows` by default.

    Returns:
        The files written: time-series.png, spectra.png, space-time.png, rock.png (those that apply),
        string.png, string-true.png, and string.gif. For a string in a curved hole, in the place of string-true.png:
        well.png, clearance.png, along.png, directors.png.

    Raises:
        SceneError: no result there, an unknown field, or a time or window outside the run.
        MissingDependency: pyvista is not installed; the charts are made all the same.
    """
    from drillfem.results import open_result

    return render_result(open_result(folder), Path(folder) / "pictures", time, field, film, windows)


def render_result(
    result: Any,
    pictures: Path,
    time: float | Sequence[float] | None = None,
    field: str | None = None,
    film: bool = False,
    windows: Sequence[tuple[float, float]] | None = None,
) -> list[Path]:
    """As `render_all` for a `drillfem.results.Result` in memory; ``pictures`` is made if it is not there."""
    from drillfem.render import charts
    from drillfem.render.story import Story

    story = Story(result)
    charts.looked_at(story, windows)
    if story.fields is None:
        if field is not None or time is not None or film:
            raise SceneError("this result has no saved fields, so there is no string to show or film")
        index, chosen, shown = -1, None, []
    else:
        asked = [float(t) for t in time] if isinstance(time, Sequence) else [time]
        shown = [story.choose_time(t) for t in asked]
        index, chosen = shown[-1], story.choose_field(field)
        if film and len(story.times) < charts.MIN_POSES:
            raise SceneError(
                f"only {len(story.times)} poses were saved, too few for a film: run with a shorter "
                "output.fields_interval"
            )
    try:
        pictures.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SceneError(f"{pictures}: cannot be made ({error.strerror})") from error
    made: list[Path | None] = []
    if len(story.history["time"]) > 1:
        made.append(charts.time_series(story, pictures / "time-series.png"))
        made.append(charts.spectra(story, pictures / "spectra.png", windows))
    if story.fields is not None:
        made.append(charts.space_time(story, pictures / "space-time.png"))
        made.append(charts.rock(story, index, pictures / "rock.png"))
    if story.in_well:
        made += _well(story, chosen, shown, pictures)
    for name in ("spectra.png", "space-time.png", "rock.png", "clearance.png", "string-true.png"):
        if pictures / name not in made:  # of an earlier, longer or finer run in this folder
            (pictures / name).unlink(missing_ok=True)
    if story.fields is not None:
        made += _string(story, chosen, index, pictures, film)
    return [path for path in made if path is not None]


def _well(story: Any, field: str | None, shown: list[int], pictures: Path) -> list[Path | None]:
    from drillfem.render import well_charts

    index = shown[-1]
    if len(shown) == 1 and len(story.times) > 2:  # how it came there, from soon after the start
        shown = sorted({round(0.1 * index), index // 2, index})
    return [
        well_charts.plan_page(story, field, index, pictures / "well.png"),
        well_charts.clearance_page(story, field, index, pictures / "clearance.png"),
        well_charts.along_page(story, shown, pictures / "along.png"),
        well_charts.directors_page(story, shown, pictures / "directors.png"),
    ]


def _string(story: Any, field: str | None, index: int, pictures: Path, film: bool) -> list[Path | None]:
    from drillfem.render import poses, straight, well_view
    from drillfem.render.film import film as make_film
    from drillfem.render.studio import Studio

    made: list[Path | None] = []
    with Studio() as studio:
        if story.in_well:
            made.append(well_view.well_page(studio, story, field, index, pictures / "string.png"))
        elif story.sideways:
            made.append(poses.poses_page(studio, story, field, index, pictures / "string.png"))
            made.append(poses.true_poses_page(studio, story, field, index, pictures / "string-true.png"))
        else:
            made.append(straight.string_page(studio, story, field, index, pictures / "string.png"))
            made.append(straight.true_page(studio, story, field, index, pictures / "string-true.png"))
        if film:
            made.append(make_film(studio, story, field, pictures / "string.gif"))
    return made
