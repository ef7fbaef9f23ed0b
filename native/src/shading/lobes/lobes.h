// The list of lobes. A new lobe is one header and one entry here.
#pragma once
#include <variant>

#include "shading/lobes/ashikhmin_shirley.h"
#include "shading/lobes/hair_chiang.h"
#include "shading/lobes/hair_huang.h"
#include "shading/lobes/hair_strand.h"
#include "shading/lobes/lambert.h"
#include "shading/lobes/microfacet.h"
#include "shading/lobes/oren_nayar.h"
#include "shading/lobes/sheen.h"
#include "shading/lobes/thin_transmission.h"
#include "shading/lobes/toon.h"
#include "shading/lobes/translucent.h"

namespace gi {

using Lobe = std::variant<Lambert, OrenNayar, Translucent, GgxLobe, BeckmannLobe, AshikhminShirley, ThinTransmission, Sheen, Velvet, Toon,
                          HairStrand, HairChiang, HairHuang>;

}  // namespace gi
