"""Convert images, maps and plans to the data types of Rerun; lengths are in m, positions in ``map``."""

from collections.abc import Sequence
from math import ceil, sqrt
from typing import Any

import cv2
import numpy as np
import rerun as rr
from numpy.typing import ArrayLike
from PIL import Image, ImageColor, ImageOps
from scipy.spatial.transform import Rotation

from pipeline.arrays import Labels, Places, Points, Pose, Poses, Rgb
from pipeline.explorer import Step
from pipeline.frame import Frame, jpeg
from pipeline.geometry.thinning import first_in_voxels
from pipeline.labels import COLOURS, PLAIN_NAMES, Label
from pipeline.lettering import write
from pipeline.localisation.localisation import Loop
from pipeline.metric_map.metric_map import MetricMap
from pipeline.segments.segments import Segments
from pipeline.semantic_map.semantic_map import SemanticMap
from pipeline.topological_map.topological_map import TopologicalMap

Colour = tuple[int, ...]
EDGE_COLOUR = ImageColor.getrgb("dodgerblue")  # visible on the viewer's dark background and on terrain
PLAN_COLOUR = ImageColor.getrgb("cyan")
FRONTIER_COLOUR = ImageColor.getrgb("magenta")
TRAJECTORY_COLOUR = ImageColor.getrgb("white")
TRUE_TRAJECTORY_COLOUR = ImageColor.getrgb("violet")
KEYFRAME_COLOUR = ImageColor.getrgb("orange")
LOOP_COLOUR = ImageColor.getrgb("red")
FREE_COLOUR = ImageColor.getrgb("lightskyblue")

CAPTION_FRACTION = 0.1  # Height of a photo's caption, including its margins, as a fraction of the photo's side
MARK_RADIUS = 0.08  # Radius of marks, m
LINE_RADIUS = 0.012  # Half the width of lines that must be visible from afar, m
ABOVE_GROUND = np.array([0, 0, 0.08])
"""Offset by which drawings on the ground are raised so that points and voxels do not hide them, m."""


def annotations() -> rr.AnnotationContext:
    """The names and colours of all labels."""
    return rr.AnnotationContext(
        [rr.AnnotationInfo(int(label), PLAIN_NAMES[label], tuple(COLOURS[label])) for label in Label]
    )


def transform(T: Pose) -> rr.Transform3D:
    """A pose as a Rerun transform."""
    return rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3])


def pinhole(frame: Frame) -> rr.Pinhole:
    """The pinhole model of a frame's camera, with x to the right, y down and z forward."""
    k = frame.intrinsics
    return rr.Pinhole(
        resolution=[k.width, k.height],
        focal_length=[k.fx, k.fy],
        principal_point=[k.cx, k.cy],
        camera_xyz=rr.ViewCoordinates.RDF,
    )


def colour_image(rgb: Rgb) -> rr.EncodedImage:
    """A colour image, encoded as JPEG."""
    return rr.EncodedImage(contents=jpeg(rgb), media_type="image/jpeg")


