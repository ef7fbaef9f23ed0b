// The list of lobes. A new lobe is one header and one entry here.
#pragma once
#include <variant>

#include "shading/lobes/ashikhmin_shirley.h"
#include "shading/lobes/lambert.h"
#include "shading/lobes/microfacet.h"

namespace gi {

using Lobe = std::variant<Lambert, GgxLobe, BeckmannLobe, AshikhminShirley>;

}  // namespace gi
