"""A MuJoCo camera that renders as cheaply as its render profile allows.

MuJoCo's own `mujoco.Renderer` frees its OpenGL context before the objects in it, so that with several renderers
in one process the objects of another are freed in their place; this one frees them in order.
"""

from __future__ import annotations

import atexit
import importlib
import os
import sys
import weakref
from contextlib import nullcontext
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np
import torch
from PIL import Image

from bootifol.envs.meshes import coarse_meshes
from bootifol.envs.pictures import RenderProfile
from bootifol.errors import BootifolError
from bootifol.plugins import told
from bootifol.types import Frame


@dataclass(frozen=True)
class RenderQuality:
    """What a render profile means to MuJoCo; None leaves the model's own setting."""

    shadow_map: int | None
    """Height and width of the shadow map in texels; 0 draws no shadows."""
    samples: int | None
    """Samples per pixel of OpenGL's anti-aliasing (MSAA), which is slow in software."""
    reflections: bool
    sky: bool
    """Whether what lies behind the scene is drawn or black; reacher's floor hides all of it."""
    round_sides: int | None
    """Sides of a circle; spheres and capsules are drawn as polyhedra, and their corners cost time, too."""
    mesh_cell: float
    """Vertices of meshes within a cell of so many meters are drawn as one (`coarse_meshes`); 0 draws all."""
    oversampling: int
    """The picture is rendered this many times as high and wide, then averaged: cheap anti-aliasing."""


QUALITIES: dict[RenderProfile, RenderQuality] = {
    "fast": RenderQuality(
        round_sides=16,
        shadow_map=0,
        samples=0,
        reflections=False,
        sky=False,
        mesh_cell=0.005,
        oversampling=2,
    ),
    "balanced": RenderQuality(
        round_sides=None,
        shadow_map=512,
        samples=0,
        reflections=True,
        sky=True,
        mesh_cell=0.0,
        oversampling=1,
    ),
    "full": RenderQuality(
        round_sides=None,
        shadow_map=None,
        samples=None,
        reflections=True,
        sky=True,
        mesh_cell=0.0,
        oversampling=1,
    ),
}

_open_cameras: weakref.WeakSet[Camera] = weakref.WeakSet()
_closes_at_exit = False


