// All ops in one table: the index is the op code. Python asks for the codes, so their order means nothing outside.
#include "shading/ops.h"

namespace gi {

std::span<const Op> ops() {
  static const std::vector<Op> all = [] {
    std::vector<Op> table{{"jump_if_zero", "", "f", 1, OpKind::kControl, nullptr}};
    for (const std::span<const Op> family : {math_ops(), vector_ops(), color_ops(), input_ops(), normal_ops(), ray_ops(), texture_ops(),
                                             closure_ops(), principled_ops(), volume_ops(), hair_ops(), strand_ops()})
      table.insert(table.end(), family.begin(), family.end());
    return table;
  }();
  return all;
}

}  // namespace gi
