// Colours of spectra in scene-linear Rec. 709: black bodies and single wavelengths.
#pragma once
#include "core/vec.h"

namespace gi {

// Luminance 1 from 800 K to 12000 K, and as at these ends beyond them; what is out of gamut is cut off at 0.
Vec3 blackbody_color(float kelvin);
// Of monochromatic light, scaled as Blender's Wavelength node does.
Vec3 wavelength_color(float nanometres);

}  // namespace gi
