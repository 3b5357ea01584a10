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
    time: float | None = None,
    field: str | None = None,
    film: bool = False,
    windows: Sequence[tuple[float, float]] | None = None,
) -> list[Path]:
    """Make the pictures of the result in ``folder`` and put them into ``folder``/pictures.

    Args:
        folder: a result folder.
        time: which moment to show, s; the saved pose next to it is taken, the last one by default.
        field: scalar field that colours the string; the most telling one by default.
        film: make string.gif as well.
        windows: times (s) between which spectra are taken; `drillfem.results.windows` by default.

    Returns:
        The files written: time-series.png, spectra.png, space-time.png, rock.png (those that apply),
        string.png, string-true.png, and string.gif.

    Raises:
        SceneError: no result there, an unknown field, or a time or window outside the run.
        MissingDependency: pyvista is not installed; the charts are made all the same.
    """
    from drillfem.results import open_result

    return render_result(open_result(folder), Path(folder) / "pictures", time, field, film, windows)


def render_result(
    result: Any,
    pictures: Path,
    time: float | None = None,
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
        index, chosen = -1, None
    else:
        index, chosen = story.choose_time(time), story.choose_field(field)
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
    for name in ("spectra.png", "space-time.png", "rock.png"):
        if pictures / name not in made:  # of an earlier, longer or finer run in this folder
            (pictures / name).unlink(missing_ok=True)
    if story.fields is not None:
        made += _string(story, chosen, index, pictures, film)
    return [path for path in made if path is not None]


def _string(story: Any, field: str | None, index: int, pictures: Path, film: bool) -> list[Path | None]:
    from drillfem.render import poses, straight
    from drillfem.render.film import film as make_film
    from drillfem.render.studio import Studio

    made: list[Path | None] = []
    with Studio() as studio:
        if story.sideways:
            made.append(poses.poses_page(studio, story, field, index, pictures / "string.png"))
            made.append(poses.true_poses_page(studio, story, field, index, pictures / "string-true.png"))
        else:
            made.append(straight.string_page(studio, story, field, index, pictures / "string.png"))
            made.append(straight.true_page(studio, story, field, index, pictures / "string-true.png"))
        if film:
            made.append(make_film(studio, story, field, pictures / "string.gif"))
    return made