def depth_image(frame: Frame) -> rr.EncodedDepthImage:
    """A frame's depth as a PNG in whole mm, 0 = no return; the colour scale ends at the camera's maximum range."""
    # Higher compression levels take five times as long and reduce the size by only a tenth.
    _, data = cv2.imencode(".png", frame.depth_mm, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    unit = 1e-3
    return rr.EncodedDepthImage(
        data.tobytes(),
        media_type="image/png",
        meter=unit,
        colormap="turbo",
        depth_range=(0, frame.sensor.farthest / unit),
    )


def label_image(frame: Frame, labels: Labels) -> rr.SegmentationImage:
    """The labels of a frame's returns as an image; pixels without a return are unlabelled."""
    image = np.full(frame.depth.shape, Label.UNLABELLED, np.uint8)
    image[frame.returns] = labels
    return rr.SegmentationImage(image)


def occupied_voxels(metric_map: MetricMap) -> rr.VoxelGridMap:
    """The occupied voxels of the map, coloured by height from 0 to 1 m."""
    centres = metric_map.occupied_centres()
    return _voxels(metric_map, centres, values=centres[:, 2].clip(0, 1), colormap="viridis")


def free_voxels(metric_map: MetricMap) -> rr.VoxelGridMap:
    """The free voxels of the map, nearly transparent."""
    centres = metric_map.free_centres()
    colours = np.tile(np.array(FREE_COLOUR, np.uint8), (len(centres), 1))
    return _voxels(metric_map, centres, colors=colours, opacity=0.03)


def _voxels(metric_map: MetricMap, centres: Points, **style: Any) -> rr.VoxelGridMap:
    size = metric_map.voxel_size
    return rr.VoxelGridMap(
        metric_map.voxel_index(centres).astype(np.int32),
        voxel_size=np.full(3, size),
        translation=metric_map.voxel_centre(np.zeros((1, 3), np.int64))[0] - size / 2,
        **style,
    )


def labelled_points(semantic_map: SemanticMap, side: float) -> rr.Points3D:
    """The semantic map, thinned to the oldest point in every cube with edges of ``side`` m.

    Each point is drawn as large as the sphere around its cube.
    """
    points = semantic_map.points()
    oldest = first_in_voxels(points, 1 / side)
    return rr.Points3D(points[oldest], class_ids=semantic_map.labels()[oldest], radii=side * sqrt(3) / 2)


def segment_boxes(segments: Segments) -> rr.Boxes3D:
    """The segments' bounding boxes in the colours of their labels."""
    boxes = [segment.box for segment in segments]
    poses = np.array([box.T_map_box for box in boxes]).reshape(-1, 4, 4)
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat() if boxes else np.zeros((0, 4))
    return rr.Boxes3D(
        centers=poses[:, :3, 3],
        half_sizes=np.array([box.extent / 2 for box in boxes]).reshape(-1, 3),
        quaternions=quaternions,
        class_ids=[int(segment.label) for segment in segments],
        labels=[f"{PLAIN_NAMES[segment.label]} {segment.id}" for segment in segments],
        show_labels=False,
        fill_mode="transparentfillmajorwireframe",
    )


def nodes(topology: TopologicalMap) -> rr.Points3D:
    """The nodes of the topological map, with their ids, in the colours of the segments on which they lie."""
    places = np.array([node.position for node in topology.nodes.values()]).reshape(-1, 3)
    return rr.Points3D(
        places + ABOVE_GROUND,
        class_ids=[int(node.label) for node in topology.nodes.values()],
        labels=[str(n) for n in topology.nodes],
        show_labels=False,
        radii=MARK_RADIUS,
    )


def edges(topology: TopologicalMap) -> rr.LineStrips3D:
    """The edges of the topological map, along which paths are planned."""
    ways = [topology.edge_path(a, b) for a, b in topology.graph.edges]
    return rr.LineStrips3D([way + ABOVE_GROUND for way in ways], colors=EDGE_COLOUR, radii=LINE_RADIUS)


def path(step: Step) -> rr.LineStrips3D:
    """The path from the robot to the next viewpoint, and a short line along the heading at the viewpoint.

    Without a plan, there are no lines.
    """
    strips = []
    if step.plan is not None:
        strips.append(np.vstack([step.keyframe.T_map_base[:3, 3], step.plan.waypoints]))
    if step.plan is not None and step.viewpoint is not None:
        yaw = step.viewpoint.heading
        heading = np.array([np.cos(yaw), np.sin(yaw), 0]) / 3
        strips.append(step.plan.waypoints[-1] + np.array([np.zeros(3), heading]))
    return rr.LineStrips3D([strip + 2 * ABOVE_GROUND for strip in strips], colors=PLAN_COLOUR, radii=2 * LINE_RADIUS)


def frontier_points(frontiers: Places) -> rr.Points3D:
    """The centres of the frontiers."""
    return rr.Points3D(frontiers + ABOVE_GROUND, colors=FRONTIER_COLOUR, radii=MARK_RADIUS)


def keyframes(poses: Poses) -> rr.Arrows3D:
    """An arrow at each keyframe's position, along the heading of the robot."""
    return rr.Arrows3D(
        origins=poses[:, :3, 3] + ABOVE_GROUND,
        vectors=0.12 * poses[:, :3, 0],
        colors=KEYFRAME_COLOUR,
        labels=[f"keyframe {k}" for k in range(len(poses))],
        show_labels=False,
    )


def loops(found: Sequence[Loop], poses: Poses) -> rr.LineStrips3D:
    """Lines between the keyframes that loop closures connect, given the poses of all keyframes."""
    ends = [(loop.first, loop.second) for loop in found]
    return rr.LineStrips3D(
        [poses[list(pair), :3, 3] + ABOVE_GROUND for pair in ends],
        colors=LOOP_COLOUR,
        labels=[f"loop closure between keyframes {second} and {first}" for first, second in ends],
        show_labels=False,
    )


def trajectory(positions: Sequence[ArrayLike], colour: Colour) -> rr.LineStrips3D:
    """The line through positions, (3,) m each."""
    return rr.LineStrips3D([np.array(positions) + ABOVE_GROUND], colors=colour)


def sheet(photos: Sequence[tuple[str, Rgb, Colour]], side: int) -> rr.EncodedImage:
    """Photos with captions, arranged row by row in a square image.

    Args:
        photos: each photo's caption, the photo, and the caption's colour.
        side: side of a photo, caption included, pixels. Every sheet is scaled to the size of 3 × 3 photos, because
            the viewer treats the JPEGs of one entity as the frames of a video.
    """
    cells = [_photo(*photo, side) for photo in photos]
    row = ceil(sqrt(len(cells))) or 1
    cells += [np.zeros((side, side, 3), np.uint8)] * (row**2 - len(cells))
    whole = np.vstack([np.hstack(cells[k : k + row]) for k in range(0, len(cells), row)])
    size = 3 * side, 3 * side
    return colour_image(np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.uint8))


def _photo(text: str, photo: Rgb, colour: Colour, side: int) -> Rgb:
    """A photo, scaled to fit above its caption."""
    caption = round(CAPTION_FRACTION * side)
    fitted = np.asarray(ImageOps.pad(Image.fromarray(photo), (side, side - caption)))
    cell = np.vstack([fitted, np.zeros((caption, side, 3), np.uint8)])
    write(cell, (caption // 4, side - caption // 4), text, 0.8 * caption, colour)
    return cell
