"""Puts a skin on a robot: copies the other model's pieces, meshes and materials included, onto our bodies."""

from __future__ import annotations

import mujoco

from robots.model.skin import SHOWN, Skin
from twin import geometry as geo
from twin.geometry import Array


def wear(robot: mujoco.MjSpec, skin: Skin, hidden: int) -> None:
    """Put the skin on an editable model of the robot; its bodies' shapes go to geom group `hidden`."""
    for name in skin.bodies:
        for geom in robot.body(name).geoms:
            geom.group = hidden
    meshes: dict[int, str] = {}
    materials: dict[int, str] = {}
    model = skin.model
    for piece in skin.pieces:
        mesh, material = int(model.geom_dataid[piece.geom]), int(model.geom_matid[piece.geom])
        if mesh >= 0 and mesh not in meshes:
            meshes[mesh] = _add_mesh(robot, model, mesh)
        if material >= 0 and material not in materials:
            materials[material] = _add_material(robot, model, material)
        robot.body(piece.body).add_geom(
            type=mujoco.mjtGeom(int(model.geom_type[piece.geom])),
            size=model.geom_size[piece.geom],
            pos=piece.T_body_geom[:3, 3],
            quat=geo.quat_wxyz_from_matrix(piece.T_body_geom[:3, :3]),
            meshname=meshes.get(mesh, ""),
            material=materials.get(material, ""),
            rgba=model.geom_rgba[piece.geom],
            group=SHOWN,
            contype=0,
            conaffinity=0,
            mass=0.0,
        )


def _add_mesh(robot: mujoco.MjSpec, model: mujoco.MjModel, mesh: int) -> str:
    """Copy a compiled mesh; returns its name. Surface stands for mass, as visuals are seldom closed."""
    name = f"looks/{mesh}"

    def rows(values: Array, starts: Array, counts: Array) -> Array:
        start = int(starts[mesh])
        return values[start : start + int(counts[mesh])].ravel()

    added = robot.add_mesh(
        name=name,
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        uservert=rows(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum),
        userface=rows(model.mesh_face, model.mesh_faceadr, model.mesh_facenum),
        usernormal=rows(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum),
        userfacenormal=rows(model.mesh_facenormal, model.mesh_faceadr, model.mesh_facenum),
    )
    if model.mesh_texcoordadr[mesh] >= 0:
        added.usertexcoord = rows(model.mesh_texcoord, model.mesh_texcoordadr, model.mesh_texcoordnum)
        added.userfacetexcoord = rows(model.mesh_facetexcoord, model.mesh_faceadr, model.mesh_facenum)
    return name


def _add_material(robot: mujoco.MjSpec, model: mujoco.MjModel, material: int) -> str:
    """Copy a compiled material with its colour texture; returns its name."""
    name = f"looks/{material}"
    added = robot.add_material(
        name=name,
        rgba=model.mat_rgba[material],
        emission=model.mat_emission[material],
        specular=model.mat_specular[material],
        shininess=model.mat_shininess[material],
        reflectance=model.mat_reflectance[material],
        texrepeat=model.mat_texrepeat[material],
        texuniform=model.mat_texuniform[material],
    )
    role = mujoco.mjtTextureRole.mjTEXROLE_RGB
    k = int(model.mat_texid[material, role])
    if k >= 0:
        height, width, channels = (int(v[k]) for v in (model.tex_height, model.tex_width, model.tex_nchannel))
        start = int(model.tex_adr[k])
        robot.add_texture(
            name=f"{name}/colour",
            type=mujoco.mjtTexture(int(model.tex_type[k])),
            width=width,
            height=height,
            nchannel=channels,
            data=model.tex_data[start : start + height * width * channels],
        )
        added.textures[role] = f"{name}/colour"
    return name
