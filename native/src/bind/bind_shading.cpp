// Ops and programs, for the node compiler and its tests.
#include <nanobind/stl/string.h>

#include "bind/bind.h"
#include "shading/program.h"

namespace nb = nanobind;

namespace gi::bind {

void bind_shading(nb::module_& m) {
  m.def(
      "ops",
      [] {
        nb::dict table;
        int code = 0;
        for (const Op& op : ops()) table[op.name] = nb::make_tuple(code++, op.outputs, op.inputs, op.immediates);
        return table;
      },
      "name -> (code, outputs, inputs, number of immediates); widths: 'f' is 1 register, 'v' is 3.");
}

}  // namespace gi::bind
