"""The layout with which the viewer opens a recording: the map, the camera, the metrics, the log and the legend."""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from pipeline.arrays import Place

_SCENE = (
    "+ $origin/**",
    # The images have their own views and would hide the map here.
    "- $origin/robot/camera/depth",
    "- $origin/robot/camera/labels",
    "- $origin/victims/photos",
    "- $origin/finds/photos",
    # The eye looks down from above, so a ceiling would hide the map.
    "- $origin/arena/ceiling/**",
)

_MAPS = "metric_map", "semantic_map", "segments"
_CORRECTED = *_MAPS, "traversability", "topological_map", "victims"


def blueprint(low: ArrayLike = (-3, -3, 0), high: ArrayLike = (3, 3, 1), tab: int = 0) -> rrb.Blueprint:
    """The layout of the viewer, which opens at the newest data and follows them during a run.

    Args:
        low, high: opposite corners of the box that the map views show, (3,) m in ``map``; see :func:`eye`.
        tab: index of the map view that is open.
    """
    maps = rrb.Tabs(
        _scene("Semantic map", low, high, hidden=["metric_map", "segments", "localisation"]),
        _scene(
            "Metric map", low, high, hidden=["metric_map/free", "semantic_map", "segments", "arena", "localisation"]
        ),
        _scene("Segments", low, high, hidden=["metric_map", "semantic_map", "arena", "localisation"]),
        _scene("Arena", low, high, hidden=[*_MAPS, "localisation"]),
        _scene("Localisation", low, high, hidden=[*_MAPS, "topological_map", "frontiers", "victims", "finds"]),
        active_tab=tab,
    )
    columns = rrb.TextLogColumns(timeline_columns=["sim_time"], text_log_columns=["loglevel", "body"])
    log = rrb.TextLogView(origin="log", name="Log", columns=columns)
    legend = rrb.Spatial2DView(origin="legend", name="Legend")
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(maps, _camera(), column_shares=[3, 1]),
            rrb.Horizontal(_plots(), log, legend, column_shares=[3, 8, 4]),  # log lines are cut off, not wrapped
            row_shares=[3, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline="sim_time", play_state="following"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _scene(name: str, low: ArrayLike, high: ArrayLike, hidden: list[str]) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="world",
        name=name,
        contents=list(_SCENE),
        line_grid=False,
        eye_controls=eye(np.asarray(low, np.float64), np.asarray(high, np.float64)),
        overrides={f"world/{entity}": [rrb.EntityBehavior(visible=False)] for entity in hidden},
    )


def eye(low: Place, high: Place) -> rrb.EyeControls3D:
    """The viewer's eye, which looks at the box from ``low`` to ``high`` from above and from the negative y direction.

    The box fills the window. The eye is so high that the strip of ground that a wall hides is only a third as wide as
    the wall is high.
    """
    middle = (low + high) / 2
    away = np.array([0, -1, 3]) * np.linalg.norm((high - low)[:2]) / 4
    return rrb.EyeControls3D(position=middle + away, look_target=middle)


def _camera() -> rrb.Vertical:
    camera = "world/robot/camera"
    pictures = rrb.Tabs(
        rrb.Spatial2DView(origin=camera, contents=[f"{camera}/labels"], name="Labels"),
        rrb.Spatial2DView(origin=camera, contents=[f"{camera}/depth"], name="Depth"),
        active_tab=0,
    )
    return rrb.Vertical(
        rrb.Spatial2DView(
            origin=camera, contents=[f"{camera}/rgb", f"{camera}/victims", f"{camera}/finds"], name="Colour"
        ),
        rrb.Tabs(
            rrb.Spatial2DView(origin="world/victims/photos", name="People"),
            rrb.Spatial2DView(origin="world/finds/photos", name="Finds"),
            active_tab=0,
        ),
        pictures,
    )


def _plots() -> rrb.Tabs:
    hidden = ["navigation", *(f"correction_{part}" for part in _CORRECTED)]
    stages = (f"- $origin/time_ms/{stage}" for stage in hidden)
    # The range is fixed because the first step, which loads compiled code, takes so long that it would flatten the
    # rest of the curve.
    times = _plot("Time, ms", "$origin/time_ms/**", *stages, axis_y=rrb.ScalarAxis(range=(0, 1e3)))
    tilt = _plot("Tilt, °", "$origin/roll_deg", "$origin/pitch_deg")
    position = _plot("Position, m", "$origin/position_error_m", "$origin/localisation/correction_m")
    explored = _plot("Explored area, m²", "$origin/explored_area_m2")
    return rrb.Tabs(explored, position, times, tilt, active_tab=0)


def _plot(name: str, *contents: str, axis_y: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
    whole = rr.TimeRange(start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin="metrics",
        contents=list(contents),
        name=name,
        axis_x=rrb.TimeAxis(view_range=whole),
        axis_y=axis_y,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop),
    )