class Camera:
    """Films a MuJoCo model.

    Args:
        model: `mujoco.MjModel`; its quality settings and the size of its offscreen buffer are changed.
        size: height and width of the pictures in pixels.
        profile: the render profile.
        camera: index of the model's camera.

    Raises:
        BootifolError: OpenGL is missing or does not work.
    """

    def __init__(self, model: Any, size: int, profile: RenderProfile, camera: int = 0) -> None:
        mujoco = load_mujoco()
        quality = QUALITIES[profile]
        self._mujoco, self._model = mujoco, model
        self._oversampling = quality.oversampling
        rendered = size * quality.oversampling
        model.vis.global_.offwidth = model.vis.global_.offheight = rendered
        if quality.samples is not None:
            model.vis.quality.offsamples = quality.samples
        if quality.round_sides is not None:
            model.vis.quality.numslices = quality.round_sides
            model.vis.quality.numstacks = quality.round_sides // 2
        if quality.shadow_map is not None:
            model.vis.quality.shadowsize = quality.shadow_map
        self._pixels = np.empty((rendered, rendered, 3), np.uint8)
        self._rectangle = mujoco.MjrRect(0, 0, rendered, rendered)
        self._options = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.type, self._camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, camera
        self._scene = mujoco.MjvScene(model, maxgeom=10_000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = quality.shadow_map != 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = quality.reflections
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = quality.sky
        self._opengl: Any = None
        self._objects: Any = None
        try:
            self._opengl = _context_class(mujoco)(rendered, rendered)
            self._opengl.make_current()
            with coarse_meshes(model, quality.mesh_cell) if quality.mesh_cell else nullcontext():
                self._objects = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._objects)
        except Exception as error:  # each OpenGL platform fails with exceptions of its own
            raise no_rendering(error) from error
        _open_cameras.add(self)
        _close_cameras_at_exit()

    def picture(self, data: Any) -> Frame:
        """The state `data` (`mujoco.MjData`), uint8 `[size, size, 3]`."""
        mujoco = self._mujoco
        self._opengl.make_current()
        mujoco.mjv_updateScene(
            self._model, data, self._options, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        mujoco.mjr_render(self._rectangle, self._scene, self._objects)
        mujoco.mjr_readPixels(self._pixels, None, self._rectangle, self._objects)
        pixels = self._pixels
        if self._oversampling > 1:
            pixels = np.asarray(Image.fromarray(pixels).reduce(self._oversampling))
        # OpenGL's first row is the lowest.
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Frees what OpenGL holds; the camera cannot be used afterwards."""
        if self._objects is not None:
            self._opengl.make_current()
            self._objects.free()
            self._objects = None
        if self._opengl is not None:
            self._opengl.free()
            self._opengl = None

    def __del__(self) -> None:
        # `__init__` may have failed before there was anything to free.
        if getattr(self, "_opengl", None) is not None:
            self.close()


def prepare_opengl() -> None:
    """To be called before the first OpenGL context: on Linux without a display MuJoCo renders through EGL unless
    the user chose otherwise."""
    if torch.version.cuda is not None:
        # CUDA builds of torch import Triton with this module, which crashes once Mesa has loaded its LLVM.
        importlib.import_module("torch._dynamo")
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")


def load_mujoco() -> Any:
    """The `mujoco` module, ready to render.

    Raises:
        BootifolError: MuJoCo or the OpenGL platform it was told to use cannot be imported.
    """
    prepare_opengl()
    return load_simulator("mujoco", "dm-control")


def load_simulator(module: str, extra: str) -> Any:
    """A simulator's module.

    Args:
        module: its name.
        extra: of bootifol, which installs it.

    Raises:
        BootifolError: it is not installed, does not go with the installed MuJoCo, or MuJoCo cannot load its OpenGL
            platform.
    """
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        missing = (error.name or package).partition(".")[0]
        whose = "this task" if missing == package else package
        raise BootifolError(
            f"{whose} needs {missing}, which is not installed; type `pip install 'bootifol[{extra}]'`"
        ) from error
    except AttributeError as error:  # as of a field of MuJoCo's that another version has
        if package == "mujoco" or "GL" in str(error):  # PyOpenGL's, where there is no platform
            raise no_rendering(error) from error
        raise unlike_mujoco(package, extra, error) from error
    except Exception as error:  # each OpenGL platform fails with exceptions of its own
        raise no_rendering(error) from error


def unlike_mujoco(package: str, extra: str, error: BaseException) -> BootifolError:
    """The sentence for a simulator that was written for another version of MuJoCo."""
    versions = " and ".join(f"{name} {metadata.version(name)}" for name in (package, "mujoco"))
    return BootifolError(
        f"{versions} do not go together ({told(error)}); type `pip install --upgrade 'bootifol[{extra}]'` for versions "
        "that do"
    )


def _context_class(mujoco: Any) -> Any:
    """MuJoCo chose its own when it was first imported, which may have been before `load_mujoco` chose EGL."""
    if os.environ.get("MUJOCO_GL", "").strip().lower() == "egl":
        return importlib.import_module("mujoco.egl").GLContext
    return mujoco.GLContext


def no_rendering(error: BaseException) -> BootifolError:
    """The sentence for a machine that cannot render."""
    platform = os.environ.get("MUJOCO_GL", "unset")
    headless = "" if platform == "egl" else "type `export MUJOCO_GL=egl`, and "
    return BootifolError(
        f"MuJoCo cannot render pictures here (MUJOCO_GL is {platform}; {type(error).__name__}: {error}); {headless}on "
        "Debian or Ubuntu type `apt-get install libegl1 libgl1-mesa-dri` (as root), then try `bootifol doctor`"
    )


def _close_cameras_at_exit() -> None:
    """Closes cameras before MuJoCo's own exit handler takes the display away (handlers run last in, first out)."""
    global _closes_at_exit
    if not _closes_at_exit:
        _closes_at_exit = True
        atexit.register(_close_cameras)


def _close_cameras() -> None:
    for camera in list(_open_cameras):
        camera.close()
