"""What depends on Blender's version in what its nodes mean."""

import bpy


def voronoi_hashes_floats() -> bool:
    """Blender 5.0 changed the hash of Voronoi cells, and with it every pattern."""
    return bpy.app.version < (5, 0, 0)


def normal_maps_take_short_normals() -> bool:
    """Up to Blender 4.5 Cycles makes the frame of a normal map from the interpolated normal as it is, shorter than one."""
    return bpy.app.version < (5, 0, 0)


def metal_has_no_film() -> bool:
    """Up to Blender 4.5 the thin film of the Principled BSDF is on its dielectric part alone."""
    return bpy.app.version < (5, 0, 0)


def straight_floats_are_associated() -> bool:
    """Up to Blender 4.5 Cycles takes the colours of float images for multiplied by alpha, however they are marked."""
    return bpy.app.version < (5, 0, 0)


def divided_bytes_are_associated() -> bool:
    """From Blender 5.0 on Cycles takes byte colours that Blender has divided by alpha for still multiplied by it."""
    return bpy.app.version >= (5, 0, 0)


def undisplaced_steps_differ() -> bool:
    """Up to Blender 4.5 what bumps a displaced surface steps over it by the size of a pixel on what it was before."""
    return bpy.app.version < (5, 0, 0)


def tangents_are_undisplaced() -> bool:
    """Up to Blender 4.5 true displacement leaves the tangents of UV maps as they were."""
    return bpy.app.version < (5, 0, 0)


def sharp_edges_part_meshes() -> bool:
    """Up to Blender 4.5 Cycles cuts meshes apart along sharp edges, and its vertices have the only normals there are."""
    return bpy.app.version < (5, 0, 0)


def thickness_is_unscaled() -> bool:
    """Up to Blender 4.5 the thickness of curves, which their nodes ask for, is that of the object before it is scaled."""
    return bpy.app.version < (5, 0, 0)


def hair_on_meshes_heeds_their_sides() -> bool:
    """From Blender 5.0 on Cycles leaves out light of Principled Hair on meshes that is on the one side of the surface and the other of the hair."""
    return bpy.app.version >= (5, 0, 0)


def ies_ends_in_darkness() -> bool:
    """Up to Blender 4.5 the curves of IES files bend towards 0 at the last angles."""
    return bpy.app.version < (5, 0, 0)
