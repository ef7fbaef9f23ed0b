// Images that hold a cube of voxels: as wide as it has voxels, row upon row, layer upon layer. Black and without density outside.
#pragma once
#include "shading/images.h"

namespace gi {

// At `p` in the unit cube. Nothing where the image is no cube of `side` voxels.
Texel lookup_voxels(const Image& image, int side, Vec3 p, Interpolation interpolation);

}  // namespace gi
