// The list of lobes. A new lobe is one header and one entry here.
#pragma once
#include <variant>

#include "shading/lobes/lambert.h"

namespace gi {

using Lobe = std::variant<Lambert>;

}  // namespace gi
