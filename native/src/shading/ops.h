// The families of ops. A family is one ops_*.cpp file with a table at its end.
#pragma once
#include <span>

#include "shading/program.h"

namespace gi {

std::span<const Op> closure_ops();

}  // namespace gi
