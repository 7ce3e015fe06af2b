"""Rendered images of a model: colour, and geom ids with depth."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from sarsim.opengl import offscreen_context
from sarsim.sensors import culling

COLOUR_QUALITY = {"offsamples": 0, "shadowsize": 1024, "numslices": 24, "numstacks": 12}
"""An image with the default shadow map of 4096 texels takes three times as long and looks much the same."""
ID_QUALITY = {"offsamples": 0, "shadowsize": 0, "numslices": 48, "numstacks": 24}
"""Multisampling would blend ids and depths at edges (MuJoCo issue 1121). With this many faces, a sphere or cylinder
of 0.3 m radius deviates by at most 1 mm from the round shape; with the default number, it deviates by 2 mm."""

_RENDER = mujoco.mjtRndFlag
_HIDDEN_GROUP = 5  # the group of geoms that are not drawn
_CATEGORIES = mujoco.mjtCatBit.mjCAT_STATIC | mujoco.mjtCatBit.mjCAT_DYNAMIC


class Renderer(ExitStack):
    """Draws one model in one OpenGL context, without a screen.

    Two contexts in one process interfere with each other, so there is one renderer for all the cameras of a model.
    Only the thread that created the renderer may use it. Geoms of groups 0 to 2 are drawn, as in the viewer; sites
    are not.
    """

    def __init__(self, model: mujoco.MjModel, width: int = 640, height: int = 480) -> None:
        """Images have ``width`` × ``height`` pixels, whatever the model's own offscreen size.

        Raises:
            InputError: this machine cannot render on the platform that MUJOCO_GL names.
        """
        super().__init__()
        self.model = model
        self.width = width
        self.height = height
        self._gl = offscreen_context(width, height)
        self._colours = _resources(model, width, height, COLOUR_QUALITY)
        self._ids = _resources(model, width, height, ID_QUALITY)
        # MuJoCo draws with reversed z in a float buffer; without conversion, far depths keep their precision.
        self._ids.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._rectangle = mujoco.MjrRect(0, 0, width, height)
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 1000)
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        for last_first in (self._gl.free, self._ids.free, self._colours.free, self._gl.make_current):
            self.callback(last_first)

    def colour(self, data: mujoco.MjData, camera: int | str | mujoco.MjvCamera) -> Rgb:
        """(H, W, 3) uint8, the colour image of a camera."""
        self._update(data, camera, ids=False)
        pixels = np.empty((self.height, self.width, 3), np.uint8)
        self._draw(self._colours, pixels, None)
        return np.ascontiguousarray(pixels[::-1])

    def segmentation_and_depth(
        self, data: mujoco.MjData, camera: int | str | mujoco.MjvCamera
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """The geom id and depth of every pixel, from one render pass without multisampling.

        Both come from the same fragment, so they agree at edges too.

        Returns:
            (H, W) int32 geom id, -1 where there is no geom, and (H, W) float32 m, depth along the optical axis, 0
            where there is no geom.
        """
        self._update(data, camera, ids=True)
        pixels = np.empty((self.height, self.width, 3), np.uint8)
        buffer = np.empty((self.height, self.width), np.float32)
        self._draw(self._ids, pixels, buffer)
        geom = self._geom_ids(pixels[::-1])
        return geom, np.where(geom < 0, np.float32(0), self._metres(buffer[::-1]))

    def _update(self, data: mujoco.MjData, camera: int | str | mujoco.MjvCamera, *, ids: bool) -> None:
        """Update the scene from ``data`` with the geoms that the image needs."""
        self._gl.make_current()
        view = camera if isinstance(camera, mujoco.MjvCamera) else fixed_camera(self.model, camera)
        mujoco.mjv_updateCamera(self.model, data, view, self._scene)
        between_eyes = mujoco.mjv_averageCamera(*self._scene.camera)  # the scene has two, for stereo
        planes = culling.frustum(between_eyes, self.width / self.height)
        needed = (culling.visible_geoms if ids else culling.visible_or_shadowing_geoms)(self.model, data, planes)
        with hidden(self.model, ~needed):
            mujoco.mjv_updateScene(self.model, data, self._option, None, view, _CATEGORIES, self._scene)
        if not ids:
            _leave_out_shadows(self._scene, culling.shadowless_planes(self.model, data))
        self._set_flags(ids)

    def _set_flags(self, ids: bool) -> None:
        """Make the scene draw ids as flat colours, or light and shadow, but never reflections or haze."""
        flags = self._scene.flags
        flags[_RENDER.mjRND_SEGMENT] = flags[_RENDER.mjRND_IDCOLOR] = ids
        flags[_RENDER.mjRND_SHADOW] = flags[_RENDER.mjRND_SKYBOX] = not ids
        flags[_RENDER.mjRND_REFLECTION] = flags[_RENDER.mjRND_HAZE] = False

    def _draw(
        self, resources: mujoco.MjrContext, pixels: NDArray[np.uint8], depth: NDArray[np.float32] | None
    ) -> None:
        """Draw the scene into ``pixels`` and ``depth``, with the lowest row of the image first."""
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, resources)
        mujoco.mjr_render(self._rectangle, self._scene, resources)
        mujoco.mjr_readPixels(pixels, depth, self._rectangle, resources)

    def _geom_ids(self, pixels: NDArray[np.uint8]) -> NDArray[np.int32]:
        """(H, W) int32 geom ids from colours that number the scene's geoms from 1; 0 is the background."""
        table = np.full(self._scene.ngeom + 1, -1, np.int32)
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                table[geom.segid + 1] = geom.objid
        index = pixels[..., 0].astype(np.int32)
        index |= pixels[..., 1].astype(np.int32) << 8
        index |= pixels[..., 2].astype(np.int32) << 16
        return table.take(index)

    def _metres(self, buffer: NDArray[np.float32]) -> NDArray[np.float32]:
        """Depth in metres of a reversed-z buffer, which holds 1 at the near plane and 0 at the far plane.

        The buffer holds b = near (far - z) / (z (far - near)). The inverse is free of cancellation.
        """
        near = np.float32(self.model.vis.map.znear * self.model.stat.extent)
        far = np.float32(self.model.vis.map.zfar * self.model.stat.extent)
        return near * far / ((far - near) * buffer + near)


