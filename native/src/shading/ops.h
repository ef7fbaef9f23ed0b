// The families of ops. A family is one ops_*.cpp file with a table at its end; those that ask the scene live in scene/.
#pragma once
#include <span>

#include "shading/program.h"

namespace gi {

std::span<const Op> math_ops();
std::span<const Op> vector_ops();
std::span<const Op> color_ops();
std::span<const Op> input_ops();
std::span<const Op> normal_ops();
std::span<const Op> ray_ops();
std::span<const Op> texture_ops();
std::span<const Op> closure_ops();
std::span<const Op> principled_ops();
std::span<const Op> volume_ops();
std::span<const Op> hair_ops();
std::span<const Op> strand_ops();

}  // namespace gi