def fixed_camera(model: mujoco.MjModel, camera: int | str) -> mujoco.MjvCamera:
    """A camera of the model, by id or name; InputError if the model has no such camera."""
    index = model.camera(camera).id if isinstance(camera, int) and 0 <= camera < model.ncam else -1
    if isinstance(camera, str):
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, camera)
    if index < 0:
        raise InputError(f"the model has no camera {camera!r}")
    view = mujoco.MjvCamera()
    view.type = mujoco.mjtCamera.mjCAMERA_FIXED
    view.fixedcamid = index
    return view


@contextmanager
def hidden(model: mujoco.MjModel, geoms: NDArray[np.bool_]) -> Iterator[None]:
    """Within the context, put ``geoms``, (ngeom,) bool, into a group that is not drawn."""
    groups = model.geom_group.copy()
    model.geom_group[geoms] = _HIDDEN_GROUP
    try:
        yield
    finally:
        model.geom_group[:] = groups


def _leave_out_shadows(scene: mujoco.MjvScene, shadowless: NDArray[np.bool_]) -> None:
    """Leave out shadows that no image shows: those from lights that are off, and those of some geoms.

    ``shadowless``: (ngeom,) bool, the geoms whose shadows are left out.

    Shadows take most of the time of rendering an image, even if no shadow is visible in the image.
    """
    for light in scene.lights[: scene.nlight]:
        if not (light.ambient.any() or light.diffuse.any() or light.specular.any()):
            light.castshadow = 0
    for geom in scene.geoms[: scene.ngeom]:
        if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and shadowless[geom.objid]:
            geom.category = mujoco.mjtCatBit.mjCAT_DECOR  # MuJoCo's category of geoms that cast no shadow


def _resources(model: mujoco.MjModel, width: int, height: int, quality: dict[str, int]) -> mujoco.MjrContext:
    """The OpenGL resources of one kind of image: buffers, textures and meshes at a ``quality``.

    MuJoCo reads size and quality from the model; afterwards the model's own values are restored.
    """
    settings = [(model.vis.quality, name, value) for name, value in quality.items()]
    settings += [(model.vis.global_, "offwidth", width), (model.vis.global_, "offheight", height)]
    before = [getattr(owner, name) for owner, name, _ in settings]
    try:
        for owner, name, value in settings:
            setattr(owner, name, value)
        return mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    finally:
        for (owner, name, _), value in zip(settings, before, strict=True):
            setattr(owner, name, value)
